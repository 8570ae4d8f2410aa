#pragma once

#include <optional>

#include "pmeta_core/messages/protocol.h"
#include "pmeta_core/storage/best_policy.h"
#include "pmeta_core/storage/round_book.h"

namespace pmeta {

/// Keeps, in a run's folder, the meta-policy that it ends with and the best that it had, with the
/// MP of their rounds.
class MetaKeeper {
 public:
  /// `experiment` must live as long as this.
  explicit MetaKeeper(const Experiment& experiment) : experiment_(experiment) {}

  /// A round is complete, and `meta` what it gave, unless that is newer already. Throws Error, e.g.
  /// if the disk is full; may then be called again.
  void offer(const RoundBook::Round& round, const MetaPolicy& meta);
  /// To be called once no round is to come. Throws Error.
  void saveLast(const MetaPolicy& meta) const;

 private:
  const Experiment& experiment_;
  BestPolicy best_;
  PolicyOrigin newest_;  // of the newest that was evaluated
};

}  // namespace pmeta
