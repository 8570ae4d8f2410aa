#include "pmeta_core/baselines/advantages.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr int kMostRidges = 10;  // each ten times the one before

Eigen::VectorXd features(const double* observation, std::size_t size, std::size_t t) {
  Eigen::VectorXd f(2 * static_cast<Eigen::Index>(size) + 4);
  Eigen::Index k = 0;
  for (std::size_t i = 0; i < size; ++i) f[k++] = std::clamp(observation[i], -10.0, 10.0);
  for (std::size_t i = 0; i < size; ++i, ++k)
    f[k] = f[k - static_cast<Eigen::Index>(size)] * f[k - static_cast<Eigen::Index>(size)];
  const double time = static_cast<double>(t) / 100;
  f[k++] = time;
  f[k++] = time * time;
  f[k++] = time * time * time;
  f[k] = 1;
  return f;
}

}  // namespace

std::vector<double> discountedReturns(const std::vector<double>& rewards, double gamma) {
  std::vector<double> returns(rewards.size());
  double sum = 0;
  for (std::size_t t = rewards.size(); t-- > 0;) returns[t] = sum = rewards[t] + gamma * sum;
  return returns;
}

void LinearBaseline::fit(const std::vector<Path>& paths, double gamma, double ridge) {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  for (const Path& path : paths) {
    const std::vector<double> returns = discountedReturns(path.rewards, gamma);
    const std::size_t size = path.observations.size() / std::max<std::size_t>(path.steps(), 1);
    for (std::size_t t = 0; t < path.steps(); ++t) {
      const Eigen::VectorXd f = features(&path.observations[t * size], size, t);
      if (right.size() == 0) {
        normal.setZero(f.size(), f.size());
        right.setZero(f.size());
      }
      normal.selfadjointView<Eigen::Lower>().rankUpdate(f);
      right += returns[t] * f;
    }
  }
  if (right.size() == 0) throw Error("a baseline cannot be fitted to no step at all.");
  for (int k = 0; k < kMostRidges; ++k, ridge *= 10) {
    Eigen::MatrixXd ridged = normal;
    ridged.diagonal().array() += ridge;
    const Eigen::VectorXd solution = ridged.selfadjointView<Eigen::Lower>().ldlt().solve(right);
    if (!solution.allFinite()) continue;
    coefficients_.assign(solution.data(), solution.data() + solution.size());
    return;
  }
  throw Error("the baseline has no finite solution: returns or observations are too large.");
}

double LinearBaseline::value(const double* observation, std::size_t observation_size,
                             std::size_t t) const {
  return features(observation, observation_size, t)
      .dot(Eigen::Map<const Eigen::VectorXd>(coefficients_.data(),
                                             static_cast<Eigen::Index>(coefficients_.size())));
}

template <class T>
void generalisedAdvantages(const T* rewards, const T* values, std::size_t steps, double last_value,
                           double gamma, double lambda, T* advantages) {
  double next = last_value, sum = 0;
  for (std::size_t t = steps; t-- > 0;) {
    const double delta = rewards[t] + gamma * next - values[t];
    sum = delta + gamma * lambda * sum;
    advantages[t] = static_cast<T>(sum);
    next = values[t];
  }
}

template void generalisedAdvantages(const float*, const float*, std::size_t, double, double, double,
                                    float*);
template void generalisedAdvantages(const double*, const double*, std::size_t, double, double,
                                    double, double*);

std::vector<double> advantages(const std::vector<Path>& paths, const LinearBaseline& baseline,
                               const AdvantageSettings& settings) {
  std::vector<double> all;
  for (const Path& path : paths) {
    const std::size_t size = path.last_observation.size();
    const bool goes_on = settings.bootstrap && !path.terminated;
    const double last =
        goes_on ? baseline.value(path.last_observation.data(), size, path.steps()) : 0;
    std::vector<double> values(path.steps());
    for (std::size_t t = 0; t < path.steps(); ++t) {
      values[t] = baseline.value(&path.observations[t * size], size, t);
    }
    all.resize(all.size() + path.steps());
    generalisedAdvantages(path.rewards.data(), values.data(), path.steps(), last, settings.gamma,
                          settings.lambda, all.data() + all.size() - path.steps());
  }
  return all;
}

void normalise(std::vector<double>& values) {
  const auto n = static_cast<double>(values.size());
  double mean = 0;
  for (const double value : values) mean += value / n;
  double variance = 0;
  for (const double value : values) variance += (value - mean) * (value - mean) / n;
  for (double& value : values) value = (value - mean) / (std::sqrt(variance) + 1e-8);
}

}  // namespace pmeta
