#pragma once

#include <string>

namespace pmeta {

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
  // soft actor-critic only: a strength for one kind of network; -1: `lambda`. At 0 those networks
  // are each robot's own: neither reset nor shared
  double lambda_actor = -1;
  double lambda_critic = -1;
  double lambda_encoder = -1;
  std::string proximal =
      "decoupled";  ///< the pull after Adam's step, or "coupled": in its gradient
};

}  // namespace pmeta
