#pragma once

#include <limits>
#include <string>
#include <vector>

namespace pmeta {

/// One number of an observation or of an action.
struct Quantity {
  std::string name;  ///< without blanks or commas, unlike all others of its vector
  std::string unit;  ///< "m/s", say; "" where it has none
  /// Of an observation: no state in which an episode goes on lies outside (the one that ends it
  /// may). Of an action: what can be done; the environment clips what lies outside.
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();  ///< see low; at least that
};

/// What an agent must know of an environment before it acts.
struct EnvSpec {
  std::string name;          ///< family name, e.g. "gridworld"
  int observation_size = 0;  ///< length of an observation vector
  int action_size = 0;       ///< length of an action vector; 1 where actions are discrete
  int num_actions = 0;       ///< number of discrete actions; 0 where they are continuous
  int horizon = 0;           ///< steps after which an episode is truncated

  std::vector<Quantity> observation{};  ///< observation_size, or none: see observationsOf()
  std::vector<Quantity> action{};       ///< action_size, or none: see actionsOf()
  std::vector<std::string> choices{};   ///< names of the discrete actions, or none
  double step_seconds = 0;              ///< how long a step takes, s; 0: there is no such time
  bool restorable = false;              ///< Env::state() and Env::setState() work
};

/// The spec of those observations and actions, its sizes counted. `choices` are the discrete
/// actions, of which the one number of `action` then is the index; none: actions are continuous.
EnvSpec describedSpec(const std::string& name, int horizon, std::vector<Quantity> observation,
                      std::vector<Quantity> action, std::vector<std::string> choices = {});

/// Every number of an observation, as the environment describes it or else numbered,
/// "observation_0" and so on, and unbounded. Throws Error where it describes another number of
/// them, or two of one name.
std::vector<Quantity> observationsOf(const EnvSpec& spec);

/// The same of an action: undescribed ones are "action_0" and so on, in the bounds that the
/// learners keep to, the discrete actions' indices or [-1, 1].
std::vector<Quantity> actionsOf(const EnvSpec& spec);

}  // namespace pmeta
