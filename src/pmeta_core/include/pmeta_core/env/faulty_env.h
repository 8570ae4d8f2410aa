#pragma once

#include <string>

#include "pmeta_core/base/error.h"

namespace pmeta {

/// An environment did what none may do: it threw, or gave what is no number or is not of the size
/// that it said; it would do so again. The sentence names its family, package and task.
class FaultyEnv : public Error {
 public:
  using Error::Error;
};

/// To be called where something of an environment's or of its family's has been caught: throws it
/// as FaultyEnv, "<failed>: <its words>.", unless others know better what it means: BrokenEpisode,
/// Interrupted, want of memory, and what pMeta's own environments (`foreign` is false) throw as
/// Error.
[[noreturn]] void rethrowFault(const std::string& failed, bool foreign);

}  // namespace pmeta
