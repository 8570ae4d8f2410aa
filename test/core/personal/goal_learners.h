#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/adapt/latent_adaptation.h"
#include "pmeta_core/adapt/model_adaptation.h"
#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta::test {

/// A point on a line with a goal of its own.
class Goal : public Env {
 public:
  explicit Goal(double goal) : goal_(goal) {
    spec_.name = "goal";
    spec_.observation_size = 2;
    spec_.action_size = 1;
    spec_.horizon = 10;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    x_ = 2 * rng.uniform() - 1;
    t_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng&, double* observation) override {
    x_ += 0.3 * action[0];
    ++t_;
    observe(observation);
    return {-std::abs(x_ - goal_), false, t_ == spec_.horizon};
  }

 private:
  void observe(double* observation) const {
    observation[0] = x_;
    observation[1] = 0.1 * t_;
  }
  EnvSpec spec_;
  double goal_;
  double x_ = 0;
  int t_ = 0;
};

constexpr int kTasks = 3;

inline SacSettings smallSac(const std::string& task_encoding = "one_hot") {
  SacSettings settings;
  settings.hidden = {8, 6};
  settings.batch_size = 16;
  settings.buffer_size = 200;
  settings.warm_up_steps = 30;
  settings.task_encoding = task_encoding;
  settings.context.hidden = {7, 5};
  settings.context.latent_size = 2;
  settings.context.batch_size = 10;
  settings.context.buffer_size = 50;
  settings.task_model.hidden = {7, 5};
  settings.task_model.buffer_size = 150;
  settings.task_model.exploring_interval = 2;
  settings.evaluation_episodes = 4;
  return settings;
}

inline PersonalSettings pulled() {
  PersonalSettings settings;
  settings.learning_rate = settings.alpha = 1e-3;
  settings.lambda = 15;
  settings.eta = 1e-2;
  return settings;
}

inline ProximalAdamSettings adamOf(const PersonalSettings& personal) {
  ProximalAdamSettings settings;
  settings.learning_rate = personal.learning_rate;
  settings.alpha = personal.alpha;
  settings.lambda = personal.lambda;
  settings.eta = personal.eta;
  return settings;
}

inline PersonalLearner makeLearner(const SacSettings& settings = smallSac(), int task = 1,
                                   const PersonalSettings& personal = pulled()) {
  const auto make_env = [task](int) { return std::make_unique<Goal>(task - 1); };
  auto learner = std::make_unique<SacLearner>(
      make_env(0), settings, settings.isTold() ? oneHot(task, kTasks) : std::vector<float>());
  PersonalParts parts;
  if (learner->networks().hasEncoder()) {
    parts.exploration_episodes = settings.context.exploration_episodes;
    parts.adapt = [&networks = learner->networks(), context = settings.context](const Model& m) {
      return std::make_unique<LatentAdaptation>(networks, context, m.floats().data());
    };
  }
  if (learner->networks().hasTaskModel()) {
    parts.exploration_episodes = settings.context.exploration_episodes;
    parts.adapt = [&networks = learner->networks(), settings](const Model& m) {
      return std::make_unique<ModelAdaptation>(networks, settings, m.floats().data());
    };
  }
  parts.learner = std::move(learner);
  parts.evaluation_envs = makeEnvs(make_env, settings.evaluation_episodes);
  parts.reset_moments = settings.reset_moments;
  return PersonalLearner(std::move(parts), personal);
}

inline const SacLearner& sac(const PersonalLearner& learner) {
  return dynamic_cast<const SacLearner&>(learner.learner());
}

inline void run(PersonalLearner& learner, int updates, Rng& rng) {
  for (int r = 0; r < updates; ++r) learner.update(rng);
}

/// A learner of each goal.
inline std::vector<std::unique_ptr<PersonalLearner>> makeLearners(
    const SacSettings& settings, const PersonalSettings& personal) {
  std::vector<std::unique_ptr<PersonalLearner>> learners;
  for (int task = 0; task < kTasks; ++task) {
    learners.push_back(std::make_unique<PersonalLearner>(makeLearner(settings, task, personal)));
  }
  return learners;
}

/// A round of all of them, and the aggregation after it.
inline void trainRound(const std::vector<std::unique_ptr<PersonalLearner>>& learners, Model& meta,
                       int updates, std::uint64_t seed, std::uint64_t round) {
  std::vector<Contribution> contributions;
  for (std::size_t task = 0; task < learners.size(); ++task) {
    learners[task]->beginRound(meta, false);
    Rng rng(seed, task, Stream::kSample, round);
    run(*learners[task], updates, rng);
    contributions.push_back({&learners[task]->auxiliary(), 1.0});
  }
  mixInto(meta, contributions, 1);
}

}  // namespace pmeta::test
