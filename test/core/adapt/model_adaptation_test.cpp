#include "pmeta_core/adapt/model_adaptation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "../support.h"
#include "pmeta_core/act/evaluation.h"

namespace pmeta {
namespace {

// the reward is the task's number, whatever is done
class Numbered : public Env {
 public:
  explicit Numbered(int task) : task_(task) {
    spec_.name = "numbered";
    spec_.observation_size = 1;
    spec_.action_size = 1;
    spec_.horizon = 5;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    t_ = 0;
    observation[0] = rng.uniform();
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    if (log != nullptr) log->push_back(action[0]);
    observation[0] = rng.uniform();
    return {static_cast<double>(task_), false, ++t_ == spec_.horizon};
  }
  std::vector<double>* log = nullptr;  // of all actions

 private:
  EnvSpec spec_;
  int task_;
  int t_ = 0;
};

constexpr int kTasks = 4;

SacSettings linear() {
  SacSettings settings;
  settings.hidden = {};
  settings.task_encoding = "model";
  settings.task_model.hidden = {};
  settings.task_model.kappa = 1;
  return settings;
}

// The actor's mean is (task + 1) / 10, the model knows that the reward is the task's number.
struct Known {
  explicit Known(const SacSettings& with = linear())
      : settings(with),
        networks(Numbered(0).spec(), settings, kTasks),
        parameters(networks.size()) {
    for (int j = 0; j < kTasks; ++j) {
      // [mean, log std] of inputs s, z
      parameters[static_cast<std::size_t>(1 + j)] = 0.1f * static_cast<float>(j + 1);
      // inputs s, a, change, z
      parameters[networks.taskModelOffset() + 3 + static_cast<std::size_t>(j)] =
          static_cast<float>(j);
    }
    parameters.back() = -10;  // and that it is sure of it
  }
  ModelAdaptation adaptation() const {
    return ModelAdaptation(networks, settings, parameters.data());
  }
  SacSettings settings;
  SacNetworks networks;
  AlignedFloats parameters;
};

double actionOn(int task) {
  return std::tanh(static_cast<double>(0.1f * static_cast<float>(task + 1)));
}

std::vector<double> explore(ModelAdaptation& adaptation, int task, Rng& rng) {
  std::vector<double> actions;
  auto env = std::make_unique<Numbered>(task);
  env->log = &actions;
  std::vector<std::unique_ptr<Env>> envs;
  envs.push_back(std::move(env));
  Evaluation exploration(std::move(envs));
  adaptation.beginEpisode(rng);
  EXPECT_TRUE(exploration.explore(adaptation, rng));
  adaptation.episodeOver();
  return actions;
}

TEST(ModelAdaptation, FindsTheTaskAndLeavesAWrongGuessWithinTheEpisode) {
  const Known known;
  for (int task = 0; task < kTasks; ++task) {
    int wrong = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      ModelAdaptation adaptation = known.adaptation();
      Rng rng(seed, 0, Stream::kEvaluate);
      const std::vector<double> actions = explore(adaptation, task, rng);
      wrong += std::abs(actions[0] - actionOn(task)) > 1e-6 ? 1 : 0;
      // the first reward tells it
      for (std::size_t t = 1; t < actions.size(); ++t) {
        EXPECT_NEAR(actions[t], actionOn(task), 1e-6) << "seed " << seed << " step " << t;
      }
      EXPECT_EQ(adaptation.guessed(), static_cast<std::size_t>(task));
      EXPECT_EQ(adaptation.taskInput(), oneHot(task, kTasks));
    }
    EXPECT_GT(wrong, 5) << "the first guess is drawn from all";
    EXPECT_LT(wrong, 20);
  }
}

TEST(ModelAdaptation, ActsAsIfToldOnceItKnows) {
  const Known known;
  ModelAdaptation adaptation = known.adaptation();
  EXPECT_EQ(adaptation.taskInput(), std::vector<float>(kTasks, 0.25f));
  Rng rng(3, 0, Stream::kEvaluate);
  explore(adaptation, 2, rng);
  std::vector<std::unique_ptr<Env>> envs;
  for (int i = 0; i < 3; ++i) envs.push_back(std::make_unique<Numbered>(2));
  std::vector<double> actions;
  dynamic_cast<Numbered&>(*envs[1]).log = &actions;
  Evaluation evaluation(std::move(envs));
  const std::unique_ptr<Actor> actor = adaptation.adapted(3);
  evaluation.run(*actor, rng);
  ASSERT_EQ(actions.size(), 5u);
  for (const double action : actions) EXPECT_NEAR(action, actionOn(2), 1e-6);
}

TEST(ModelAdaptation, KeepsAGuessThatIsAsGoodAsAnyOther) {
  Known known;
  for (int j = 0; j < kTasks; ++j) {
    known.parameters[known.networks.taskModelOffset() + 3 + static_cast<std::size_t>(j)] = 1;
  }
  ModelAdaptation adaptation = known.adaptation();
  Rng rng(5, 0, Stream::kEvaluate);
  for (int episode = 0; episode < 10; ++episode) {
    const std::vector<double> actions = explore(adaptation, 1, rng);
    for (const double action : actions) EXPECT_EQ(action, actions[0]);
  }
}

TEST(ModelAdaptation, NoiseIsOfThePolicy) {
  SacSettings settings = linear();
  settings.context.exploration_noise = true;
  const Known known(settings);
  ModelAdaptation adaptation = known.adaptation();
  Rng rng(5, 0, Stream::kEvaluate);
  const std::vector<double> actions = explore(adaptation, 1, rng);
  EXPECT_NE(actions[1], actions[2]);
}

TEST(ModelAdaptation, NeedsAModel) {
  SacSettings settings = linear();
  settings.task_encoding = "one_hot";
  const SacNetworks networks(Numbered(0).spec(), settings, kTasks);
  const AlignedFloats parameters(networks.size());
  EXPECT_EQ(test::errorOf([&] { ModelAdaptation(networks, settings, parameters.data()); }),
            "finding out the task by a model needs one: set task_encoding to model.");
}

}  // namespace
}  // namespace pmeta
