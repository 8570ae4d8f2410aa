#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmeta_core/base/rng.h"

namespace pmeta {

/// The name of one of a family's tasks, of which the first `num_train` are for training: "ant_0",
/// "ant_1", ..., "ant_test_0", ...
inline std::string splitTaskName(const std::string& family, int task, int num_train) {
  return task < num_train ? family + "_" + std::to_string(task)
                          : family + "_test_" + std::to_string(task - num_train);
}

/// The given values, or `count` draws of `draw(rng)` where none are given; each task has a stream
/// of its own, so that it does not depend on how many others there are.
template <class Value, class Draw>
std::vector<Value> givenOrDrawn(const std::vector<Value>& given, int count, std::uint64_t seed,
                                Stream stream, Draw&& draw) {
  if (!given.empty()) return given;
  std::vector<Value> values;
  for (int i = 0; i < count; ++i) {
    Rng rng(seed, static_cast<std::uint64_t>(i), stream);
    values.push_back(draw(rng));
  }
  return values;
}

}  // namespace pmeta
