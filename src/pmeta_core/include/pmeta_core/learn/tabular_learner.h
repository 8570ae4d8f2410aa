#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/learner.h"
#include "pmeta_core/learn/q_learner.h"

namespace pmeta {

/// Settings of tabular Q-learning.
struct QLearningSettings {
  double gamma = 0.9;            ///< discount
  int updates = 1;               ///< K: batches before each auxiliary update
  double samples_per_entry = 2;  ///< n_i of one batch as a multiple of the entries the task owns
  double initial_value = 0;      ///< Q at the start
};

/// Binds all of them below `prefix`, e.g. "q_learning.".
void bind(Settings& settings, const std::string& prefix, QLearningSettings& q_learning);

/// Q-learning on the table that tasks with a known model share: its task's entries are present.
class TabularLearner : public Learner {
 public:
  /// `env`: of the task, whose owned entries are learnt.
  TabularLearner(std::unique_ptr<TabularEnv> env, const QLearningSettings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  Model blank() const override;
  void beginRound(const Model&, bool) override {}
  /// K batches.
  UpdateStats learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) override;
  const std::vector<Loss>& losses() const override { return losses_; }
  std::vector<float> taskInput(const Model&) const override { return {}; }
  std::optional<ReturnStats> exactReturn(const Model& policy) const override {
    return evaluateGreedy(*env_, policy.doubles());
  }
  /// Values and actions of the states.
  void addValues(const Model& policy, const std::vector<float>& task_input,
                 Episode& episode) const override;
  /// What a later update depends on are the parameters alone.
  void saveState(StateWriter&) const override {}
  void loadState(StateReader&) override {}  ///< nothing to read

 private:
  std::unique_ptr<TabularEnv> env_;
  QLearningSettings settings_;
  TablePolicies policies_;
  QLearner rule_;
  std::vector<Loss> losses_ = {{"td", 0}};
};

}  // namespace pmeta
