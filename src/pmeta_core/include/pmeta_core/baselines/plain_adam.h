#pragma once

#include "pmeta_core/personal/proximal_adam.h"

namespace pmeta {

/// Of a ProximalAdam without auxiliary parameters, which is Adam in float32.
inline ProximalAdamSettings plainAdam(double learning_rate) {
  ProximalAdamSettings settings;
  settings.learning_rate = learning_rate;
  return settings;
}

}  // namespace pmeta
