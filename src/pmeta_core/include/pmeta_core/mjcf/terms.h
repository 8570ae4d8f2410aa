#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "pmeta_core/base/rng.h"
#include "pmeta_core/env/env_spec.h"
#include "pmeta_core/mjcf/term.h"

struct mjData_;
struct mjModel_;

namespace pmeta {

/// What terms look at: the simulated robot as the last step (or the reset) left it.
struct Robot {
  const mjModel_* model = nullptr;  ///< as the task has it
  const mjData_* data = nullptr;    ///< of that model
  double dt = 0;                    ///< s that a step takes
  const double* action = nullptr;   ///< the last one, from -1 to 1; zeros at the start
  std::size_t action_size = 0;      ///< numbers of an action
  const double* goals = nullptr;    ///< positions of the goals (m, world axes), three numbers each
  bool last_step = false;           ///< was that the horizon's?

  const double* goal(int index) const { return goals + 3 * index; }  ///< of Elements::goal()
};

/// A part of an observation.
class ObservationTerm : public Term {
 public:
  static Registry<TermRow<ObservationTerm>>& registry();  ///< of `observations`

  /// After find(): names, units and bounds of its numbers.
  virtual std::vector<Quantity> quantities() const = 0;
  /// Writes as many numbers.
  virtual void observe(const Robot& robot, double* numbers) const = 0;
  /// Does it read contact forces?
  virtual bool needsContactForces() const { return false; }
};

/// A part of an action: from numbers in [-1, 1] to controls and forces.
class ActionTerm : public Term {
 public:
  static Registry<TermRow<ActionTerm>>& registry();  ///< of `actions`

  /// After find(): names of its numbers, each from -1 to 1.
  virtual std::vector<Quantity> quantities() const = 0;
  /// Writes controls or applied forces of a step of `dt` seconds.
  virtual void act(const double* action, double dt, mjData_* data) const = 0;
};

/// A number that each step is rewarded by, times its weight.
class RewardTerm : public Term {
 public:
  static Registry<TermRow<RewardTerm>>& registry();  ///< of `rewards`

  /// How many numbers of before a step it needs after it.
  virtual int memory() const { return 0; }
  /// Writes them, after the reset and after each step.
  virtual void remember(const Robot& /*robot*/, double* /*memory*/) const {}
  /// The value of the step that has been made; `memory` is as remember() left it before.
  virtual double value(const Robot& robot, const double* memory) const = 0;
  /// Does it read contact forces?
  virtual bool needsContactForces() const { return false; }
};

/// A reason to end an episode, with no value beyond.
class TerminationTerm : public Term {
 public:
  static Registry<TermRow<TerminationTerm>>& registry();  ///< of `terminations`

  /// Is the episode over?
  virtual bool isOver(const Robot& robot) const = 0;
  /// What holds of observed numbers, by name, while it is not.
  virtual std::vector<Quantity> bounds() const { return {}; }
};

/// How an episode starts: terms of `starts` are applied one after the other to the model's rest.
class StartTerm : public Term {
 public:
  static Registry<TermRow<StartTerm>>& registry();  ///< of `starts`

  /// Changes configuration, velocity and the like.
  virtual void start(const mjModel_* model, mjData_* data, Rng& rng) const = 0;
};

/// A place to go to, drawn at the start of each episode.
class GoalTerm : public Term {
 public:
  static Registry<TermRow<GoalTerm>>& registry();  ///< of `goals`

  void bind(TermSettings& settings) override;
  void find(const Elements& elements) override;
  /// Writes its position (m, world axes), three numbers.
  virtual void draw(Rng& rng, double* position) const = 0;
  /// Index of the model's mocap body that shows it; -1: none.
  int mocap() const { return mocap_; }

 private:
  std::string body_;
  int mocap_ = -1;
};

/// A number in which tasks differ, and how it is set.
struct Figure {
  double value = 0;                 ///< as the settings and the model have it
  std::function<void(double)> set;  ///< for the task at hand
  double least = -std::numeric_limits<double>::infinity();  ///< that it may be set to
};

/// The task at hand: what variations change.
struct TaskDraft {
  mjModel_* model = nullptr;               ///< of the task alone
  const Settings* settings = nullptr;      ///< of the whole environment, not to be changed
  std::vector<std::string> assignments{};  ///< "key:=value", applied to the task's settings
};

/// What differs from task to task.
class VariationTerm : public Term {
 public:
  static Registry<TermRow<VariationTerm>>& registry();  ///< of `variations`

  /// The numbers that it changes; `draft` must outlive them.
  virtual std::vector<Figure> figures(TaskDraft& draft) const = 0;
  /// Are they the model's?
  virtual bool changesModel() const { return true; }
};

}  // namespace pmeta
