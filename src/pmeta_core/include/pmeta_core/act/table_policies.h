#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/greedy_action.h"
#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/env/tabular_env.h"

namespace pmeta {

/// Action values, row-major: entry (state, action) at state * num_actions + action.
using QTable = std::vector<double>;

/// Greedy policies of tables of action values (float64, one block "q_table").
class TablePolicies : public PolicyFamily {
 public:
  /// `env`, which says where states are in the table, must outlive the family.
  TablePolicies(const TabularEnv& env, double initial_value);

  /// A table: no layers, no squashing.
  PolicyForm form() const override { return {"none", "none", ""}; }
  std::size_t taskInputSize() const override { return 0; }
  void initialise(Model& parameters, Rng& rng) const override;
  /// Knows no action in a state whose values are not present, or that is none.
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  const TabularEnv& env_;
  double initial_value_;
};

}  // namespace pmeta
