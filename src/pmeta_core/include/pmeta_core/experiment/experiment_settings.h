#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmeta_core/experiment/machines.h"
#include "pmeta_core/personal/personal_settings.h"

namespace pmeta {

/// How the meta-aggregator mixes and how long it waits.
struct AggregationSettings {
  double beta = 1;             ///< mixing: meta <- (1 - beta) meta + beta mean
  int quorum = 0;              ///< updates that suffice once round_timeout has passed; 0 means all
  double round_timeout = 30;   ///< seconds before a round counts as late
  double catch_up = 0;         ///< how much more tasks count on which the meta-policy lags
  std::string rule = "mean";   ///< a name of aggregationRules()
  double max_update_norm = 0;  ///< updates further from the meta-policy are left out; 0: none
  double outlier_factor = 0;   ///< as are those of more than this times the median; 0: none
};

/// The rounds in which policies are evaluated: every `interval`-th, and the last.
struct EvaluationSchedule {
  int interval = 1;  ///< at least 1
  int rounds = 1;    ///< C

  /// `round`: from 1.
  bool includes(int round) const { return round % interval == 0 || round == rounds; }
};

/// Everything that defines a run, with defaults.
struct ExperimentSettings {
  std::string experiment = "experiment";  ///< names the set and its results folder
  std::string preset;                     ///< which of the file's presets; "" for none
  std::string library;                 ///< shared library with rows of the user's own; "" for none
  std::string algorithm = "pmeta";     ///< a name of algorithms()
  std::string learner = "q_learning";  ///< a name of learners()
  std::string arithmetic = "native";   ///< of networks: native or portable
  std::int64_t seed = 0;               ///< of all random draws: one seed, one result
  int rounds = 10;                     ///< C
  int updates_per_round = 3;           ///< R
  std::int64_t steps_per_round = 0;    ///< meta-learners: transitions a round; 0: R times the tasks
  int threads = 1;                     ///< meta-learners: that act in environments at once
  int evaluation_interval = 1;         ///< rounds from one evaluation to the next
  std::string results_dir;             ///< "" means $ROS_HOME/pmeta, by default ~/.ros/pmeta
  std::string run_id;                  ///< "" means one made of the start time, algorithm and seed
  double pace = 0;                     ///< least seconds between rounds, to watch a fast experiment
  /// Do agents send one evaluation episode of each policy a round, to be looked at?
  bool publish_trajectories = true;
  int checkpoint_interval = 0;  ///< rounds from one checkpoint to the next; 0: none
  std::string key_file;         ///< of the key that messages are authenticated with; "" for none
  int fresh_episodes = 0;       ///< local runner: episodes of the evaluation after the last round
  PersonalSettings personal;    ///< step sizes and pull
  AggregationSettings aggregation;        ///< mixing and waiting
  std::string environment = "gridworld";  ///< a name of envFamilies()
  std::vector<Machine> machines;          ///< over ROS: where agents run that do not run here
  std::string package_version;  ///< of the environment's package, when the run began; "" as it is
};

}  // namespace pmeta
