#include "pmeta_core/act/table_policies.h"

#include <algorithm>
#include <cmath>

namespace pmeta {
namespace {

class GreedyTable : public Actor {
 public:
  GreedyTable(const TabularEnv& env, const Model& table)
      : env_(env),
        table_(table),
        observation_(static_cast<std::size_t>(env.spec().observation_size)) {}

  void look(const float* observations, const std::vector<std::size_t>&) override {
    observations_ = observations;
  }

  bool act(std::size_t row, Rng&, double* action) override {
    const float* seen = observations_ + row * observation_.size();
    for (std::size_t k = 0; k < observation_.size(); ++k) {
      observation_[k] = seen[k];
      // what is far from any state, or not a number, must not reach stateOf()'s whole numbers
      if (!(std::abs(observation_[k]) < env_.numStates())) return false;
    }
    const int state = env_.stateOf(observation_.data());
    if (state < 0 || state >= env_.numStates()) return false;
    const int n = env_.numActions();
    const auto first = static_cast<std::size_t>(state) * static_cast<std::size_t>(n);
    if (!table_.isPresent(first)) return false;
    *action = greedyAction(&table_.doubles()[first], n);
    return true;
  }

 private:
  const TabularEnv& env_;
  const Model& table_;
  const float* observations_ = nullptr;
  std::vector<double> observation_;
};

}  // namespace

TablePolicies::TablePolicies(const TabularEnv& env, double initial_value)
    : PolicyFamily(
          ModelLayout(Precision::kFloat64, {{"q_table",
                                             {static_cast<std::size_t>(env.numStates()),
                                              static_cast<std::size_t>(env.numActions())}}})),
      env_(env),
      initial_value_(initial_value) {}

void TablePolicies::initialise(Model& parameters, Rng&) const {
  std::fill(parameters.doubles().begin(), parameters.doubles().end(), initial_value_);
}

std::unique_ptr<Actor> TablePolicies::actor(const Model& parameters, std::vector<float>,
                                            std::size_t) const {
  return std::make_unique<GreedyTable>(env_, parameters);
}

}  // namespace pmeta
