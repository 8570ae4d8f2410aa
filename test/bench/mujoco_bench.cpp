// Steps of the MuJoCo environments beside a bare loop of mj_step on the same model, and of one that
// is written in YAML beside the built-in one.
#include <mujoco/mujoco.h>

#include <memory>
#include <vector>

#include "bench_util.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"
#include "pmeta_core/experiment/experiment.h"

namespace bench {
namespace {

constexpr int kSteps = 10;            // in a batch
constexpr int kBatchesInEpisode = 8;  // which then starts again

// mj_step from a state of an environment, and nothing else
class BareLoop {
 public:
  BareLoop(const pmeta::MujocoEnv& env, int frame_skip)
      : model_(env.simulation().model().get()),
        data_(mj_makeData(model_), mj_deleteData),
        frame_skip_(frame_skip) {}

  void start(const std::vector<double>& state) {
    mj_resetData(model_, data_.get());
    const double* next = state.data();
    mju_copy(data_->qpos, next, model_->nq);
    mju_copy(data_->qvel, next + model_->nq, model_->nv);
    mju_copy(data_->qacc_warmstart, next + model_->nq + model_->nv, model_->nv);
  }

  void step(const double* action) {
    mju_copy(data_->ctrl, action, model_->nu);
    for (int i = 0; i < frame_skip_; ++i) mj_step(model_, data_.get());
  }

 private:
  const mjModel* model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
  int frame_skip_;
};

// another environment of the half-cheetah, from the same state
class BuiltIn {
 public:
  void start(const std::vector<double>& state) {
    std::vector<double> own(state.begin(), state.begin() + 27);  // qpos, qvel, warm start
    own.insert(own.end(), {state[0], 0, state[1], 0});  // about where the torso is; no steps
    env_.setState(own);
  }
  void step(const double* action) {
    benchmark::DoNotOptimize(env_.step(action, rng_, observation_));
  }

 private:
  pmeta::HalfCheetah env_{{}, pmeta::MujocoModel::open("", pmeta::HalfCheetah::layout())};
  pmeta::Rng rng_{0, 0, pmeta::Stream::kMeasure};
  double observation_[20] = {};
};

// both take the same steps, batch by batch in turns
template <class Other>
void stepBeside(benchmark::State& state, int row, const char* name, pmeta::Env& env, Other& other,
                const char* limit) {
  const std::size_t action_size = env.spec().action_size;
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  std::vector<double> actions(action_size * kSteps);
  std::vector<double> observation(env.spec().observation_size);
  std::vector<double> env_times, other_times;
  const auto timeEnv = [&] {
    const double* action = actions.data();
    env_times.push_back(meanSeconds(kSteps, [&] {
      benchmark::DoNotOptimize(env.step(action, rng, observation.data()));
      action += action_size;
    }));
  };
  const auto timeOther = [&] {
    const double* action = actions.data();
    other_times.push_back(meanSeconds(kSteps, [&] {
      other.step(action);
      action += action_size;
    }));
  };
  for (auto _ : state) {
    env.reset(rng, observation.data());
    for (int batch = 0; batch < kBatchesInEpisode; ++batch) {
      for (double& action : actions) action = 2 * rng.uniform() - 1;
      other.start(env.state());
      // who comes second finds the caches warm
      if (batch % 2 == 0) timeEnv();
      timeOther();
      if (batch % 2 == 1) timeEnv();
    }
  }
  state.SetItemsProcessed(state.iterations() * kBatchesInEpisode * kSteps);
  report({Part::kLoops, row}, name, Unit::kSeconds, undisturbed(env_times),
         undisturbed(other_times), limit);
}

void stepBeside(benchmark::State& state, int row, const char* name, pmeta::MujocoEnv& env,
                int frame_skip) {
  BareLoop bare(env, frame_skip);
  stepBeside(state, row, name, env, bare, "a bare loop of mj_step");
}

void HalfCheetahStep(benchmark::State& state) {
  pmeta::HalfCheetah env({}, pmeta::MujocoModel::open("", pmeta::HalfCheetah::layout()));
  stepBeside(state, 23, "half-cheetah step", env, 5);
}
BENCHMARK(HalfCheetahStep)->Unit(benchmark::kMicrosecond);

void HalfCheetahInYamlStep(benchmark::State& state) {
  const auto yaml = pmeta::Experiment::load(PMETA_TEST_DATA "/mjcf/half_cheetah_dir.yaml");
  const auto env = yaml.family().make(1);
  BuiltIn built_in;
  stepBeside(state, 27, "half-cheetah step, in YAML", *env, built_in, "the built-in one");
}
BENCHMARK(HalfCheetahInYamlStep)->Unit(benchmark::kMicrosecond);

void AntStep(benchmark::State& state) {
  pmeta::Ant env(0, pmeta::MujocoModel::open("", pmeta::Ant::layout()));
  stepBeside(state, 24, "ant step (with contact forces)", env, 5);
}
BENCHMARK(AntStep)->Unit(benchmark::kMicrosecond);

void Walker2dStep(benchmark::State& state) {
  pmeta::Walker2d env(pmeta::MujocoModel::open("", pmeta::Walker2d::layout()));
  stepBeside(state, 25, "walker step", env, 4);
}
BENCHMARK(Walker2dStep)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace bench
