#pragma once

#include <string>

namespace pmeta {

/// Writes trajectories.csv into the folder of a run that is over: what its last policies observe
/// in one greedy episode each, with the starts of the rounds' evaluations.
///
/// A personal policy acts on its own task, with what its file knows of it; the meta-policy on every
/// task, after each number of exploration episodes that there is, or 0 where it explores none. A
/// row is one observation; step 0 is the start. Throws Error if the folder is of no run, has no
/// policies, or is being written.
void writeTrajectories(const std::string& run_dir);

}  // namespace pmeta
