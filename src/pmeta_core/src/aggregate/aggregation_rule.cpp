#include "pmeta_core/aggregate/aggregation_rule.h"

namespace pmeta {

Registry<AggregationRuleMaker>& aggregationRules() {
  static Registry<AggregationRuleMaker> rules("aggregation rule");
  return rules;
}

}  // namespace pmeta
