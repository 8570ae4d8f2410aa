// What speaks against settings that are each allowed.
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/experiment/algorithm.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {
namespace {

// six digits, so that a limit that is named is allowed
std::string roundedDown(double value) {
  const double scale = std::pow(10.0, 5 - std::floor(std::log10(value)));
  return formatNumber(std::floor(value * scale) / scale);
}

}  // namespace

void Experiment::applyAlgorithm() {
  ExperimentSettings& e = settings_;
  if (hasMetaLearner()) return meta_learner_->check(numTasks());
  if (algorithm_->check) algorithm_->check(e, *learner_, numTasks());
  if (algorithm_->fixed_anchor) {
    if (e.personal.eta != 0)
      notes_.push_back("algorithm " + e.algorithm + " sets personal.eta to 0.");
    e.personal.eta = 0;
  }
  if (algorithm_->pulls) return;
  const std::string init = evaluatesMeta() ? "meta" : "keep";
  std::vector<std::string> changes;
  if (e.personal.lambda != 0) changes.push_back("personal.lambda to 0");
  if (e.personal.personal_init != init) changes.push_back("personal.personal_init to " + init);
  e.personal.lambda = 0;
  e.personal.lambdas = {};
  e.personal.personal_init = init;
  if (!evaluatesMeta()) {
    if (e.aggregation.beta != 0) changes.push_back("aggregation.beta to 0");
    e.aggregation.beta = 0;
  }
  if (!changes.empty())
    notes_.push_back("algorithm " + e.algorithm + " sets " + join(changes) + ".");
}

void Experiment::checkAggregation() const {
  const AggregationSettings& a = settings_.aggregation;
  if (!rule()->weighted() && a.catch_up > 0) {
    throw Error("aggregation.rule " + a.rule + " counts all tasks the same but " +
                "aggregation.catch_up is " + formatNumber(a.catch_up) +
                ": set catch_up to 0, or rule to mean.");
  }
  if (a.outlier_factor > 0 && a.outlier_factor < 1) {
    throw Error("aggregation.outlier_factor is " + formatNumber(a.outlier_factor) +
                " but must be at least 1, or 0 to leave none out.");
  }
}

void Experiment::checkBodies() const {
  if (!family_->hasOneBody()) return;
  const std::string one =
      "environment '" + settings_.environment + "' has one body for each task, but ";
  if (hasMetaLearner() || algorithm_->pools_environments) {
    throw Error(one + "algorithm " + settings_.algorithm +
                " acts in all tasks in one process: choose one in which each task has an agent.");
  }
  if (learner_->trainingEnvs() > 1) {
    throw Error(one + settings_.learner + ".num_envs is " +
                std::to_string(learner_->trainingEnvs()) + ": set it to 1.");
  }
}

void Experiment::checkLearning() {
  const bool portable = settings_.arithmetic == "portable";
  if (hasMetaLearner()) return meta_learner_->setPortable(portable);
  learner_->setPortable(portable);
  checkStability();
  learner_->check();
}

void Experiment::checkPackage() {
  const Package& package = family_->package();
  std::string& version = settings_.package_version;
  if (version.empty()) version = package.version;
  if (version == package.version) return;
  other_package_ = "the settings are of version " + shown(version) + " of the package " +
                   package.name + ", which is " + shown(package.version) +
                   " here: what is learnt and how policies do may differ.";
  notes_.push_back("warning: " + other_package_);
}

void Experiment::checkStability() {
  const PersonalSettings& p = settings_.personal;
  const std::optional<double> gamma = learner_->linearDiscount();
  const bool tabular = gamma.has_value();
  // with frozen auxiliary parameters the update is a linear map that blows up beyond these; of a
  // network only the pull is linear
  const double own = tabular ? 1 + *gamma : 0;
  const std::string formula = tabular ? "2 / (1 + lambda + gamma)" : "2 / lambda";
  if (p.alpha * (own + p.lambda) >= 2) {
    throw Error("personal.alpha = " + formatNumber(p.alpha) + " with personal.lambda = " +
                formatNumber(p.lambda) + " diverges: alpha must be below " + formula + " = " +
                roundedDown(2 / (own + p.lambda)) + ".");
  }
  if (p.eta * p.lambda >= 2) {
    throw Error("personal.eta = " + formatNumber(p.eta) +
                " with personal.lambda = " + formatNumber(p.lambda) +
                " diverges: eta must be below 2 / lambda = " + formatNumber(2 / p.lambda) + ".");
  }
  const double overshoot = p.alpha * ((tabular ? 1 : 0) + p.lambda);
  if (overshoot > 1) {
    notes_.push_back("warning: alpha * " + std::string(tabular ? "(1 + lambda)" : "lambda") +
                     " = " + formatNumber(overshoot) +
                     " is above 1: the personalised update overshoots.");
  }
  if (p.eta * p.lambda > 1) {
    notes_.push_back("warning: eta * lambda = " + formatNumber(p.eta * p.lambda) +
                     " is above 1: the auxiliary update overshoots.");
  }
}

}  // namespace pmeta
