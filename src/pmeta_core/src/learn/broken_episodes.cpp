#include "pmeta_core/learn/broken_episodes.h"

#include <string>

namespace pmeta {

void BrokenEpisodes::broke(const BrokenEpisode& episode) {
  ++count_;
  if (++running_ < kMostRunning) return;
  throw BrokenEpisode(std::to_string(kMostRunning) +
                      " episodes running have broken down, the last one in " + episode.reason());
}

void BrokenEpisodes::saveState(StateWriter& writer) const {
  writer.count("running", running_);
  writer.count("count", count_);
}

void BrokenEpisodes::loadState(StateReader& reader) {
  running_ = static_cast<int>(reader.count("running", 0, kMostRunning - 1));
  count_ = reader.count("count");
}

}  // namespace pmeta
