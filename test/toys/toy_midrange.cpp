// An aggregation rule in a file of its own: halfway between the smallest and the largest value.
#include <algorithm>

#include "pmeta_core/aggregate/aggregation_rule.h"

namespace {

using namespace pmeta;

class Midrange : public AggregationRule {
 public:
  void mix(Model& meta, const std::vector<Contribution>& contributions,
           double beta) const override {
    auto& values = std::get<std::vector<float>>(meta.values);
    for (std::size_t k = 0; k < values.size(); ++k) {
      const auto valueOf = [k](const Contribution& part) {
        return std::get<std::vector<float>>(part.model->values)[k];
      };
      float low = valueOf(contributions.front());
      float high = low;
      for (const Contribution& part : contributions) {
        low = std::min(low, valueOf(part));
        high = std::max(high, valueOf(part));
      }
      values[k] = static_cast<float>((1 - beta) * values[k] + beta * (low + high) / 2);
    }
  }
};

const RegisteredRule<Midrange> kMidrange("toy_midrange");

}  // namespace
