#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace pmeta_nodes {

/// What a launch file and those beside it and of pMeta's that it includes declare.
struct LaunchArguments {
  std::set<std::string> names;      ///< of all arguments
  std::set<std::string> handed_on;  ///< of those that prepare_run gets: settings and some more
  std::set<std::string> switches;   ///< of those that are true or false
};

/// Reads what arguments they declare; throws Error if one cannot be read. `folder`: of pMeta's.
LaunchArguments readLaunchFile(const std::filesystem::path& file,
                               const std::filesystem::path& folder);

/// What prepare_run is to know of words key:=value as roslaunch takes them: all but the arguments
/// that the launch file keeps to itself. Throws Error where roslaunch could not make sense of a
/// word.
std::vector<std::string> handedOn(const std::vector<std::string>& words,
                                  const LaunchArguments& arguments);

/// "key=value key=value", as the launch argument `settings` has it, as key:=value each. A value in
/// brackets or quotes may hold blanks.
std::vector<std::string> splitSettings(const std::string& text);

/// The words of a launch: the lines that its launch file hands on and, if roslaunch was called with
/// a launch file of `folder` or one that includes such a file, what stands on its command line, of
/// which roslaunch drops whatever no argument declares.
std::vector<std::string> wordsOfLaunch(const std::string& lines,
                                       const std::vector<std::string>& command,
                                       const std::filesystem::path& folder);

}  // namespace pmeta_nodes
