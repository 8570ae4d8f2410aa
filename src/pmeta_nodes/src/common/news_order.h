#pragma once

#include <ros/time.h>

namespace pmeta_nodes {

/// Tells messages about the state of a run that are sent again from new ones, by their signed
/// stamps, which are all of the aggregator's clock. What is older than the newest, or than the
/// moment from which on news count, has been heard before or was never for this node.
class NewsOrder {
 public:
  /// `since`: from which on news count.
  explicit NewsOrder(const ros::Time& since = ros::Time()) : newest_(since) {}

  /// Is a message of that stamp no repetition? If so it is the newest from now on.
  bool take(const ros::Time& stamp) {
    if (stamp < newest_) return false;
    newest_ = stamp;
    return true;
  }

 private:
  ros::Time newest_;
};

}  // namespace pmeta_nodes
