#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/base/registry.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {

/// What becomes of each entry of the meta-policy when a round's contributions are mixed into it.
class AggregationRule {
 public:
  virtual ~AggregationRule() = default;

  /// Binds settings of its own below "aggregation."; those of every rule may stand in a file.
  virtual void bind(Settings& settings) { static_cast<void>(settings); }

  /// Do contributions count by their weights? If not, their weights must be equal.
  virtual bool weighted() const { return false; }

  /// meta <- (1 - beta) * meta + beta * what the rule makes of the contributions, which have the
  /// meta model's layout and come in the order of their tasks; there is at least one. An entry that
  /// none has present keeps its value. Throws Error.
  virtual void mix(Model& meta, const std::vector<Contribution>& contributions,
                   double beta) const = 0;
};

/// Makes a rule with its default settings.
using AggregationRuleMaker = std::function<std::shared_ptr<AggregationRule>()>;

/// Every rule, by the name that `aggregation.rule` gives.
Registry<AggregationRuleMaker>& aggregationRules();

/// In the source of a rule, outside of any function:
///
///     const RegisteredRule<Mean> kMean("mean");
template <class Rule>
struct RegisteredRule : Registered<AggregationRuleMaker> {
  /// `name`: for `aggregation.rule`; throws std::logic_error if it is taken.
  explicit RegisteredRule(const std::string& name)
      : Registered(aggregationRules(), name, [] { return std::make_shared<Rule>(); }) {}
};

}  // namespace pmeta
