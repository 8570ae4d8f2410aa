#pragma once

#include <vector>

#include "pmeta_core/learn/sac_networks.h"

namespace pmeta {

/// What the critics take two-dimensional actions to be worth in one state: min_k Q_k(s, x, a), the
/// discounted return that soft actor-critic trains on (scaled rewards and entropy), by
/// `parameters`.
///
/// Gives `size` x `size` (at least 2 x 2) values, row-major: row i, column j is that of the action
/// (-1 + 2 j / (size - 1), -1 + 2 i / (size - 1)). `observation` and `task_input` are of the sizes
/// that `networks` says. Throws Error if actions do not have two dimensions.
std::vector<float> actionValues(const SacNetworks& networks, const float* parameters,
                                const float* observation, const float* task_input, int size);

}  // namespace pmeta
