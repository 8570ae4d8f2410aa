#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/env/env.h"
#include "pmeta_core/learn/dqn.h"
#include "pmeta_core/learn/sac_settings.h"
#include "pmeta_core/personal/personal_learner.h"
#include "pmeta_core/personal/tabular_personal_learner.h"

namespace pmeta {

/// How the meta-aggregator mixes and how long it waits.
struct AggregationSettings {
  double beta = 1;             ///< mixing: meta <- (1 - beta) meta + beta mean
  int quorum = 0;              ///< updates that suffice once round_timeout has passed; 0 means all
  double round_timeout = 30;   ///< seconds before a round counts as late
  double catch_up = 0;         ///< how much more tasks count on which the meta-policy lags
  std::string rule = "mean";   ///< mean, median or trimmed_mean of each entry
  double trim = 0.2;           ///< with trimmed_mean: share of values cut at each end
  double max_update_norm = 0;  ///< updates further from the meta-policy are left out; 0: none
  double outlier_factor = 0;   ///< as are those of more than this times the median; 0: none
};

/// The rounds in which policies are evaluated: every `interval`-th, and the last.
struct EvaluationSchedule {
  int interval = 1;
  int rounds = 1;  ///< C

  bool includes(int round) const { return round % interval == 0 || round == rounds; }
};

/// Everything that defines a run, with defaults.
struct ExperimentSettings {
  std::string experiment = "experiment";
  std::string preset;                  ///< which of the file's presets; "" for none
  std::string algorithm = "pmeta";     ///< pmeta, model_averaging, independent or pooled
  std::string learner = "q_learning";  ///< q_learning (tables), dqn or sac (networks)
  std::string arithmetic = "native";   ///< of networks: native or portable
  std::int64_t seed = 0;
  int rounds = 10;              ///< C
  int updates_per_round = 3;    ///< R
  int evaluation_interval = 1;  ///< rounds from one evaluation to the next
  std::string results_dir;      ///< "" means $ROS_HOME/pmeta, by default ~/.ros/pmeta
  std::string run_id;           ///< "" means one made of the start time, algorithm and seed
  double pace = 0;              ///< least seconds between rounds, to watch a fast experiment
  bool publish_trajectories = true;
  int checkpoint_interval = 0;  ///< rounds from one checkpoint to the next; 0: none
  std::string key_file;         ///< of the key that messages are authenticated with; "" for none
  int fresh_episodes = 0;       ///< local runner: episodes of the evaluation after the last round
  PersonalSettings personal;
  QLearningSettings q_learning;  ///< with learner q_learning
  DqnSettings dqn;               ///< with learner dqn
  SacSettings sac;               ///< with learner sac
  AggregationSettings aggregation;
  std::string environment = "gridworld";
};

/// A checked experiment: its settings, its tasks, and what each party needs of them.
///
/// A settings file may hold named variants, `presets: {paper: {...}, ...}`; `preset: paper` reads
/// that one over the rest. What is read of a file depends on `learner` and `environment.name`:
/// settings of others are unknown keys.
///
/// The algorithms are settings, not code paths of their own:
///   pmeta            personal pull lambda, agents send auxiliary parameters
///   model_averaging  lambda = 0, agents send their personal parameters
///   independent      lambda = 0, personal parameters kept, beta = 0: nothing comes back
///   pooled           independent, but each agent trains in environments of all tasks, as if
///                    trajectories were shared (learner dqn); it is evaluated on its own task
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

  const ExperimentSettings& settings() const { return settings_; }
  const EnvFamily& family() const { return *family_; }
  int numTasks() const { return family_->numTasks(); }  ///< that are trained on
  int numTestTasks() const;  ///< that only the meta-policy is evaluated on, numbered after those
  int totalTasks() const { return numTasks() + numTestTasks(); }
  bool isTestTask(int task) const { return task >= numTasks(); }

  bool sendsPersonal() const { return settings_.algorithm != "pmeta"; }
  bool evaluatesMeta() const {
    return settings_.algorithm == "pmeta" || settings_.algorithm == "model_averaging";
  }
  bool keepsPersonal() const { return settings_.personal.personal_init == "keep"; }
  EvaluationSchedule evaluationSchedule() const {
    return {settings_.evaluation_interval, settings_.rounds};
  }
  int quorum() const;  ///< updates needed once the deadline has passed
  /// The share of an entry's values that aggregation.rule cuts at each end: 0 for the mean, 0.5 for
  /// the median.
  double trim() const;

  /// How many exploration episodes the meta-policy is evaluated after, ascending; {0} without an
  /// inference network.
  std::vector<int> contextEpisodes() const;

  /// Throws Error, which names the settings, if it does not fit into memory.
  std::unique_ptr<PersonalLearner> makeLearner(int task) const;

  /// The best return any policy can have on the task, where it can be computed (tabular tasks).
  /// The first call computes those of all tasks, which takes minutes on grids of 512 x 512.
  std::optional<double> optimalReturn(int task) const;

  /// Is a checkpoint due after this round?
  bool checkpointsAfter(int round) const {
    return settings_.checkpoint_interval > 0 && round % settings_.checkpoint_interval == 0;
  }

  /// <results_dir>/<experiment>/<run_id>
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
  /// The same of effective settings as YAML, e.g. those of a run folder's config.yaml.
  static std::map<std::string, std::string> definingSettings(const std::string& yaml);
  /// A hash of those, as text: parties of one run have the same.
  std::string settingsHash() const;
  /// Every setting for people: its value, the default where that is another, and its meaning.
  std::string describe() const;
  /// Notes and warnings about the settings, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  // shared by copies: computed once
  struct Optima {
    std::once_flag computed;
    std::vector<std::optional<double>> returns;  // of each task
  };

  Experiment() = default;
  static Experiment build(const YAML::Node& root, const std::string& source,
                          const std::vector<std::string>& overrides, const std::string& folder);
  void anchorPaths(const std::string& folder);
  std::unique_ptr<PersonalLearner> makeLearnerUnguarded(int task) const;
  void checkSampling() const;
  void bind(Settings& settings, const std::string& learner);
  void bindLearner(Settings& settings, const std::string& learner);
  void applyAlgorithm();
  void checkAggregation() const;
  void checkStability();

  ExperimentSettings settings_;
  std::shared_ptr<EnvFamily> family_;
  std::shared_ptr<Optima> optima_ = std::make_shared<Optima>();
  std::string yaml_;
  std::string run_yaml_;
  std::string table_;
  std::vector<std::string> notes_;
};

/// The first key that only one of both has, or has with another value; "" if they are equal.
std::string firstDifference(const std::map<std::string, std::string>& a,
                            const std::map<std::string, std::string>& b);

/// "~" and "" expanded: where results go by default, see ExperimentSettings::results_dir.
std::string expandResultsDir(const std::string& results_dir);

/// Creates `dir` if need be and proves that a file can be written there; throws Error.
void requireWritable(const std::string& dir);

/// UTC time as 20261122T061203, for names; or 2026-11-22T06:12:03Z, for people.
std::string utcStamp();
std::string utcTime();

}  // namespace pmeta
