#include "pmeta_core/base/named_groups.h"

#include <algorithm>
#include <cctype>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {

std::vector<std::string> namesBelow(const std::string& key, const ListedSettings& given) {
  std::vector<std::string> names;
  for (const auto& [full, value] : given) {
    if (full.rfind(key + ".", 0) != 0) continue;
    const std::string rest = full.substr(key.size() + 1);
    const std::string name = rest.substr(0, rest.find('.'));
    if (name.empty() || !std::all_of(name.begin(), name.end(), [](unsigned char c) {
          return std::isalnum(c) != 0 || c == '_';
        })) {
      throw Error(key + " has the name " + shown(name) +
                  " but must have one of letters, digits and _.");
    }
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

}  // namespace pmeta
