#include "pmeta_core/base/library.h"

#include <dlfcn.h>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"

namespace pmeta {

void loadLibrary(const std::string& path) {
  requireRegularFile(path, "the library");
  if (::dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL) != nullptr) return;
  const char* reason = ::dlerror();
  throw Error("the library " + shown(path) + " cannot be loaded (" +
              plain(reason == nullptr ? "no reason is given" : reason, 300) +
              "): build it against this version of pMeta.");
}

}  // namespace pmeta
