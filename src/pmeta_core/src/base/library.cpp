#include "pmeta_core/base/library.h"

#include <dlfcn.h>

#include <map>
#include <optional>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

constexpr char kPackages[] = "libpmeta_packages.so";

// while a library is being loaded: the first that spoke against it, or ""
std::optional<std::string>& refusal() {
  static std::optional<std::string> refusal;
  return refusal;
}

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error("the library " + shown(path) + " cannot be used: " + why + ".");
}

void open(const std::string& path) {
  // one that was refused once stays loaded, and would not be heard again
  static std::map<std::string, std::string> refused;
  if (const auto found = refused.find(path); found != refused.end()) refuse(path, found->second);
  refusal() = "";
  const void* handle = ::dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL);
  const std::string why = *std::exchange(refusal(), std::nullopt);
  if (!why.empty()) refuse(path, refused[path] = why);
  if (handle != nullptr) return;
  const char* reason = ::dlerror();
  throw Error("the library " + shown(path) + " cannot be loaded (" +
              plain(reason == nullptr ? "no reason is given" : reason, 300) +
              "): build it against this version of pMeta.");
}

}  // namespace

std::string misfit(const Build& build) {
  const auto of = [](const Build& one) {
    return std::string(one.version) + " with interface " + std::to_string(one.interface);
  };
  if (of(build) != of(kThisBuild)) {
    return "it was built against pMeta " + of(build) + ", and this is " + of(kThisBuild) +
           ": build it against this one";
  }
  if (build.alignment != kThisBuild.alignment) {
    return "it was compiled for a processor with arrays aligned to " +
           std::to_string(build.alignment) + " bytes, and pMeta to " +
           std::to_string(kThisBuild.alignment) + ": give both the same -march, or neither any";
  }
  if (build.checks_containers != kThisBuild.checks_containers) {
    return std::string("it was compiled with") + (build.checks_containers ? "" : "out") +
           " -D_GLIBCXX_DEBUG, unlike pMeta: give it to both or to neither";
  }
  if (build.fast_math) {
    return "it was compiled with -ffast-math, which changes what all others compute too: leave "
           "that "
           "out";
  }
  return "";
}

void refuseRow(const std::string& why) {
  if (!refusal()) throw std::logic_error(why);
  if (refusal()->empty()) refusal() = why;
}

void loadLibrary(const std::string& path) {
  requireRegularFile(path, "the library");
  open(path);
}

Registry<LibraryFinder>& libraryFinders() {
  static Registry<LibraryFinder> finders("library finder");
  return finders;
}

void loadPackage(const std::string& name) {
  const std::string package = name.substr(0, name.find('/'));
  if (libraryFinders().names().empty()) {
    try {
      open(kPackages);
    } catch (const Error&) {
      throw Error(shown(name) + " is of the package " + shown(package) +
                  ", which only ROS can find: give its library, library:=FILE.so, or build pMeta "
                  "with ROS.");
    }
  }
  for (const std::string& finder : libraryFinders().names()) {
    loadLibrary(libraryFinders().at(finder)(name));
  }
}

}  // namespace pmeta
