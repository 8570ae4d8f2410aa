#pragma once

#include <algorithm>

namespace pmeta {

/// The action of the largest value; the lowest index wins a tie.
template <class Scalar>
int greedyAction(const Scalar* action_values, int num_actions) {
  return static_cast<int>(std::max_element(action_values, action_values + num_actions) -
                          action_values);
}

}  // namespace pmeta
