#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"

namespace pmeta {

/// The number of tasks that lists of one value, or of one for each task, stand for.
inline std::size_t countTasks(std::initializer_list<std::vector<double>> lists) {
  std::size_t count = 1;
  for (const std::vector<double>& list : lists) count = std::max(count, list.size());
  return count;
}

/// Throws Error unless `values` holds one number, or one for each task; `key` names it.
inline void requireTaskValues(const std::string& key, const std::vector<double>& values,
                              std::size_t num_tasks) {
  if (values.size() == 1 || values.size() == num_tasks) return;
  throw Error(key + " has " + std::to_string(values.size()) + " values for " +
              std::to_string(num_tasks) + " tasks: give one, or one for each task.");
}

/// The value of such a list that holds for `task`.
inline double taskValue(const std::vector<double>& values, std::size_t task) {
  return values[values.size() == 1 ? 0 : task];
}

}  // namespace pmeta
