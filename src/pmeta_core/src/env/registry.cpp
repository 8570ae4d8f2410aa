#include <functional>
#include <map>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/env/mountain_car.h"

namespace pmeta {
namespace {

using Factory = std::function<std::unique_ptr<EnvFamily>()>;

// every environment family of the suite; a new one adds its line here
const std::map<std::string, Factory>& families() {
  static const std::map<std::string, Factory> kFamilies = {
      {"cart_pole", [] { return std::make_unique<CartPoleFamily>(); }},
      {"gridworld", [] { return std::make_unique<GridworldFamily>(); }},
      {"mountain_car", [] { return std::make_unique<MountainCarFamily>(); }},
  };
  return kFamilies;
}

}  // namespace

std::vector<std::string> envFamilyNames() {
  std::vector<std::string> names;
  for (const auto& family : families()) names.push_back(family.first);
  return names;
}

std::unique_ptr<EnvFamily> makeEnvFamily(const std::string& name) {
  const auto found = families().find(name);
  if (found == families().end()) {
    const std::string guess = nearest(name, envFamilyNames());
    throw Error("unknown environment '" + name + "'" +
                (guess.empty() ? "." : ": did you mean '" + guess + "'?") + " Known are " +
                join(envFamilyNames()) + ".");
  }
  return found->second();
}

}  // namespace pmeta
