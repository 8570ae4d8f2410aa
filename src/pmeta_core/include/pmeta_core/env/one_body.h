#pragma once

#include <memory>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// One environment for all who act in it: training, evaluation and recording take turns.
class OneBody {
 public:
  /// `env`: the only one.
  explicit OneBody(std::unique_ptr<Env> env);
  ~OneBody();

  /// An environment that acts in it, also after this is gone. Its reset() interrupts the episode of
  /// whichever other acted last. Not restorable: the episode may be another's.
  std::unique_ptr<Env> handle() const;

 private:
  struct Shared;
  class Handle;
  std::shared_ptr<Shared> shared_;
};

}  // namespace pmeta
