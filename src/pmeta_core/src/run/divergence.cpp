#include "pmeta_core/run/divergence.h"

#include <cmath>

namespace pmeta {
namespace {

constexpr double kLargest = 1e150;

template <class Values>
std::string divergenceOf(const Model& model, const Values& values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double value = values[k];
    // also true of what is not a number
    if (!model.isPresent(k) || std::abs(value) <= kLargest) continue;
    return "entry " + std::to_string(k) + " is " + formatNumber(value);
  }
  return "";
}

}  // namespace

std::string divergence(const Model& model) {
  return std::visit([&](const auto& values) { return divergenceOf(model, values); }, model.values);
}

std::string stepSizes(const Experiment& experiment) {
  if (experiment.hasMetaLearner()) {
    return "lower the learning rates of " + experiment.settings().algorithm +
           ", or look at its other settings";
  }
  const PersonalSettings& p = experiment.settings().personal;
  const std::string pull = "personal.alpha (" + formatNumber(p.alpha) + "), personal.eta (" +
                           formatNumber(p.eta) + ") or personal.lambda (" + formatNumber(p.lambda) +
                           ")";
  if (!experiment.hasNetworks()) return "lower " + pull;
  return "lower personal.learning_rate (" + formatNumber(p.learning_rate) + "), " + pull;
}

std::string simulationSettings(const Experiment& experiment) {
  const std::string timestep = "take a smaller timestep in the model (environment.model_file)";
  if (experiment.hasMetaLearner()) return timestep;
  return timestep + ", or a smaller personal.learning_rate (" +
         formatNumber(experiment.settings().personal.learning_rate) + ")";
}

}  // namespace pmeta
