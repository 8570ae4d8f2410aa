#pragma once

#include <string>

namespace pmeta {

/// The path that `setting` gives, absolute, with "~" expanded: nodes run in other working folders
/// than the shell. Throws Error, which names the setting, if it is no plain text.
std::string absolutePath(const std::string& setting, std::string path);

/// "~" and "" expanded: where results go by default, see ExperimentSettings::results_dir.
std::string expandResultsDir(const std::string& results_dir);

/// Creates `dir` if need be and proves that a file can be written there; throws Error.
void requireWritable(const std::string& dir);

/// UTC time as 20261122T061203, for names; or 2026-11-22T06:12:03Z, for people.
std::string utcStamp();
std::string utcTime();  ///< the same time as 2026-11-22T06:12:03Z, for people

}  // namespace pmeta
