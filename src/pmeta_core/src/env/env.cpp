#include "pmeta_core/env/env.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/library.h"
#include "pmeta_core/env/faulty_env.h"

namespace pmeta {

Registry<EnvFamilyMaker>& envFamilies() {
  static Registry<EnvFamilyMaker> families("environment");
  return families;
}

std::unique_ptr<EnvFamily> makeFamily(const std::string& name) {
  if (envFamilies().find(name) == nullptr && name.find('/') != std::string::npos) loadPackage(name);
  std::unique_ptr<EnvFamily> family = envFamilies().at(name)();
  family->name_ = name;
  family->package_ = envFamilies().package(name);
  return family;
}

// "environment 'my_package/Arm' (my_package 1.0.0)", and what follows
std::string EnvFamily::describe(int task) const {
  std::string text = "environment";
  if (!name_.empty()) text += " '" + name_ + "'";
  if (!package_.name.empty()) text += " (" + package_.name + " " + package_.version + ")";
  return text + " of task " + std::to_string(task) + " (" + taskName(task) + ")";
}

std::unique_ptr<Env> EnvFamily::created(int task) const {
  std::unique_ptr<Env> env;
  try {
    env = create(task);
  } catch (...) {
    rethrowFault("the " + describe(task) + " cannot be made", !package_.name.empty());
  }
  if (env == nullptr) throw FaultyEnv("the " + describe(task) + " is none: create() gave null.");
  return env;
}

// a policy for one task must be one for all
void EnvFamily::requireSizes(int task, const EnvSpec& spec) const {
  const auto sizes = [](int observation, int action, int actions) {
    return std::to_string(observation) + " numbers of observation, " + std::to_string(action) +
           " of action and " + std::to_string(actions) + " discrete actions";
  };
  // a body is not asked for what another task needs to know
  if (hasOneBody() && task != 0) return;
  std::call_once(sizes_->known, [&] {
    const std::unique_ptr<Env> first = task == 0 ? nullptr : created(0);
    const EnvSpec& known = task == 0 ? spec : first->spec();
    sizes_->observation = known.observation_size;
    sizes_->action = known.action_size;
    sizes_->actions = known.num_actions;
  });
  if (spec.observation_size == sizes_->observation && spec.action_size == sizes_->action &&
      spec.num_actions == sizes_->actions) {
    return;
  }
  throw FaultyEnv("the " + describe(task) + " has " +
                  sizes(spec.observation_size, spec.action_size, spec.num_actions) +
                  ", but that of task 0 has " +
                  sizes(sizes_->observation, sizes_->action, sizes_->actions) +
                  ": all tasks of a family must have the same.");
}

std::unique_ptr<Env> EnvFamily::make(int task) const {
  std::unique_ptr<Env> env = created(task);
  const EnvSpec& spec = env->spec();
  if (spec.observation_size < 1 || spec.action_size < 1 || spec.num_actions < 0 ||
      spec.horizon < 1) {
    throw FaultyEnv("the " + describe(task) + " has " + std::to_string(spec.observation_size) +
                    " numbers of observation, " + std::to_string(spec.action_size) +
                    " of action and a horizon of " + std::to_string(spec.horizon) +
                    ": each must be at least 1.");
  }
  try {
    observationsOf(spec);
    actionsOf(spec);
  } catch (...) {
    rethrowFault("the " + describe(task) + " is described wrongly", true);
  }
  requireSizes(task, spec);
  env->made_as_ = describe(task);
  env->foreign_ = !package_.name.empty();
  return env;
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

std::string Env::description() const {
  return made_as_.empty() ? "environment '" + spec().name + "'" : made_as_;
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
