#pragma once

#include <optional>

#include "pmeta_core/storage/policy_file.h"

namespace pmeta {

/// Keeps the best of a run's meta-policies, or of one task's personal policies, below policies/best
/// of the run's folder from the moment that it is known: the one whose evaluation gave the highest
/// mean return, the earliest of equal ones. Of a run that is resumed, what is there already counts.
///
/// That return is the highest of many noisy ones, and therefore flatters the policy.
class BestPolicy {
 public:
  /// Writes it if its PolicyOrigin::mean_return, which there must be, beats all before it. Throws
  /// Error, and may then be asked again.
  void offer(const Experiment& experiment, const PolicyOrigin& origin, const Model& model);

 private:
  bool looked_ = false;  // for what is there already
  std::optional<double> best_;
};

}  // namespace pmeta
