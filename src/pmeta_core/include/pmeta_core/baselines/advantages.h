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

/// Of the `steps` steps of one path (Schulman et al., "Generalized Advantage Estimation", 2016):
///
///     A_t = delta_t + gamma lambda A_{t+1},  delta_t = r_t + gamma V_{t+1} - V_t
///
/// `last_value`: V past the last step; 0 if the path ends with it. T: float or double.
template <class T>
void generalisedAdvantages(const T* rewards, const T* values, std::size_t steps, double last_value,
                           double gamma, double lambda, T* advantages);

/// How advantages are estimated.
struct AdvantageSettings {
  double gamma = 0.99;  ///< discount
  double lambda = 1;    ///< of the exponentially weighted sum; 1: return minus baseline
  /// Past the last step of an episode that reached its horizon the baseline goes on; else nothing
  /// is worth anything there, as befits one that knows the time.
  bool bootstrap = false;
};

/// Generalised ones with the baseline as the value; paths one after the other.
std::vector<double> advantages(const std::vector<Path>& paths, const LinearBaseline& baseline,
                               const AdvantageSettings& settings);

/// To mean 0 and standard deviation 1 (population), + 1e-8 in the denominator.
void normalise(std::vector<double>& values);

}  // namespace pmeta
