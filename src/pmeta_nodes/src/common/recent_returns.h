#pragma once

#include <pmeta_msgs/TaskReturn.h>

#include <cstdint>
#include <vector>

namespace pmeta_nodes {

/// The returns of one policy on one task, of its newest two rounds. Agents are up to a round ahead
/// of the run: whoever shows the run as of its last complete round needs the one before too.
class RecentReturns {
 public:
  /// A return of another run begins anew. Of a round's returns the one after most exploration
  /// counts.
  void take(const pmeta_msgs::TaskReturn::ConstPtr& result);

  /// The newest of rounds up to this one; null if there is none.
  pmeta_msgs::TaskReturn::ConstPtr upTo(std::uint32_t round) const;

  /// All that are kept, older first.
  std::vector<pmeta_msgs::TaskReturn::ConstPtr> all() const;

  void forgetOtherRuns(const std::string& run_id);  ///< drops all that is not of that run

 private:
  pmeta_msgs::TaskReturn::ConstPtr newest_;
  pmeta_msgs::TaskReturn::ConstPtr before_;
};

}  // namespace pmeta_nodes
