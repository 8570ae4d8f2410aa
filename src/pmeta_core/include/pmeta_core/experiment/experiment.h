#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/aggregate/aggregation_rule.h"
#include "pmeta_core/base/model.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/experiment/experiment_settings.h"
#include "pmeta_core/personal/personal_learner.h"

namespace pmeta {

/// Of the model files that a run depends on, in its folder.
inline constexpr char kModelsFolder[] = "models";

/// A checked experiment: its settings, its tasks, and what each party needs of them.
///
/// A settings file may hold named variants, `presets: {paper: {...}, ...}`; `preset: paper` reads
/// that one over the rest. What is read of a file depends on `learner` and `environment.name`:
/// settings of others are unknown keys.
///
/// The algorithms are settings, not code paths of their own: see Algorithm.
class Experiment {
 public:
  /// Reads a settings file and applies "key:=value" overrides. Throws Error.
  static Experiment load(const std::string& path, const std::vector<std::string>& overrides = {});

  /// The same from YAML text; `source` names it in errors. Paths in a settings file are relative to
  /// the file's folder, those in a text to `folder`, or to the working folder if it is "", as
  /// those of overrides are.
  static Experiment parse(const std::string& text, const std::string& source,
                          const std::vector<std::string>& overrides = {},
                          const std::string& folder = "");

  /// The experiment of a run folder, by its config.yaml; the folder may have been moved.
  /// `overrides` may set what does not define the run (see definingSettings()). Throws Error if
  /// there is no run there, on an override of anything else, which it names, or if the settings
  /// file `of_config`, if given, is of another experiment.
  static Experiment resume(const std::string& run_dir,
                           const std::vector<std::string>& overrides = {},
                           const std::string& of_config = "");

  /// Checked, with paths absolute and names filled in.
  const ExperimentSettings& settings() const { return settings_; }
  const EnvFamily& family() const { return *family_; }  ///< built
  int numTasks() const { return family_->numTasks(); }  ///< that are trained on
  int numTestTasks() const;  ///< that only the meta-policy is evaluated on, numbered after those
  int totalTasks() const { return numTasks() + numTestTasks(); }  ///< training and test tasks
  /// Test tasks are numbered after the training tasks.
  bool isTestTask(int task) const { return task >= numTasks(); }

  const Algorithm& algorithm() const { return *algorithm_; }  ///< the row that `algorithm` names
  /// Is there a meta-policy that anybody acts on?
  bool evaluatesMeta() const { return algorithm_->shares; }
  /// Is there one learner of all tasks, in which their trajectories meet, in the place of agents?
  /// Then there are no personal policies.
  bool hasMetaLearner() const { return meta_learner_ != nullptr; }
  /// How many parties send an update each round: one for each training task, or the meta-learner.
  int participants() const { return hasMetaLearner() ? 1 : numTasks(); }
  /// Transitions of a meta-learner's round, over all training tasks.
  std::int64_t stepsPerRound() const;
  /// Does phi go on where the last round left it, instead of at the meta-policy?
  bool keepsPersonal() const { return settings_.personal.personal_init == "keep"; }
  /// The rounds that `evaluation_interval` chooses.
  EvaluationSchedule evaluationSchedule() const {
    return {settings_.evaluation_interval, settings_.rounds};
  }
  int quorum() const;  ///< updates needed once the deadline has passed
  /// The rule that `aggregation.rule` names, with its settings.
  std::shared_ptr<const AggregationRule> rule() const {
    return rules_.at(settings_.aggregation.rule);
  }

  /// How many exploration episodes the meta-policy is evaluated after, ascending; {0} without an
  /// inference network.
  std::vector<int> contextEpisodes() const;

  /// What learns a task. Throws Error, which names the settings, if it does not fit into memory.
  std::unique_ptr<PersonalLearner> makeLearner(int task) const;
  /// What learns all tasks, where hasMetaLearner(). Throws as makeLearner().
  std::unique_ptr<MetaLearner> makeMetaLearner() const;
  /// Episodes of one evaluation of a meta-learner's policy.
  int metaEvaluationEpisodes() const { return meta_learner_->evaluationEpisodes(); }
  /// The parameters that every party begins with.
  Model initialModel() const;

