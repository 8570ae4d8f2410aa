#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/base/state.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {

/// Who a checkpoint is of: a task's agent, or the aggregator.
constexpr int kAggregator = -1;

/// Of which run, party and round a checkpoint is.
struct CheckpointIdentity {
  std::string run_id;                           ///< checkpoints of other runs are refused
  int task = kAggregator;                       ///< whose it is
  int round = 0;                                ///< rounds that the party has behind it
  std::string layout;                           ///< ModelLayout::text() of the model
  std::map<std::string, std::string> settings;  ///< Experiment::definingSettings()
};

/// Writes a checkpoint: what `save` hands over, straight from memory. Under a temporary name,
/// synced to the disk, then renamed, so that there is never half a file. Throws Error, e.g. if the
/// disk is full; whatever was at `path` is then as it was.
///
/// The file is HDF5 behind a user block of 512 bytes: the magic "pMetaCkp", the format's version
/// (uint32), 4 zero bytes, the file's length (uint64), BLAKE2b-256 of all that follows the user
/// block, and zeros; all little-endian. The group "identity" says what it is of; each array of the
/// state is a data set of its own below "state", row-major, and text a string.
void writeCheckpoint(const std::string& path, const CheckpointIdentity& identity,
                     const std::function<void(StateWriter&)>& save);

/// An open checkpoint. The state is read from the file when it is asked for.
class CheckpointFile {
 public:
  /// Throws Error unless the file is a whole and unaltered checkpoint: its length and hash are
  /// checked before anything in it is looked at. The hash guards against damage, not against
  /// somebody who means harm and can compute one.
  explicit CheckpointFile(const std::string& path);
  ~CheckpointFile();
  CheckpointFile(const CheckpointFile&) = delete;
  CheckpointFile& operator=(const CheckpointFile&) = delete;

  const CheckpointIdentity& identity() const { return identity_; }  ///< as the file says

  /// Throws Error unless this is a checkpoint of that run, party and model; names the first setting
  /// that differs. The round may be any.
  void require(const CheckpointIdentity& expected) const;

  /// Hands the state to `load`, array by array as that asks for it; throws Error where that refuses
  /// one.
  void load(const std::function<void(StateReader&)>& load);

 private:
  class Reader;

  std::string path_;
  std::unique_ptr<Reader> reader_;
  CheckpointIdentity identity_;
};

/// The checkpoints of one party in RUN_DIR/checkpoint: task_3.round_12.h5 and the like, or
/// aggregator.round_12.h5. The last two are kept.
///
/// Parties write theirs at their own time: a run goes on from the newest round of which the
/// aggregator and every agent have a good one, and that is among the last two of each.
class CheckpointFolder {
 public:
  /// `task`: whose, or kAggregator. `layout`: of its model.
  CheckpointFolder(const Experiment& experiment, int task, const ModelLayout& layout);

  /// The file of that round.
  std::string path(int round) const;

  /// Writes the checkpoint of `component` after `round` and removes all but the two newest up to
  /// that. Throws Error; older checkpoints are then as they were.
  template <class Component>
  void save(int round, const Component& component) const {
    write(round, [&](StateWriter& writer) { component.saveState(writer); });
  }

  /// The newest round, of at most `at_most`, whose checkpoint is whole and of this run; 0 if there
  /// is none. Appends a sentence to `refused` for each newer one that is not.
  int newest(int at_most, std::vector<std::string>& refused) const;

  /// Reads the checkpoint after `round`. Throws Error if it is not good.
  template <class Component>
  void load(int round, Component& component) const {
    read(round, [&](StateReader& reader) { component.loadState(reader); });
  }

  /// Loads the newest one, of at most `at_most`, that can be loaded, into what `fresh` gives: a
  /// component as it is before round 1. Returns its round; 0 if there is none, and then leaves one
  /// that is fresh. Appends to `refused` as newest() does.
  template <class Fresh>
  int loadNewest(int at_most, const Fresh& fresh, std::vector<std::string>& refused) const {
    for (int round = newest(at_most, refused); round > 0; round = newest(round - 1, refused)) {
      try {
        auto&& component = fresh();
        load(round, component);
        return round;
      } catch (const Error& error) {
        refused.emplace_back(error.what());
      }
    }
    fresh();
    return 0;
  }

 private:
  void write(int round, const std::function<void(StateWriter&)>& save) const;
  void read(int round, const std::function<void(StateReader&)>& load) const;
  std::vector<int> rounds() const;  // ascending, as the file names say

  std::string dir_;
  std::string name_;
  CheckpointIdentity identity_;
};

/// The newest round, of at most `at_most`, of which every one of `folders` has a good checkpoint; 0
/// if there is none. Appends a sentence to `refused` for each newer file that is not good.
int newestCommonRound(const std::vector<CheckpointFolder>& folders,
                      std::vector<std::string>& refused,
                      int at_most = std::numeric_limits<int>::max());

}  // namespace pmeta
