#include <functional>
#include <map>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/env/gridworld.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/mountain_car.h"
#include "pmeta_core/env/sparse_point.h"
#include "pmeta_core/env/walker2d.h"

namespace pmeta {
namespace {

using Factory = std::function<std::unique_ptr<EnvFamily>()>;

// every environment family of the suite; a new one adds its line here
const std::map<std::string, Factory>& families() {
  static const std::map<std::string, Factory> kFamilies = {
      {"ant_fwd_back", [] { return std::make_unique<AntFwdBackFamily>(); }},
      {"cart_pole", [] { return std::make_unique<CartPoleFamily>(); }},
      {"gridworld", [] { return std::make_unique<GridworldFamily>(); }},
      {"half_cheetah_dir", [] { return std::make_unique<HalfCheetahDirFamily>(); }},
      {"half_cheetah_vel", [] { return std::make_unique<HalfCheetahVelFamily>(); }},
      {"mountain_car", [] { return std::make_unique<MountainCarFamily>(); }},
      {"sparse_point_robot", [] { return std::make_unique<SparsePointFamily>(); }},
      {"walker_2d_params", [] { return std::make_unique<Walker2dParamsFamily>(); }},
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
