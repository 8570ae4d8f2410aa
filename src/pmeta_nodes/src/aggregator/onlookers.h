#pragma once

#include <string>

namespace pmeta_nodes {

/// Those who are to see a run from its first round on: rviz, by way of trajectory_view, and
/// rosbag's recorder.
class Onlookers {
 public:
  /// agents: how many the recorder has to hear.
  Onlookers(bool viewer, bool recorder, int agents);

  /// Who is not connected yet, in words: "rviz", "the recorder", both; "" once all are. Asks the
  /// ROS master and these nodes, and waits two seconds for each answer at most.
  std::string missing() const;

 private:
  bool viewerSees() const;
  bool recorderHears() const;

  const bool viewer_;
  const bool recorder_;
  const int agents_;
};

}  // namespace pmeta_nodes
