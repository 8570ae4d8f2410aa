#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/mjcf/terms.h"

namespace pmeta {

/// The name of the family.
inline constexpr char kMjcf[] = "mjcf";

/// What every observation term has besides its own settings.
struct ObservationCommon {
  double clip = 0;                    ///< largest magnitude of each number; 0: none
  void bind(TermSettings& settings);  ///< below the term's name
};

/// What every reward term has.
struct RewardCommon {
  double weight = 1;                  ///< that its value is multiplied by
  std::string counts = "both";        ///< in what: "training", "evaluation" or "both"
  void bind(TermSettings& settings);  ///< below the term's name
};

/// What every variation has: where its values come from, and how they are set.
struct VariationCommon {
  std::string operation = "set";         ///< or "scale" or "add" to what is there
  std::vector<double> values;            ///< one, or one for each training task; {}: draw them
  std::vector<double> test_values;       ///< the same for test tasks
  std::vector<double> range;             ///< low and high of those that are drawn
  std::string distribution = "uniform";  ///< or "log_uniform"
  bool independent = false;              ///< is each of several numbers drawn on its own?
  void bind(TermSettings& settings);     ///< below the term's name
};

/// What the other terms have: nothing.
struct NothingCommon {
  void bind(TermSettings&) {}  ///< as of the others
};

/// The terms of one section, by the names that the settings give them, in their order.
template <class Kind, class Common = NothingCommon>
class Section {
 public:
  /// One term of it.
  struct Entry {
    std::string name;            ///< as the settings have it
    std::string kind;            ///< of termsOf<Kind>(); the name, where the settings name none
    std::unique_ptr<Kind> term;  ///< not null
    Common common;               ///< what all terms of the section have
  };

  /// `name`: its key below "environment.".
  explicit Section(const std::string& name) : key_("environment." + name) {}

  /// Makes the terms that the settings name. Throws Error on one of an unknown kind.
  void outline(const ListedSettings& given);
  /// Adds a term of that kind and name where there is none so far.
  void makeDefault(const std::string& kind);
  void bind(Settings& settings);  ///< `settings` must not outlive this
  void find(const MujocoModel& model, const OtherTerms& others);  ///< see Term::find()

  const std::vector<Entry>& entries() const { return entries_; }  ///< in the settings' order
  const std::string& key() const { return key_; }                 ///< "environment.rewards", say

 private:
  void make();

  std::string key_;
  std::vector<Entry> entries_;
};

/// An environment as YAML describes it: everything that `environment` holds for the family mjcf.
struct MjcfDesign {
  MjcfDesign();
  MjcfDesign(const MjcfDesign&) = delete;
  MjcfDesign& operator=(const MjcfDesign&) = delete;

  /// As EnvFamily::outline(). Throws Error on terms of unknown kinds, and where something is
  /// missing that every environment has.
  void outline(const ListedSettings& given);
  void bind(Settings& settings);  ///< everything; `settings` must not outlive this
  /// Looks up what the terms name; throws Error.
  void find(const MujocoModel& opened);

  ModelChoice model;              ///< the file that MuJoCo reads
  int horizon = 200;              ///< steps of an episode
  int frame_skip = 1;             ///< timesteps of the model to a step
  bool refresh = true;            ///< is the end of a step evaluated once more?
  bool single_precision = false;  ///< are observations rounded to it?
  bool recompute = true;          ///< of a varied model, what MuJoCo derives from its numbers?
  int train_tasks = 0;            ///< 0: as many as there are values
  int test_tasks = 0;             ///< the same of test tasks
  Section<GoalTerm> goals;        ///< places to go to
  Section<ObservationTerm, ObservationCommon> observations;  ///< what is observed
  Section<ActionTerm> actions;                         ///< what each number of an action drives
  Section<RewardTerm, RewardCommon> rewards;           ///< what is summed up
  Section<TerminationTerm> terminations;               ///< what ends an episode before its horizon
  Section<StartTerm> starts;                           ///< how starts differ
  Section<VariationTerm, VariationCommon> variations;  ///< how tasks differ
};

/// Every kind of term of every section, with its settings, their defaults and meanings: for people.
std::string describeTerms();

}  // namespace pmeta
