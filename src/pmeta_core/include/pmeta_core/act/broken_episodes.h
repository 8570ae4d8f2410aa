#pragma once

#include <cstdint>

#include "pmeta_core/base/state.h"
#include "pmeta_core/env/env.h"

namespace pmeta {

/// Counts the episodes whose simulation broke down, and gives up where one after the other does.
class BrokenEpisodes {
 public:
  /// So many running are forgiven where training data is collected.
  static constexpr int kForgiven = 9;

  /// So many running are forgiven.
  explicit BrokenEpisodes(int forgiven) : forgiven_(forgiven) {}

  /// An episode has come to its end.
  void ended() { running_ = 0; }

  /// An episode has broken down. Throws BrokenEpisode if there are now more than are forgiven.
  void broke(const BrokenEpisode& episode);

  std::int64_t count() const { return count_; }  ///< in all

  void saveState(StateWriter& writer) const;  ///< both counts, of those running and of all
  void loadState(StateReader& reader);        ///< refuses more running than are forgiven

 private:
  int forgiven_;
  int running_ = 0;  // since the last that came to its end
  std::int64_t count_ = 0;
};

}  // namespace pmeta
