// Names, meanings and ranges of the settings of every experiment.
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {
namespace {

// "NAME what it is for, ..."
std::string meanings(const Registry<LearnerRow>& rows) {
  std::vector<std::string> all;
  for (const std::string& name : rows.names()) all.push_back(name + " " + rows.at(name).meaning);
  return join(all);
}

// how long a run is, and what becomes of it
void bindRun(Settings& s, ExperimentSettings& e) {
  s.bind("seed", e.seed, "one seed, one result", Range::atLeast(0));
  s.bind("rounds", e.rounds, "C: how often the meta-policy is aggregated", Range::between(1, 1e6));
  s.bind("updates_per_round", e.updates_per_round, "R: personalised and auxiliary updates a round",
         Range::between(1, 1e9));
  s.bind("evaluation_interval", e.evaluation_interval,
         "rounds from one evaluation of the policies to the next; the last is always evaluated",
         Range::between(1, 1e6));
  s.bind("results_dir", e.results_dir, "where run folders go; \"\" means ~/.ros/pmeta");
  s.bind("run_id", e.run_id, "name of the run; \"\" means start time, algorithm and seed");
  s.bind("pace", e.pace, "least seconds between rounds, to watch a fast experiment",
         Range::between(0, 3600));
  s.bind("publish_trajectories", e.publish_trajectories,
         "publish evaluation episodes for the viewer; false: no observation leaves an agent");
  s.bind("key_file", e.key_file,
         "over ROS: file with the key that messages are authenticated with (./pmeta key FILE); "
         "\"\" for none");
  s.bind("checkpoint.interval", e.checkpoint_interval,
         "rounds from one checkpoint of the whole run to the next; 0: none",
         Range::between(0, 1e6));
}

// of a meta-learner
void bindMetaLearning(Settings& s, ExperimentSettings& e) {
  s.bind("steps_per_round", e.steps_per_round,
         "transitions of a round, over all training tasks, made in whole iterations: what is too "
         "much counts for the next; 0: updates_per_round times the tasks",
         Range::between(0, 1e12));
  s.bind("threads", e.threads, "that act in environments at the same time; the result is the same",
         Range::between(1, 1024));
}

// of agents
void bindFresh(Settings& s, ExperimentSettings& e) {
  s.bind("fresh_episodes", e.fresh_episodes,
         "local runner: after the last round, evaluate the last and the best policies again, on so "
         "many fresh episodes a task",
         Range::between(0, 1e6));
}

void bindPull(Settings& s, PersonalSettings& personal) {
  s.bind("personal.alpha", personal.alpha, "personalised learning rate", Range::above(0));
  s.bind("personal.lambda", personal.lambda,
         "strength of the pull towards the auxiliary parameters", Range::atLeast(0));
  s.bind("personal.eta", personal.eta, "auxiliary learning rate", Range::atLeast(0));
  s.bind("personal.personal_init", personal.personal_init,
         "personal parameters at a round's start: the meta-policy's, or kept", {"meta", "keep"});
}

void bindTimeout(Settings& s, AggregationSettings& aggregation) {
  s.bind("aggregation.round_timeout", aggregation.round_timeout,
         "seconds after which a round counts as late", Range::above(0));
}

void bindMixing(Settings& s, AggregationSettings& aggregation) {
  s.bind("aggregation.beta", aggregation.beta, "mixing: meta <- (1 - beta) meta + beta mean",
         Range::between(0, 1));
  s.bind("aggregation.quorum", aggregation.quorum,
         "updates that suffice once round_timeout has passed; 0 means all", Range::atLeast(0));
  bindTimeout(s, aggregation);

  s.bind(
      "aggregation.catch_up", aggregation.catch_up,
      "how much more a task counts while the meta-policy lags behind its personal policy; 0: all "
      "tasks count the same",
      Range::between(0, 10));
  s.bind("aggregation.rule", aggregation.rule,
         "what becomes of each entry: the weighted mean of all values, their median, or the mean "
         "without those at both ends",
         aggregationRules().names());
}

void bindExclusion(Settings& s, AggregationSettings& aggregation) {
  s.bind("aggregation.max_update_norm", aggregation.max_update_norm,
         "an update further than this from the meta-policy it began with (Euclidean) is left out; "
         "0: none is",
         Range::atLeast(0));
  s.bind("aggregation.outlier_factor", aggregation.outlier_factor,
         "an update further than this times the median of the round's distances is left out, where "
         "there are three or more; 0: none is",
         Range::atLeast(0));
}

}  // namespace

void Experiment::bind(Settings& s) {
  ExperimentSettings& e = settings_;
  s.bind("experiment", e.experiment, "name of the experiment set, and of its results folder");
  s.bind("preset", e.preset, "variant of the settings file; \"\" for none");
  s.bind("library", e.library,
         "shared library whose environments, learners, algorithms, rules and scenes are added to "
         "those of the suite; \"\" for none");
  s.bind("algorithm", e.algorithm, "what is trained", algorithmNames());
  if (!hasMetaLearner()) {
    s.bind("learner", e.learner, meanings(learners()), learners().names());
  }
  if (hasNetworks()) {
    s.bind(
        "arithmetic", e.arithmetic,
        "matrix products of networks: native, with the instructions of this processor; portable, "
        "slower, with the same result on every processor that has AVX2 and FMA",
        {"native", "portable"});
  }
  bindRun(s, e);
  if (hasMetaLearner()) {
    bindMetaLearning(s, e);
    bindTimeout(s, e.aggregation);
    meta_learner_->bind(s);
  } else {
    bindFresh(s, e);
    bindPull(s, e.personal);
    learner_->bind(s, e.personal);
    bindMixing(s, e.aggregation);
    for (const auto& rule : rules_) rule.second->bind(s);
    bindExclusion(s, e.aggregation);
  }
  s.bind("environment.name", e.environment, "family of environments", envFamilies().names());
  bindMachines(s, e.machines);
  if (!family_->package().name.empty()) {
    s.bind("environment.package_version", e.package_version,
           "of the package that the environment is of; \"\" means the one that is here");
  }
  family_->bind(s);
}

}  // namespace pmeta
