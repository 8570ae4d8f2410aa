#include "view/playback.h"

#include <algorithm>

#include "pmeta_nodes/scene.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;

bool Playback::offer(const Trajectory::ConstPtr& episode) {
  Track& track = episode->policy == Trajectory::META ? meta_ : personal_;
  if (track.shown && step_seconds_ > 0) {
    track.next = episode;
    return false;
  }
  track.shown = episode;
  seconds_ = 0;
  return true;
}

bool Playback::advance(double seconds) {
  seconds_ += seconds;
  waited_ = personal_.next || meta_.next ? waited_ + seconds : 0;
  if (seconds_ < period() && waited_ < kLongestWait) return false;
  seconds_ = waited_ = 0;
  bool changed = false;
  for (Track* track : {&personal_, &meta_}) {
    if (!track->next) continue;
    track->shown = track->next;
    track->next.reset();
    changed = true;
  }
  return changed;
}

void Playback::forgetOtherRuns(const std::string& run_id) {
  for (Track* track : {&personal_, &meta_}) {
    for (Trajectory::ConstPtr* episode : {&track->shown, &track->next}) {
      if (*episode && (*episode)->run_id != run_id) episode->reset();
    }
  }
}

double Playback::period() const {
  std::size_t steps = 0;
  for (const Track* track : {&personal_, &meta_}) {
    if (track->shown) steps = std::max(steps, numSteps(*track->shown));
  }
  return static_cast<double>(steps) * step_seconds_ + kPause;
}

}  // namespace pmeta_nodes
