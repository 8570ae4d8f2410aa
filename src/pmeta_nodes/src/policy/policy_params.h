#pragma once

#include <cstdint>
#include <string>

namespace pmeta_nodes {

/// Private parameters of every node that acts with a trained policy.
struct PolicyParams {
  std::string file;        ///< ~policy, required
  int task = -1;           ///< ~task; -1: not said
  bool explores = true;    ///< ~explore
  std::uint64_t seed = 0;  ///< ~seed, of its exploration
};

/// Throws pmeta::Error if one cannot be, or no policy is given.
PolicyParams policyParams();

}  // namespace pmeta_nodes
