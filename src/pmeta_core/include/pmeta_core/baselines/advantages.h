#pragma once

#include <cstddef>
#include <vector>

namespace pmeta {

/// One episode as an on-policy learner sees it.
struct Path {
  std::vector<double> observations;      ///< [steps, observation_size]
  std::vector<double> rewards;           ///< [steps]
  std::vector<double> last_observation;  ///< after the last step
  bool terminated = false;               ///< in a terminal state; else the horizon was reached
  /// Its length.
  std::size_t steps() const { return rewards.size(); }
};

/// y_t = sum over j of gamma^j r_{t+j}.
std::vector<double> discountedReturns(const std::vector<double>& rewards, double gamma);

/// The value of a state as a linear function of features of observation and time,
///
///     f = [clip(o, +-10), its square, t/100, (t/100)^2, (t/100)^3, 1],
///
/// fitted to returns by ridge regression (Duan et al., "Benchmarking Deep Reinforcement Learning
/// for Continuous Control", 2016). Time is a feature: it is the value until the horizon.
class LinearBaseline {
 public:
  /// Least squares over all steps of `paths`, with `ridge` on the diagonal of the normal equations;
  /// ten times that for as long as they have no finite solution.
  void fit(const std::vector<Path>& paths, double gamma, double ridge = 1e-5);

  /// Of an observation at step `t`.
  double value(const double* observation, std::size_t observation_size, std::size_t t) const;

  /// c of f . c, [features]; none before fit().
  const std::vector<double>& coefficients() const { return coefficients_; }

 private:
  std::vector<double> coefficients_;
};

/// How advantages are estimated (Schulman et al., "Generalized Advantage Estimation", 2016).
struct AdvantageSettings {
  double gamma = 0.99;  ///< discount
  double lambda = 1;    ///< of the exponentially weighted sum; 1: return minus baseline
  /// Past the last step of an episode that reached its horizon the baseline goes on; else nothing
  /// is worth anything there, as befits one that knows the time.
  bool bootstrap = false;
};

/// delta_t = r_t + gamma b_{t+1} - b_t, and the sum of (gamma lambda)^j delta_{t+j} for each step
/// of each path; paths one after the other.
std::vector<double> advantages(const std::vector<Path>& paths, const LinearBaseline& baseline,
                               const AdvantageSettings& settings);

/// To mean 0 and standard deviation 1 (population), + 1e-8 in the denominator.
void normalise(std::vector<double>& values);

}  // namespace pmeta
