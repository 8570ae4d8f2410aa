#include "pmeta_core/env/env.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmeta_core/base/error.h"

namespace pmeta {

Registry<EnvFamilyMaker>& envFamilies() {
  static Registry<EnvFamilyMaker> families("environment");
  return families;
}

void ModelChoice::take(const std::string& found, const std::string& source) {
  if (!hash.empty() && hash != found) {
    throw Error("the model " + source + " has the hash " + found +
                ", but environment.model_hash is " + hash +
                ": give the model that this was made with, or model_hash:=\"\" to take this one.");
  }
  hash = found;
}

std::vector<double> Env::state() const {
  throw Error("environment '" + spec().name + "' cannot hand out its state.");
}

void Env::setState(const std::vector<double>&) {
  throw Error("environment '" + spec().name + "' cannot take up a state.");
}

void Env::saveState(StateWriter& writer) const {
  if (spec().restorable) writer.array("state", state());
}

void Env::loadState(StateReader& reader) {
  if (!spec().restorable) return;
  std::vector<double> saved(state().size());
  reader.array("state", saved);
  setState(saved);
  if (saved.back() >= spec().horizon) reader.refuse("state", "is of an episode that is over");
}

void requireState(const EnvSpec& spec, const std::vector<double>& state, std::size_t size) {
  if (state.size() != size) {
    throw Error("a state of " + spec.name + " has " + std::to_string(state.size()) +
                " numbers but must have " + std::to_string(size) + ".");
  }
  if (!std::all_of(state.begin(), state.end(), [](double x) { return std::isfinite(x); })) {
    throw Error("a state of " + spec.name + " holds a number that is not finite.");
  }
  const double steps = state.back();
  if (steps != std::floor(steps) || steps < 0 || steps > std::numeric_limits<int>::max()) {
    throw Error("a state of " + spec.name + " counts " + formatNumber(steps) +
                " steps, which is not a count.");
  }
}

std::vector<std::unique_ptr<Env>> makeEnvs(const std::function<std::unique_ptr<Env>(int k)>& make,
                                           int count) {
  std::vector<std::unique_ptr<Env>> envs;
  for (int k = 0; k < count; ++k) envs.push_back(make(k));
  return envs;
}

}  // namespace pmeta
