#include "convergence_tasks.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/theory/convergence.h"

namespace pmeta {
namespace {

// dense linear solves over a grid's cells, and everything is exact: no place for large grids
constexpr int kLargestGrid = 24;

void bindAll(Settings& s, ConvergenceSettings& c) {
  const std::vector<std::string> diversities = {"corner", "centre", "random", "random_slip"};
  s.bind("experiment", c.experiment, "name of the experiment set, and of its results folder");
  s.bind("seed", c.seed, "one seed, one result", Range::atLeast(0));
  s.bind("results_dir", c.results_dir, "where run folders go; \"\" means ~/.ros/pmeta");
  s.bind("run_id", c.run_id, "name of the run; \"\" means start time and seed");
  s.bind("gamma", c.gamma, "discount", Range::halfOpen(0, 1));
  s.bind("rounds", c.rounds, "C: how often the meta-policy is aggregated",
         Range::between(20, 100000));
  s.bind("updates_per_round", c.updates_per_round, "R: exact auxiliary steps a round",
         Range::between(1, 1000));
  s.bind("diversities", c.diversities,
         "where the landmarks lie, one task set each; random_slip also spreads the slip",
         diversities);

  s.bind("contraction.lambdas", c.contraction.lambdas, "strengths for contraction and step limit",
         Range::atLeast(0));
  s.bind("contraction.pairs", c.contraction.pairs, "random pairs of tables for each lambda",
         Range::between(1, 1e7));

  s.bind("fixed_point.diversity", c.fixed_point.diversity, "task set of Theorem 1", diversities);
  s.bind("fixed_point.lambdas", c.fixed_point.lambdas, "strengths for Theorem 1",
         Range::atLeast(0));
  s.bind("fixed_point.sweeps", c.fixed_point.sweeps, "K: sampled sweeps over the table",
         Range::between(100, 1e7));
  s.bind("fixed_point.slip", c.fixed_point.slip,
         "makes transitions random for the sampled update where environment.slip is 0",
         Range::halfOpen(0, 1));
  s.bind("fixed_point.step_exponent", c.fixed_point.step_exponent,
         "w of the Robbins-Monro step alpha (1 + lambda) = visits^-w", Range{0.5, 1, true, false});
  s.bind("fixed_point.constant_step", c.fixed_point.constant_step,
         "alpha (1 + lambda) of the constant step beside it", Range{0, 1, true, false});

  s.bind("meta.lambdas", c.meta.lambdas, "strengths for Theorem 2", Range::above(0));
  s.bind("meta.eta_cap", c.meta.eta_cap, "eta = min(eta_cap, 1 / lambda)", Range::above(0));
  s.bind("meta.beta", c.meta.beta, "mixing: meta <- (1 - beta) meta + beta mean",
         Range{0, 1, true, false});
  s.bind("meta.draws", c.meta.draws,
         "task sets, of seeds one after the other, that the distance's dependence on lambda is "
         "averaged over where landmarks are random",
         Range::between(1, 10000));

  s.bind("environment.name", c.environment, "family of environments", {"gridworld"});
  s.bind("environment.sizes", c.sizes, "cells along each side, one task each",
         Range::between(2, kLargestGrid));
  s.bind("environment.slip", c.slip, "probability of a random move; one number, or one a task",
         Range::halfOpen(0, 1));
  s.bind("environment.slip_spread", c.slip_spread,
         "random_slip: slip runs from 0 in the first task to this in the last",
         Range::halfOpen(0, 1));
}

void refuseRepeats(const std::string& key, std::vector<std::string> words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (std::size_t k = i + 1; k < words.size(); ++k) {
      if (words[i] == words[k]) {
        throw Error(key + " names '" + words[i] + "' twice: keep one of them.");
      }
    }
  }
}

void refuseRepeats(const std::string& key, const std::vector<double>& values) {
  std::vector<std::string> words;
  for (const double value : values) words.push_back(formatNumber(value));
  refuseRepeats(key, words);
}

void check(const ConvergenceSettings& c) {
  requirePlainName("experiment", c.experiment);
  requirePlainName("run_id", c.run_id);
  refuseRepeats("diversities", c.diversities);
  refuseRepeats("contraction.lambdas", c.contraction.lambdas);
  refuseRepeats("fixed_point.lambdas", c.fixed_point.lambdas);
  refuseRepeats("meta.lambdas", c.meta.lambdas);
  // the family checks its own settings: better now than after a minute
  makeKnownTasks(c, c.fixed_point.diversity, c.slip);
}

ConvergenceSettings build(const YAML::Node& root, const std::string& source,
                          const std::vector<std::string>& overrides) {
  ConvergenceSettings c;
  Settings settings;
  bindAll(settings, c);
  settings.read(root, source);
  for (const std::string& assignment : overrides) settings.assign(assignment);
  c.results_dir = expandResultsDir(c.results_dir);
  if (c.run_id.empty()) c.run_id = utcStamp() + "_seed" + std::to_string(c.seed);
  check(c);
  return c;
}

}  // namespace

ConvergenceSettings loadConvergence(const std::string& path,
                                    const std::vector<std::string>& overrides) {
  return build(loadYamlFile(path), path, overrides);
}

ConvergenceSettings parseConvergence(const std::string& text, const std::string& source,
                                     const std::vector<std::string>& overrides) {
  return build(parseYaml(text, source), source, overrides);
}

std::string convergenceYaml(const ConvergenceSettings& settings) {
  ConvergenceSettings copy = settings;
  Settings bound;
  bindAll(bound, copy);
  return bound.yaml();
}

std::string describeConvergence(const ConvergenceSettings& settings) {
  ConvergenceSettings defaults;
  Settings bound;
  bindAll(bound, defaults);
  bound.read(parseYaml(convergenceYaml(settings), "the settings"), "the settings");
  return bound.table(true);
}

std::string convergenceDir(const ConvergenceSettings& settings) {
  return settings.results_dir + "/" + settings.experiment + "/" + settings.run_id;
}

}  // namespace pmeta
