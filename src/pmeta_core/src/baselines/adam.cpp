#include "pmeta_core/baselines/adam.h"

#include <cmath>

namespace pmeta {

void Adam::step(double* parameters, const double* gradient) {
  constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEps = 1e-8;
  ++steps_;
  const double correction1 = 1 - std::pow(kBeta1, static_cast<double>(steps_));
  const double correction2 = 1 - std::pow(kBeta2, static_cast<double>(steps_));
  for (std::size_t k = 0; k < first_.size(); ++k) {
    const double g = gradient[k];
    first_[k] = kBeta1 * first_[k] + (1 - kBeta1) * g;
    second_[k] = kBeta2 * second_[k] + (1 - kBeta2) * g * g;
    parameters[k] -=
        learning_rate_ * (first_[k] / correction1) / (std::sqrt(second_[k] / correction2) + kEps);
  }
}

void Adam::saveState(StateWriter& writer) const {
  writer.count("steps", steps_);
  writer.array("first_moment", first_);
  writer.array("second_moment", second_);
}

void Adam::loadState(StateReader& reader) {
  steps_ = reader.count("steps");
  reader.array("first_moment", first_);
  reader.array("second_moment", second_);
}

}  // namespace pmeta
