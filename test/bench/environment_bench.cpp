// Steps of the environments, and the replay they fill.
#include <cmath>
#include <vector>

#include "bench_util.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/env/mountain_car.h"
#include "pmeta_core/env/sparse_point.h"
#include "pmeta_core/replay/prioritised_replay.h"

namespace bench {
namespace {

constexpr int kSteps = 1000;

// seconds seconds of a step with random actions; episodes' starts are part of it
double stepSeconds(benchmark::State& state, pmeta::Env& env) {
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  std::vector<double> actions(4096);
  const int num_actions = env.spec().num_actions;
  for (double& action : actions) {
    action = num_actions > 0 ? static_cast<double>(rng.below(num_actions)) : 2 * rng.uniform() - 1;
  }
  std::vector<double> observation(env.spec().observation_size);
  env.reset(rng, observation.data());
  std::size_t i = 0;
  return callSeconds(state, kSteps, [&] {
    const pmeta::Step step = env.step(&actions[i++ % 4000], rng, observation.data());
    if (step.terminated || step.truncated) env.reset(rng, observation.data());
    benchmark::DoNotOptimize(observation.data());
  });
}

// seconds seconds of `call` on small angles
template <class Call>
double angleSeconds(Call&& call) {
  double angle = 0.01;
  return callSeconds(40, kSteps, [&] {
    benchmark::DoNotOptimize(angle);
    benchmark::DoNotOptimize(call(angle));
  });
}

void CartPoleStep(benchmark::State& state) {
  pmeta::CartPole env({});
  const double limit = angleSeconds([](double x) { return std::sin(x) + std::cos(x); });
  report({Part::kLoops, 20}, "CartPole step", Unit::kSeconds, stepSeconds(state, env), limit,
         "its sine and cosine");
}
BENCHMARK(CartPoleStep)->Unit(benchmark::kMicrosecond);

void MountainCarStep(benchmark::State& state) {
  pmeta::MountainCar env({});
  const double limit = angleSeconds([](double x) { return std::cos(3 * x); });
  report({Part::kLoops, 21}, "MountainCar step", Unit::kSeconds, stepSeconds(state, env), limit,
         "its cosine");
}
BENCHMARK(MountainCarStep)->Unit(benchmark::kMicrosecond);

void GridworldStep(benchmark::State& state) {
  pmeta::Gridworld env({8, 7, 7, 0}, 8);
  report({Part::kLoops, 22}, "gridworld step", Unit::kSeconds, stepSeconds(state, env));
}
BENCHMARK(GridworldStep)->Unit(benchmark::kMicrosecond);

void SparsePointStep(benchmark::State& state) {
  pmeta::SparsePoint env({});
  report({Part::kLoops, 26}, "point robot step", Unit::kSeconds, stepSeconds(state, env));
}
BENCHMARK(SparsePointStep)->Unit(benchmark::kMicrosecond);

// what ten environments add to an update, beside their actions
void TenCartPoleSteps(benchmark::State& state) {
  pmeta::CartPole env({});
  const double update = dqnUpdateSeconds();
  report({Part::kShareOfUpdate, 20}, "10 CartPole steps", Unit::kSeconds,
         10 * stepSeconds(state, env), update, "DQN update");
}
BENCHMARK(TenCartPoleSteps)->Unit(benchmark::kMicrosecond);

pmeta::PrioritisedReplay fullReplay(std::size_t capacity) {
  pmeta::PrioritisedReplay replay(capacity, 4, 1, 0.6, 0.4);
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  const pmeta::AlignedFloats numbers = noise(4096 + 16);
  for (std::size_t i = 0; i < capacity; ++i) {
    const float* x = &numbers[rng.below(4096)];
    const float action = static_cast<float>(rng.below(2));
    replay.add({x, &action, 1.0f, 0.97f, x + 4});
  }
  return replay;
}

// sampling 64 of 200 000 and giving them new priorities
void ReplaySampleAndUpdate(benchmark::State& state) {
  constexpr int kSamples = 64;
  static pmeta::PrioritisedReplay replay = fullReplay(200000);
  pmeta::Rng rng(0, 0, pmeta::Stream::kSample);
  pmeta::ReplayBatch batch;
  const pmeta::AlignedFloats errors = noise(4096);
  // priorities as unequal as learning makes them
  for (int i = 0; i < 10000; ++i) {
    replay.sample(kSamples, rng, batch);
    replay.setPriorities(batch, &errors[rng.below(4096 - kSamples)]);
  }
  const double update = dqnUpdateSeconds();
  const double seconds = callSeconds(state, 4, [&] {
    replay.sample(kSamples, rng, batch);
    replay.setPriorities(batch, &errors[rng.below(4096 - kSamples)]);
  });
  report({Part::kShareOfUpdate, 0}, "replay: 64 of 200 000 sampled, new priorities", Unit::kSeconds,
         seconds, update, "DQN update");
}
BENCHMARK(ReplaySampleAndUpdate)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
