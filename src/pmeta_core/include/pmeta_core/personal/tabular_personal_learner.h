#pragma once

#include <memory>
#include <string>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/learn/q_learner.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/personal/proximal_sgd.h"

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

/// pMeta-RL on a Q-table: personalised step on sampled entries, auxiliary step on the whole table.
class TabularPersonalLearner : public PersonalLearner {
 public:
  TabularPersonalLearner(std::unique_ptr<TabularEnv> env, const QLearningSettings& q_learning,
                         const PersonalSettings& personal);

  const ModelLayout& layout() const override { return layout_; }
  Model initialModel(std::uint64_t seed) const override;
  void beginRound(const Model& meta, bool keep_personal) override;
  UpdateStats update(Rng& rng) override;
  const Model& personal() const override { return personal_; }
  const Model& auxiliary() const override { return auxiliary_; }
  ReturnStats evaluate(const Model& policy, Rng& rng) const override;
  Episode record(const Model& policy, Rng& rng) const override;
  void saveState(StateWriter& writer) const override;
  void loadState(StateReader& reader) override;

 private:
  std::unique_ptr<TabularEnv> env_;
  QLearningSettings q_learning_;
  QLearner learner_;
  ModelLayout layout_;
  Model personal_;
  Model auxiliary_;
  bool has_personal_ = false;
  ProximalSgd<double> optimizer_;
};

}  // namespace pmeta
