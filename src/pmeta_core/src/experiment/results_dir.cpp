#include "pmeta_core/experiment/results_dir.h"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

std::string formatUtc(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[40];
  std::strftime(text, sizeof text, format, &parts);
  return text;
}

std::string environmentVariable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

// nodes run in other working folders than the shell
std::string absolutePath(const std::string& setting, std::string path) {
  if (!isPlainText(path)) {
    throw Error(setting + " is " + shown(path) +
                " but must be a path in UTF-8, without control characters.");
  }
  if (path == "~" || path.rfind("~/", 0) == 0) {
    const std::string home = environmentVariable("HOME");
    if (home.empty()) {
      throw Error(setting + " is '" + path + "' but HOME is not set: give " + setting +
                  (setting == "results_dir" ? ":=DIR." : ":=FILE."));
    }
    path = home + path.substr(1);
  }
  return std::filesystem::absolute(path).lexically_normal().string();
}

std::string expandResultsDir(const std::string& results_dir) {
  std::string dir = results_dir;
  if (dir.empty()) {
    const std::string home = environmentVariable("HOME");
    const std::string ros_home = environmentVariable("ROS_HOME");
    if (ros_home.empty() && home.empty()) {
      throw Error("results_dir is not given and HOME is not set: give results_dir:=DIR.");
    }
    dir = (ros_home.empty() ? home + "/.ros" : ros_home) + "/pmeta";
  }
  return absolutePath("results_dir", dir);
}

void requireWritable(const std::string& dir) {
  const auto fail = [&](const std::string& why) {
    throw Error("the results folder " + dir + " cannot be written (" + why +
                "): choose another with results_dir:=DIR.");
  };
  std::error_code error;
  std::filesystem::create_directories(dir, error);
  if (error) fail(error.message());
  const std::string probe = dir + "/.write_probe_" + std::to_string(::getpid());
  errno = 0;
  std::ofstream file(probe);
  file << "probe\n";
  file.close();
  const std::string why = std::strerror(errno);
  const bool written = static_cast<bool>(file);
  std::filesystem::remove(probe, error);
  if (!written) fail(why);
}

std::string utcStamp() { return formatUtc("%Y%m%dT%H%M%S"); }

std::string utcTime() { return formatUtc("%Y-%m-%dT%H:%M:%SZ"); }

}  // namespace pmeta
