#pragma once

#include <pmeta_msgs/Trajectory.h>

#include <string>

namespace pmeta_nodes {

/// Plays the last episodes of one task in a loop, both policies from the same start. A new episode
/// waits until those that are playing have been seen to their end, but no longer than a minute.
class Playback {
 public:
  /// Both last episodes stand still for so long, in s, before they begin anew.
  static constexpr double kPause = 1;
  /// So long, in s, a new episode waits for the end of longer ones at most.
  static constexpr double kLongestWait = 60;

  /// `step_seconds` as Scene::stepSeconds(); with 0 a new episode is shown at once.
  explicit Playback(double step_seconds) : step_seconds_(step_seconds) {}

  /// Takes an episode of either policy. Returns true if it is shown at once.
  bool offer(const pmeta_msgs::Trajectory::ConstPtr& episode);

  /// Lets time pass. Returns true if other episodes are shown from now on.
  bool advance(double seconds);

  /// Drops all that does not belong to that run.
  void forgetOtherRuns(const std::string& run_id);

  double seconds() const { return seconds_; }  ///< since the start of the episodes
  /// The episode that plays; null before the first.
  const pmeta_msgs::Trajectory::ConstPtr& personal() const { return personal_.shown; }
  /// The episode that plays; null before the first.
  const pmeta_msgs::Trajectory::ConstPtr& meta() const { return meta_.shown; }

 private:
  struct Track {
    pmeta_msgs::Trajectory::ConstPtr shown;
    pmeta_msgs::Trajectory::ConstPtr next;
  };
  double period() const;

  double step_seconds_;
  double seconds_ = 0;
  double waited_ = 0;  // of the episode that has waited longest for its turn
  Track personal_;
  Track meta_;
};

}  // namespace pmeta_nodes
