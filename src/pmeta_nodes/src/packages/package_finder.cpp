// How the core finds libraries of other packages: by the plugin descriptions that they export for
// pmeta_core in package.xml.
#include <pluginlib/class_loader.hpp>

#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/library.h"
#include "pmeta_core/env/env.h"

namespace {

std::string find(const std::string& name) {
  try {
    // reads the descriptions; the library it finds is the core's to load
    pluginlib::ClassLoader<pmeta::EnvFamily> families("pmeta_core", "pmeta::EnvFamily");
    if (!families.isClassAvailable(name)) {
      const std::string package = name.substr(0, name.find('/'));
      const std::vector<std::string> known = families.getDeclaredClasses();
      throw pmeta::Error(
          "no package here exports the environment " + pmeta::shown(name) + ": build the package " +
          pmeta::shown(package) + " and source its workspace's setup.bash; " +
          (known.empty() ? "no others are exported" : "exported are " + pmeta::join(known)) + ".");
    }
    const std::string library = families.getClassLibraryPath(name);
    if (!library.empty()) return library;
    throw pmeta::Error("the library of the environment " + pmeta::shown(name) +
                       " is missing: build and install the package " +
                       pmeta::shown(families.getClassPackage(name)) +
                       ", whose plugin description names it.");
  } catch (const pluginlib::PluginlibException& error) {
    throw pmeta::Error(
        "the environment " + pmeta::shown(name) +
        " cannot be looked for among ROS's packages: " + pmeta::plain(error.what(), 300));
  }
}

const pmeta::Registered<pmeta::LibraryFinder> kRos(pmeta::libraryFinders(), "ROS", find);

}  // namespace
