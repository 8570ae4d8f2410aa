#pragma once

#include <cstdint>
#include <string>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/base/state.h"

namespace pmeta {

/// Settings of the entropy temperature.
struct TemperatureSettings {
  std::string temperature = "auto";         ///< "auto": follows a target entropy; "fixed": stays
  double initial_temperature = 0.2;         ///< positive
  double target_entropy = 0;                ///< in nats; 0: minus the number of action components
  double temperature_learning_rate = 1e-3;  ///< Adam's
};

/// Binds all of them below `prefix`, e.g. "sac.".
void bind(Settings& settings, const std::string& prefix, TemperatureSettings& temperature);

/// The weight alpha of the entropy in soft actor-critic: fixed, or Adam on log alpha with the loss
///
///     -log alpha * (mean of log pi + target entropy)
///
/// so that it grows while the policy's entropy is below its target (Haarnoja et al., "Soft
/// Actor-Critic Algorithms and Applications", 2018, eq. 18, by log alpha).
class Temperature {
 public:
  /// `action_size`: components of an action, for the default target entropy.
  Temperature(const TemperatureSettings& settings, int action_size);

  double value() const;                                     ///< alpha
  double targetEntropy() const { return target_entropy_; }  ///< in nats

  /// Derivative of the loss by log alpha.
  double gradient(double mean_log_prob) const { return -(mean_log_prob + target_entropy_); }

  /// One step of Adam, given the mean of log pi over a batch; nothing where alpha is fixed.
  void update(double mean_log_prob);

  /// Log alpha, Adam's moments and the count of updates.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);  ///< refuses what is not finite

 private:
  bool automatic_;
  double target_entropy_;
  double learning_rate_;
  double log_value_;
  double first_moment_ = 0;
  double second_moment_ = 0;
  std::int64_t updates_ = 0;
};

}  // namespace pmeta
