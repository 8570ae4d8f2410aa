#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/registry.h"
#include "pmeta_core/base/rng.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/base/state.h"
#include "pmeta_core/env/env_spec.h"

namespace pmeta {

/// What one step gives besides the next observation.
struct Step {
  double reward = 0;        ///< what training is on
  bool terminated = false;  ///< a terminal state: nothing to bootstrap from
  bool truncated = false;   ///< the horizon was reached: the value of the state goes on
  /// Where training is on a denser reward than the task is about: the task's own, which evaluation
  /// returns and contexts count.
  std::optional<double> sparse_reward = std::nullopt;

  /// The reward that a return is made of when a policy is judged.
  double evaluatedReward() const { return sparse_reward.value_or(reward); }
};

/// A simulation broke down (a state that is not finite, say): the episode is over, and the step
/// that broke it gave nothing. reset() begins another.
class BrokenEpisode : public Error {
 public:
  /// `reason`: a clause that names the environment, the step and the quantity.
  explicit BrokenEpisode(const std::string& reason)
      : Error(reason + "; the episode cannot go on, reset it."), reason_(reason) {}

  /// As given to the constructor, for sentences that say more.
  const std::string& reason() const { return reason_; }

 private:
  std::string reason_;
};

/// An environment that nobody can act in, however often it is tried: a robot that stays away, or
/// another one than was told. The sentence says all that there is to do.
class LostEnvironment : public Error {
 public:
  using Error::Error;
};

class MujocoModel;

/// One MDP. All randomness comes in as an argument; the state is the only thing that is kept.
class Env {
 public:
  virtual ~Env() = default;

  /// Sizes, bounds and horizon; the same for as long as the environment lives.
  virtual const EnvSpec& spec() const = 0;

  /// Draws a start state and writes its observation (spec().observation_size numbers). Throws
  /// BrokenEpisode, as step() does, where there is a simulation that can break down.
  virtual void reset(Rng& rng, double* observation) = 0;

  /// Acts once. A discrete action a is passed as action[0] == a.
  virtual Step step(const double* action, Rng& rng, double* observation) = 0;

  /// Has the episode been ended from elsewhere? Then reset(), not step(), comes next.
  virtual bool interrupted() const { return false; }

  /// All that the next step depends on, for checkpoints and recorded trajectories; the last number
  /// is the count of steps since the reset. Throws Error unless spec().restorable.
  virtual std::vector<double> state() const;

  /// Generalised positions of the mechanism, for drawings; empty where the observation says all.
  virtual std::vector<double> configuration() const { return {}; }

  /// The model whose configuration() that is; nullptr if there is none.
  virtual const MujocoModel* model() const { return nullptr; }

  /// Goes on from a state() of the same task. Throws Error if `state` cannot be one, or unless
  /// spec().restorable.
  virtual void setState(const std::vector<double>& state);

  /// state() and setState(), nothing unless spec().restorable; loading refuses an episode that is
  /// over.
  void saveState(StateWriter& writer) const;
  /// Goes on from what saveState() wrote of the same task; throws as setState() does.
  void loadState(StateReader& reader);

  /// What it is, for errors: "environment 'my_package/Arm' (my_package 1.0.0) of task 1 (heavy)",
  /// or less where less is known.
  std::string description() const;
  /// Is it of another package than pMeta?
  bool isForeign() const { return foreign_; }

 private:
  friend class EnvFamily;
  std::string made_as_;  // by a family, see description()
  bool foreign_ = false;
};

/// Throws Error unless `state` holds `size` finite numbers of which the last counts steps; for
/// Env::setState.
void requireState(const EnvSpec& spec, const std::vector<double>& state, std::size_t size);

/// Which model of a physics engine a family simulates.
struct ModelChoice {
  std::string file;  ///< "" for the shipped one
  std::string hash;  ///< of that model, or "" for any; set by EnvFamily::build()

  /// Takes up the hash of the model that was opened. Throws Error if another was asked for;
  /// `source` names the model.
  void take(const std::string& found, const std::string& source);
};

/// A family of MDPs, the tasks of one experiment: its settings, and the tasks that follow from
/// them.
class EnvFamily {
 public:
  virtual ~EnvFamily() = default;

  /// Comes before bind(): all that files and overrides say below "environment.", in their order,
  /// for a family whose settings follow from what is said. Throws Error.
  virtual void outline(const ListedSettings& /*given*/) {}

  /// Binds the family's settings below "environment.".
  virtual void bind(Settings& settings) = 0;

  /// Draws and checks the tasks; to be called once, after reading and before anything below.
  virtual void build(std::uint64_t seed) = 0;

  /// Its model; nullptr if it has none.
  virtual ModelChoice* model() { return nullptr; }

  /// Tasks 0 to numTasks() - 1 are for training.
  virtual int numTasks() const = 0;

  /// Tasks numTasks() to numTasks() + numTestTasks() - 1 are test tasks, on which nobody trains.
  /// taskName, taskDescription and make take both.
  virtual int numTestTasks() const { return 0; }

  /// A short name without blanks or commas, e.g. "grid_4x4".
  virtual std::string taskName(int task) const = 0;

  /// What sets the task apart, e.g. "4x4 cells, landmark at (3,3)"; for manifests and people.
  virtual std::string taskDescription(int task) const = 0;

  /// A new environment of that task. The family must outlive it. Throws FaultyEnv if it cannot be
  /// made, is described wrongly, or has other sizes than those of other tasks.
  std::unique_ptr<Env> make(int task) const;

  /// Is each task one body, as a robot is, of which no two environments may be at a time?
  virtual bool hasOneBody() const { return false; }

  /// What its environments have met with so far, for people: name and figure. From any thread.
  virtual std::vector<std::pair<std::string, std::string>> figures() const { return {}; }

  /// The package that it is of.
  const Package& package() const { return package_; }

 protected:
  /// What make() gives.
  virtual std::unique_ptr<Env> create(int task) const = 0;

 private:
  // of the environments of all tasks; shared by copies
  struct Sizes {
    std::once_flag known;
    int observation = 0, action = 0, actions = 0;
  };

  friend std::unique_ptr<EnvFamily> makeFamily(const std::string& name);
  std::unique_ptr<Env> created(int task) const;
  std::string describe(int task) const;
  void requireSizes(int task, const EnvSpec& spec) const;

  std::string name_;  // of its row; "" if it was made without
  Package package_;
  std::shared_ptr<Sizes> sizes_ = std::make_shared<Sizes>();
};

/// `count` environments: make(0), make(1), ...
std::vector<std::unique_ptr<Env>> makeEnvs(const std::function<std::unique_ptr<Env>(int k)>& make,
                                           int count);

/// Makes a family with its default settings.
using EnvFamilyMaker = std::function<std::unique_ptr<EnvFamily>()>;

/// Every family, by the name that `environment.name` gives; that of a family of another package is
/// "my_package/MyFamily".
Registry<EnvFamilyMaker>& envFamilies();

/// The family of that name, with its default settings; one of a package that is not loaded yet is
/// looked for. Throws Error if there is none.
std::unique_ptr<EnvFamily> makeFamily(const std::string& name);

/// In the source of a family, outside of any function:
///
///     const RegisteredFamily<CartPoleFamily> kCartPole("cart_pole");
template <class Family>
struct RegisteredFamily : Registered<EnvFamilyMaker> {
  /// `name`: for `environment.name`; throws std::logic_error if it is taken.
  explicit RegisteredFamily(const std::string& name)
      : Registered(envFamilies(), name, [] { return std::make_unique<Family>(); }) {}
};

}  // namespace pmeta
