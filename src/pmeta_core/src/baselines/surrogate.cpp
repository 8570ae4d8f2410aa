#include "pmeta_core/baselines/surrogate.h"

#include <algorithm>
#include <cmath>

namespace pmeta {

double logProbability(const double* u, const double* mean, const std::vector<double>& log_std) {
  constexpr double kHalfLogTwoPi = 0.91893853320467274178;
  double sum = 0;
  for (std::size_t j = 0; j < log_std.size(); ++j) {
    const double e = (u[j] - mean[j]) * std::exp(-log_std[j]);
    sum -= 0.5 * e * e + log_std[j] + kHalfLogTwoPi;
  }
  return sum;
}

PolicyOnData::PolicyOnData(const GaussianMlp& policy, const ActionData& data)
    : policy_(policy), data_(data) {}

void PolicyOnData::at(const double* parameters) {
  parameters_ = parameters;
  log_std_ = policy_.logStd(parameters);
  policy_.forward(parameters, data_.observations.data(), data_.rows, pass_);
}

double PolicyOnData::logProb(std::size_t row) const {
  const std::size_t first = row * policy_.actions();
  return logProbability(&data_.actions[first], &pass_.mean()[first], log_std_);
}

double PolicyOnData::ratio(std::size_t row) const {
  return std::exp(logProb(row) - data_.old_log_prob[row]);
}

double PolicyOnData::loss(Surrogate kind, double clip) const {
  double sum = 0;
  for (std::size_t t = 0; t < data_.rows; ++t) {
    const double advantage = data_.advantages[t];
    if (kind == Surrogate::kLogLikelihood) {
      sum += logProb(t) * advantage;
      continue;
    }
    const double r = ratio(t);
    sum += kind == Surrogate::kRatio
               ? r * advantage
               : std::min(r * advantage, std::clamp(r, 1 - clip, 1 + clip) * advantage);
  }
  return -sum / static_cast<double>(data_.rows);
}

double PolicyOnData::weight(Surrogate kind, std::size_t row, double clip) const {
  const double w = -data_.advantages[row] / static_cast<double>(data_.rows);
  if (kind == Surrogate::kLogLikelihood) return w;
  const double r = ratio(row);
  if (kind == Surrogate::kClippedRatio) {
    const bool gains = data_.advantages[row] > 0;
    if ((gains && r > 1 + clip) || (!gains && r < 1 - clip)) return 0;  // the clipped one is less
  }
  return w * r;
}

void PolicyOnData::headsOf(std::size_t row, Heads& heads) const {
  const std::size_t n = policy_.actions();
  heads.mean.resize(n);
  heads.log_std.resize(n);
  for (std::size_t j = 0; j < n; ++j) {
    const double inverse_std = std::exp(-log_std_[j]);
    const double e = (data_.actions[row * n + j] - pass_.mean()[row * n + j]) * inverse_std;
    heads.mean[j] = e * inverse_std;
    heads.log_std[j] = e * e - 1;
  }
}

void PolicyOnData::gradient(Surrogate kind, double* gradient, double clip) const {
  const std::size_t n = policy_.actions();
  std::vector<double> d_mean(data_.rows * n);
  std::vector<double> d_log_std(n);
  Heads heads;
  for (std::size_t t = 0; t < data_.rows; ++t) {
    const double w = weight(kind, t, clip);
    headsOf(t, heads);
    for (std::size_t j = 0; j < n; ++j) {
      d_mean[t * n + j] = w * heads.mean[j];
      d_log_std[j] += w * heads.log_std[j];
    }
  }
  policy_.backward(parameters_, pass_, d_mean, d_log_std, gradient);
}

void PolicyOnData::hessianProduct(Surrogate kind, const double* direction, double* product) const {
  const std::size_t n = policy_.actions();
  GaussianMlp::Tangent tangent;
  policy_.forwardAlong(parameters_, direction, pass_, tangent);
  std::vector<double> r_log_std(direction + policy_.logStdOffset(), direction + policy_.size());
  for (std::size_t j = 0; j < n; ++j) {
    if (log_std_[j] != parameters_[policy_.logStdOffset() + j]) r_log_std[j] = 0;  // at its floor
  }
  std::vector<double> d_mean(data_.rows * n), r_d_mean(data_.rows * n), r_d_log_std(n);
  Heads heads;
  for (std::size_t t = 0; t < data_.rows; ++t) {
    const double w = weight(kind, t, 0);
    headsOf(t, heads);
    double along = 0;  // R{log pi}
    for (std::size_t j = 0; j < n; ++j) {
      along += heads.mean[j] * tangent.mean()[t * n + j] + heads.log_std[j] * r_log_std[j];
    }
    const double rho = kind == Surrogate::kRatio ? along : 0;  // R{r} = r R{log pi}
    for (std::size_t j = 0; j < n; ++j) {
      const double inverse_std = std::exp(-log_std_[j]);
      const double e = heads.mean[j] / inverse_std;
      const double r_mean = tangent.mean()[t * n + j] * inverse_std;
      d_mean[t * n + j] = w * heads.mean[j];
      r_d_mean[t * n + j] =
          w * (-(r_mean + 2 * e * r_log_std[j]) * inverse_std + rho * heads.mean[j]);
      r_d_log_std[j] += w * (-2 * e * (r_mean + e * r_log_std[j]) + rho * heads.log_std[j]);
    }
  }
  policy_.backwardAlong(parameters_, direction, pass_, tangent, d_mean, r_d_mean, r_d_log_std,
                        product);
}

double PolicyOnData::kl() const {
  const std::size_t n = policy_.actions();
  double sum = 0;
  for (std::size_t t = 0; t < data_.rows; ++t) {
    for (std::size_t j = 0; j < n; ++j) {
      const double gap = data_.old_mean[t * n + j] - pass_.mean()[t * n + j];
      const double log_ratio = log_std_[j] - data_.old_log_std[j];
      const double inverse_std = std::exp(-log_std_[j]);
      sum += log_ratio + 0.5 * (std::exp(-2 * log_ratio) + gap * gap * inverse_std * inverse_std) -
             0.5;
    }
  }
  return sum / static_cast<double>(data_.rows);
}

void PolicyOnData::klGradient(double* gradient) const {
  const std::size_t n = policy_.actions();
  std::vector<double> d_mean(data_.rows * n), d_log_std(n);
  const double w = 1 / static_cast<double>(data_.rows);
  for (std::size_t t = 0; t < data_.rows; ++t) {
    for (std::size_t j = 0; j < n; ++j) {
      const double gap = pass_.mean()[t * n + j] - data_.old_mean[t * n + j];
      const double precision = std::exp(-2 * log_std_[j]);
      d_mean[t * n + j] = w * gap * precision;
      d_log_std[j] +=
          w * (1 - std::exp(2 * (data_.old_log_std[j] - log_std_[j])) - gap * gap * precision);
    }
  }
  policy_.backward(parameters_, pass_, d_mean, d_log_std, gradient);
}

void PolicyOnData::klProduct(const double* direction, double* product) const {
  const std::size_t n = policy_.actions();
  GaussianMlp::Tangent tangent;
  policy_.forwardAlong(parameters_, direction, pass_, tangent);
  std::vector<double> d_mean(data_.rows * n), d_log_std(n);
  for (std::size_t j = 0; j < n; ++j) {
    const double scale = std::exp(-2 * log_std_[j]) / static_cast<double>(data_.rows);
    for (std::size_t t = 0; t < data_.rows; ++t) {
      d_mean[t * n + j] = scale * tangent.mean()[t * n + j];
    }
    d_log_std[j] = 2 * direction[policy_.logStdOffset() + j];
  }
  policy_.backward(parameters_, pass_, d_mean, d_log_std, product);
}

}  // namespace pmeta
