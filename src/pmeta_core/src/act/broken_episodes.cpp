#include "pmeta_core/act/broken_episodes.h"

#include <string>

namespace pmeta {

void BrokenEpisodes::broke(const BrokenEpisode& episode) {
  ++count_;
  if (++running_ <= forgiven_) return;
  if (forgiven_ == 0) throw episode;
  throw BrokenEpisode(std::to_string(running_) +
                      " episodes running have broken down, the last one in " + episode.reason());
}

void BrokenEpisodes::saveState(StateWriter& writer) const {
  writer.count("running", running_);
  writer.count("count", count_);
}

void BrokenEpisodes::loadState(StateReader& reader) {
  running_ = static_cast<int>(reader.count("running", 0, forgiven_));
  count_ = reader.count("count");
}

}  // namespace pmeta
