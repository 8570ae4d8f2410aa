#pragma once

#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"

namespace pmeta {

/// The names that a user gives groups of settings below `key`, each once and in their order: a and
/// b of "key.a.unit", "key.b.unit". Throws Error on one that is not of letters, digits and _.
std::vector<std::string> namesBelow(const std::string& key, const ListedSettings& given);

}  // namespace pmeta
