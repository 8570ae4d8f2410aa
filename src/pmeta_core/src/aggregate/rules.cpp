// The rules that come with the suite.
#include "pmeta_core/aggregate/aggregation_rule.h"
#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/aggregate/trimmed_mix.h"

namespace pmeta {
namespace {

/// The weighted mean.
class Mean : public AggregationRule {
 public:
  bool weighted() const override { return true; }
  void mix(Model& meta, const std::vector<Contribution>& contributions,
           double beta) const override {
    mixInto(meta, contributions, beta);
  }
};

class Median : public AggregationRule {
 public:
  void mix(Model& meta, const std::vector<Contribution>& contributions,
           double beta) const override {
    mixTrimmedInto(meta, contributions, beta, 0.5);
  }
};

/// The mean without the values at both ends.
class TrimmedMean : public AggregationRule {
 public:
  void bind(Settings& settings) override {
    settings.bind("aggregation.trim", trim_,
                  "rule trimmed_mean: share of the values that is cut at each end",
                  Range::halfOpen(0, 0.5));
  }
  void mix(Model& meta, const std::vector<Contribution>& contributions,
           double beta) const override {
    mixTrimmedInto(meta, contributions, beta, trim_);
  }

 private:
  double trim_ = 0.2;
};

const RegisteredRule<Mean> kMean("mean");
const RegisteredRule<Median> kMedian("median");
const RegisteredRule<TrimmedMean> kTrimmedMean("trimmed_mean");

}  // namespace
}  // namespace pmeta
