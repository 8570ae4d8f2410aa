#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmeta_core/base/state.h"
#include "pmeta_core/learn/optimizer.h"
#include "pmeta_core/nn/aligned.h"

namespace pmeta {

/// Settings of ProximalAdam. Adam's are torch.optim.Adam's.
struct ProximalAdamSettings {
  double learning_rate = 1e-3;  ///< positive
  double beta1 = 0.9;           ///< in [0, 1)
  double beta2 = 0.999;         ///< in [0, 1)
  double eps = 1e-8;            ///< positive
  double alpha = 1e-3;          ///< step size of the pull, at least 0
  double lambda = 0;            ///< strength of the pull, at least 0; at 0 this is plain Adam
  double eta = 1e-3;            ///< step size of the auxiliary parameters, at least 0
  /// Adds lambda (phi - omega) to the gradient, so that Adam rescales the pull as well. With a
  /// slow auxiliary (eta 1e-3) networks hardly learn with it; it is there to be compared with.
  bool coupled = false;
};

/// Adam (Kingma and Ba, 2015) that also pulls the personal parameters phi towards the auxiliary
/// ones omega, and moves those after them, in one pass over memory:
///
///     phi   <- Adam(phi, gradient)
///     phi   <- phi - alpha * lambda * (phi - omega)      with the old omega: eq. (per_update0)
///     omega <- omega + eta * lambda * (phi - omega)      with the new phi: eq. (local_update0)
///
/// The pull has a step of its own, decoupled from Adam's, since Adam would take its size away.
/// Moments and the count of updates stay when a round resets phi and omega.
class ProximalAdam : public Optimizer<float> {
 public:
  /// `personal` and `auxiliary`: `size` floats each, which must outlive the optimiser. `auxiliary`
  /// may be null: plain Adam. Throws Error if a setting is out of its range.
  ProximalAdam(float* personal, float* auxiliary, std::size_t size,
               const ProximalAdamSettings& settings);

  /// Pulls parameters [offset, offset + n) by a strength of their own; at 0 they are on their own,
  /// and their auxiliary ones stay. An apply() must lie in one such range or touch none. Throws
  /// Error on a negative strength, or a range that overlaps another or the end.
  void setLambda(std::size_t offset, std::size_t n, double lambda);

  /// Counts one update. Call it once before the apply() calls that make up an update, in which each
  /// parameter has its turn once: Adam's bias correction goes by this count. apply() throws Error
  /// if no update has begun.
  void beginUpdate();

  /// As given to the constructor.
  const ProximalAdamSettings& settings() const { return settings_; }
  std::size_t size() const { return first_moment_.size(); }  ///< parameters

  const AlignedFloats& firstMoment() const { return first_moment_; }  ///< Adam's m, one a parameter
  /// Adam's v, one a parameter.
  const AlignedFloats& secondMoment() const { return second_moment_; }

  /// As if no update had been made.
  void reset();

  /// Adam's moments and count.
  void saveState(StateWriter& writer) const;
  void loadState(StateReader& reader);  ///< refuses moments of another number of parameters

 private:
  // in one update each parameter has its turn once
  void move(std::size_t offset, const float* gradient, std::size_t n, float* target,
            double tau) override;

  struct Range {
    std::size_t begin, end;
    double lambda;
  };

  double lambdaAt(std::size_t offset, std::size_t n) const;

  float* personal_;
  float* auxiliary_;
  ProximalAdamSettings settings_;
  std::vector<Range> ranges_;  // with a strength of their own
  std::int64_t updates_ = 0;
  AlignedFloats first_moment_, second_moment_;
};

}  // namespace pmeta
