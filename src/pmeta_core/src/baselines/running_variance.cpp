#include "pmeta_core/baselines/running_variance.h"

namespace pmeta {

void RunningVariance::add(double value) {
  ++count_;
  const double before = value - mean_;
  mean_ += before / static_cast<double>(count_);
  squares_ += before * (value - mean_);
}

double RunningVariance::variance() const {
  return count_ == 0 ? 1 : squares_ / static_cast<double>(count_);
}

void RunningVariance::saveState(StateWriter& writer) const {
  writer.count("count", count_);
  writer.value("mean", mean_);
  writer.value("squares", squares_);
}

void RunningVariance::loadState(StateReader& reader) {
  count_ = reader.count("count");
  mean_ = reader.finite("mean");
  squares_ = reader.finite("squares");
  if (squares_ < 0) reader.refuse("squares", "is negative");
}

}  // namespace pmeta
