#include "pmeta_core/aggregate/norm_bound.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

constexpr std::size_t kFewest = 3;  // of two, none is the outlier

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

std::string fourDigits(double value) {
  if (value == 0 || !std::isfinite(value)) return formatNumber(value);
  const double scale = std::pow(10.0, 3 - std::floor(std::log10(value)));
  return formatNumber(std::isfinite(scale) ? std::round(value * scale) / scale : value);
}

}  // namespace

std::vector<std::string> NormBound::objections(const std::vector<double>& norms) const {
  std::vector<std::string> reasons(norms.size());
  if (!bounds()) return reasons;
  const bool judges_outliers = outlier_factor > 0 && norms.size() >= kFewest;
  const double middle = judges_outliers ? median(norms) : 0;
  for (std::size_t i = 0; i < norms.size(); ++i) {
    const std::string distance =
        "its distance to the meta-policy, " + fourDigits(norms[i]) + ", is ";
    if (!std::isfinite(norms[i])) {
      reasons[i] = distance + "beyond all bounds";
    } else if (max_norm > 0 && norms[i] > max_norm) {
      reasons[i] = distance + "above aggregation.max_update_norm, " + fourDigits(max_norm);
    } else if (judges_outliers && norms[i] > outlier_factor * middle) {
      reasons[i] = distance + "above aggregation.outlier_factor, " + fourDigits(outlier_factor) +
                   ", times this round's median, " + fourDigits(middle);
    }
  }
  return reasons;
}

}  // namespace pmeta
