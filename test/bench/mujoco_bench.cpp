// Steps of the MuJoCo environments beside a bare loop of mj_step on the same model.
#include <mujoco/mujoco.h>

#include <memory>
#include <vector>

#include "bench_util.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"

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

// both take the same steps, batch by batch in turns
void stepBeside(benchmark::State& state, int row, const char* name, pmeta::MujocoEnv& env,
                int frame_skip) {
  const std::size_t action_size = env.spec().action_size;
  pmeta::Rng rng(0, 0, pmeta::Stream::kMeasure);
  std::vector<double> actions(action_size * kSteps);
  std::vector<double> observation(env.spec().observation_size);
  BareLoop bare(env, frame_skip);
  std::vector<double> env_times, bare_times;
  const auto timeEnv = [&] {
    const double* action = actions.data();
    env_times.push_back(meanSeconds(kSteps, [&] {
      benchmark::DoNotOptimize(env.step(action, rng, observation.data()));
      action += action_size;
    }));
  };
  const auto timeBare = [&] {
    const double* action = actions.data();
    bare_times.push_back(meanSeconds(kSteps, [&] {
      bare.step(action);
      action += action_size;
    }));
  };
  for (auto _ : state) {
    env.reset(rng, observation.data());
    for (int batch = 0; batch < kBatchesInEpisode; ++batch) {
      for (double& action : actions) action = 2 * rng.uniform() - 1;
      bare.start(env.state());
      // who comes second finds the caches warm
      if (batch % 2 == 0) timeEnv();
      timeBare();
      if (batch % 2 == 1) timeEnv();
    }
  }
  state.SetItemsProcessed(state.iterations() * kBatchesInEpisode * kSteps);
  report({Part::kLoops, row}, name, Unit::kSeconds, undisturbed(env_times), undisturbed(bare_times),
         "a bare loop of mj_step");
}

void HalfCheetahStep(benchmark::State& state) {
  pmeta::HalfCheetah env({}, pmeta::MujocoModel::open("", pmeta::HalfCheetah::layout()));
  stepBeside(state, 23, "half-cheetah step", env, 5);
}
BENCHMARK(HalfCheetahStep)->Unit(benchmark::kMicrosecond);

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