  /// Policies for the environment `env`, which must outlive them.
  std::unique_ptr<PolicyFamily> policies(const Env& env) const;
  /// What policy files hold: see manifest.h.
  const std::string& policyFiles() const;
  /// How a meta-policy, which must outlive it as `policies` and this must, gets to know a task by
  /// exploring it; null where it does not.
  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies, const Model& policy) const;
  /// What tells a meta-policy that has not explored to act on `task`; nothing if it must be told a
  /// training task and `task` is none.
  std::optional<std::vector<float>> metaInput(int task) const;
  /// Are the policies networks, not tables?
  bool hasNetworks() const { return hasMetaLearner() || learner_->hasNetworks(); }

  /// The best return any policy can have on the task, where it can be computed (tabular tasks).
  /// The first call computes those of all tasks, which takes minutes on grids of 512 x 512.
  std::optional<double> optimalReturn(int task) const;

  /// Is a checkpoint due after this round?
  bool checkpointsAfter(int round) const {
    return settings_.checkpoint_interval > 0 && round % settings_.checkpoint_interval == 0;
  }

  /// RESULTS_DIR/EXPERIMENT/RUN_ID
  std::string runDir() const;

  /// The effective settings as YAML; parse() of it gives the same experiment.
  const std::string& yaml() const { return yaml_; }
  /// The same for a file in the run's folder, which names the copy of the model there.
  const std::string& runYaml() const { return run_yaml_; }
  /// The model that is simulated; nullptr if there is none.
  const ModelChoice* model() const { return family_->model(); }
  /// Copies a model that is not shipped into the run's folder, where runYaml() names it.
  void copyModel() const;
  /// The same as a table for people.
  const std::string& table() const { return table_; }
  /// Those of the effective settings that decide what a run learns, by full key: all but
  /// results_dir, checkpoint.*, pace, publish_trajectories, aggregation.round_timeout and key_file,
  /// and of a model the hash, not where it is.
  std::map<std::string, std::string> definingSettings() const { return definingSettings(yaml_); }
  /// The same of a run folder, as its manifest.json has them; those of older runs are read from
  /// config.yaml. Throws Error if neither can be read.
  static std::map<std::string, std::string> definingSettingsOf(const std::string& run_dir);
  /// A hash of those, as text: parties of one run have the same.
  std::string settingsHash() const;
  /// Every setting for people: its value, the default where that is another, and its meaning.
  std::string describe() const;
  /// Notes and warnings about the settings, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }
  /// What to say where the environment's package is of another version than the settings were made
  /// with, in a sentence; "" where it is not. Among the notes(), too.
  const std::string& otherPackage() const { return other_package_; }

 private:
  // shared by copies: computed once
  struct Optima {
    std::once_flag computed;
    std::vector<std::optional<double>> returns;  // of each task
  };

  Experiment();
  static Experiment build(const YAML::Node& root, const std::string& source,
                          const std::vector<std::string>& overrides, const std::string& folder);
  static std::map<std::string, std::string> definingSettings(const std::string& yaml);
  void anchorPaths(const std::string& folder);
  void chooseKinds(const std::string& algorithm, const std::string& learner);
  void bind(Settings& settings);
  void bindLearning(Settings& settings);
  void bindAggregation(Settings& settings);
  [[noreturn]] void refuseMemory() const;
  void applyAlgorithm();
  void checkAggregation() const;
  void checkBodies() const;
  void checkLearning();
  void checkStability();
  void checkPackage();

  ExperimentSettings settings_;
  const Algorithm* algorithm_ = nullptr;
  std::map<std::string, std::shared_ptr<AggregationRule>> rules_;  // with their settings
  std::shared_ptr<LearnerKind> learner_;                           // of the agents, or null
  std::shared_ptr<MetaLearnerKind> meta_learner_;                  // or null
  std::shared_ptr<EnvFamily> family_;
  std::shared_ptr<Optima> optima_ = std::make_shared<Optima>();
  std::string yaml_;
  std::string run_yaml_;
  std::string table_;
  std::vector<std::string> notes_;
  std::string other_package_;
};

/// The first key that only one of both has, or has with another value; "" if they are equal.
std::string firstDifference(const std::map<std::string, std::string>& a,
                            const std::map<std::string, std::string>& b);

}  // namespace pmeta
