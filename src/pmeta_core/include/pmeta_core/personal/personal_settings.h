#pragma once

#include <optional>
#include <string>

namespace pmeta {

/// Strengths of the pull that one kind of network has of its own; those without have that of all.
/// At 0 they are each robot's own: a round does not reset them, and what is sent of them stays the
/// meta-policy's.
struct NetworkLambdas {
  std::optional<double> actor;    ///< of the policy's network
  std::optional<double> critic;   ///< of all critics
  std::optional<double> encoder;  ///< of the inference network, or the task model

  /// That of the network whose blocks are named "<network>.<...>".
  std::optional<double> of(const std::string& network) const {
    if (network.rfind("critic", 0) == 0) return critic;
    if (network == "actor") return actor;
    return network == "encoder" || network == "task_model" ? encoder : std::nullopt;
  }
};

/// Step sizes of the personalised and auxiliary updates (paper, eqs. per_update0 and
/// local_update0).
struct PersonalSettings {
  double alpha = 0.08;  ///< personalised learning rate; for networks, that of the pull alone
  double lambda = 10;   ///< strength of the pull towards the auxiliary parameters
  double eta = 0.08;    ///< auxiliary learning rate
  std::string personal_init =
      "meta";  ///< at a round's start: "meta" (the paper's line 7) or "keep"

  // networks only
  double learning_rate = 1e-3;  ///< Adam's
  NetworkLambdas lambdas;       ///< of some networks their own
  std::string proximal =
      "decoupled";  ///< the pull after Adam's step, or "coupled": in its gradient
};

}  // namespace pmeta
