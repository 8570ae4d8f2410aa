#pragma once

#include <string>

namespace pmeta {

/// A measure of a learner's update, as the run folder's losses.csv and AgentStatus.msg have it.
struct Loss {
  std::string name;  ///< for people, one word of letters, digits and _: "critic", "entropy"
  double value = 0;  ///< in whatever unit the learner measures it
};

}  // namespace pmeta
