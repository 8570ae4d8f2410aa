#include "pmeta_core/env/env_spec.h"

#include <set>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

void requireDescribed(const EnvSpec& spec, const char* what, int size,
                      const std::vector<Quantity>& described) {
  const std::string where = "environment '" + spec.name + "' ";
  if (described.size() != static_cast<std::size_t>(size)) {
    throw Error(where + "describes " + std::to_string(described.size()) + " numbers of its " +
                what + ", which has " + std::to_string(size) + ": describe all of them or none.");
  }
  std::set<std::string> names;
  for (const Quantity& one : described) {
    if (one.name.empty() || one.name.find_first_of(" ,") != std::string::npos) {
      throw Error(where + "names a number of its " + what + " '" + one.name +
                  "': a name has no blanks and no commas, and is not empty.");
    }
    if (!names.insert(one.name).second) {
      throw Error(where + "names two numbers of its " + what + " '" + one.name +
                  "': give each a name of its own.");
    }
  }
}

std::vector<Quantity> quantitiesOf(const EnvSpec& spec, const std::string& what, int size,
                                   const std::vector<Quantity>& described,
                                   const Quantity& undescribed) {
  if (!described.empty()) {
    requireDescribed(spec, what.c_str(), size, described);
    return described;
  }
  std::vector<Quantity> numbered(static_cast<std::size_t>(size), undescribed);
  for (std::size_t i = 0; i < numbered.size(); ++i) {
    numbered[i].name = what + "_" + std::to_string(i);
  }
  return numbered;
}

}  // namespace

EnvSpec describedSpec(const std::string& name, int horizon, std::vector<Quantity> observation,
                      std::vector<Quantity> action, std::vector<std::string> choices) {
  EnvSpec spec;
  spec.name = name;
  spec.observation_size = static_cast<int>(observation.size());
  spec.action_size = static_cast<int>(action.size());
  spec.num_actions = static_cast<int>(choices.size());
  spec.horizon = horizon;
  spec.observation = std::move(observation);
  spec.action = std::move(action);
  spec.choices = std::move(choices);
  return spec;
}

std::vector<Quantity> observationsOf(const EnvSpec& spec) {
  return quantitiesOf(spec, "observation", spec.observation_size, spec.observation, {});
}

std::vector<Quantity> actionsOf(const EnvSpec& spec) {
  const double low = spec.num_actions > 0 ? 0 : -1;
  const double high = spec.num_actions > 0 ? spec.num_actions - 1 : 1;
  return quantitiesOf(spec, "action", spec.action_size, spec.action, {"", "", low, high});
}

}  // namespace pmeta
