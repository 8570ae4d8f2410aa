#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "pmeta_core/adapt/adapted_return.h"
#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/env/sparse_point.h"

namespace pmeta::test {

/// A point robot that is judged by its dense reward.
class DensePoint : public Env {
 public:
  explicit DensePoint(const SparsePointTask& task) : env_(task) {}
  const EnvSpec& spec() const override { return env_.spec(); }
  void reset(Rng& rng, double* observation) override { env_.reset(rng, observation); }
  Step step(const double* action, Rng& rng, double* observation) override {
    Step step = env_.step(action, rng, observation);
    step.sparse_reward.reset();
    return step;
  }
  std::vector<double> state() const override { return env_.state(); }
  void setState(const std::vector<double>& state) override { env_.setState(state); }

 private:
  SparsePoint env_;
};

/// Two tasks that only their rewards tell apart: a point is to go right, or left. Without an idea
/// of the task no policy has more than -20 in the mean of both, since the distances to both goals
/// sum to at least 2 at each of 20 steps; -4.5 is the best with one.
class OppositeGoals : public EnvFamily {
 public:
  void bind(Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int task) const override { return task == 0 ? "right" : "left"; }
  std::string taskDescription(int task) const override { return taskName(task); }
  std::unique_ptr<Env> create(int task) const override {
    return std::make_unique<DensePoint>(SparsePointTask{task == 0 ? 1.0 : -1.0, 0});
  }
};

/// Returns of a meta-learner's policy on both tasks, by number of exploration episodes.
struct GoalReturns {
  std::vector<int> episodes;
  std::vector<std::pair<double, double>> returns;  // right, left

  double mean(std::size_t k) const { return (returns[k].first + returns[k].second) / 2; }
  double worse(std::size_t k) const { return std::min(returns[k].first, returns[k].second); }
};

/// `counts`: after how many exploration episodes, beside none.
inline GoalReturns evaluateOnGoals(const MetaLearner& learner, const std::vector<int>& counts) {
  const OppositeGoals family;
  GoalReturns result;
  for (const int task : {0, 1}) {
    Evaluation evaluation(makeEnvs([&](int) { return family.make(task); }, 1));
    Rng rng(7, static_cast<std::uint64_t>(task), Stream::kEvaluate);
    const std::unique_ptr<Adaptation> adaptation = learner.adapt(learner.model(), task);
    const auto all = evaluateAdapted(evaluation, *adaptation, counts, rng);
    result.returns.resize(all.size());
    for (std::size_t k = 0; k < all.size(); ++k) {
      (task == 0 ? result.returns[k].first : result.returns[k].second) = all[k].stats.mean;
      if (task == 0) result.episodes.push_back(all[k].context_episodes);
    }
  }
  return result;
}

/// The tasks, for a learner.
inline MetaTasks oppositeGoals(std::int64_t total_steps = 0, int threads = 1) {
  return {std::make_shared<OppositeGoals>(), total_steps, threads};
}

/// The parameters that a run of this seed begins with.
inline Model initialModel(const MetaLearner& learner, std::uint64_t seed) {
  Model model(learner.policies().layout());
  Rng rng(seed, 0, Stream::kInitialise);
  learner.policies().initialise(model, rng);
  return model;
}

}  // namespace pmeta::test
