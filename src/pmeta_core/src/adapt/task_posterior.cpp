#include "pmeta_core/adapt/task_posterior.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace pmeta {
namespace {

// [hypotheses, tasks]: unit vectors, then what lies between two of them
std::vector<float> makeHypotheses(std::size_t tasks, bool mixtures) {
  std::vector<float> all;
  const auto add = [&](std::size_t i, std::size_t j, float share) {
    all.resize(all.size() + tasks);
    float* z = &all[all.size() - tasks];
    z[j] = 1 - share;
    z[i] += share;
  };
  for (std::size_t i = 0; i < tasks; ++i) add(i, i, 1);
  for (std::size_t i = 0; i < tasks && mixtures; ++i) {
    for (std::size_t j = i + 1; j < tasks; ++j) {
      for (const float share : {0.25f, 0.5f, 0.75f}) add(i, j, share);
    }
  }
  return all;
}

}  // namespace

TaskPosterior::TaskPosterior(const TaskModel& model, const TaskModelSettings& settings,
                             const float* parameters)
    : model_(model),
      parameters_(parameters),
      kappa_(settings.kappa),
      hypotheses_(makeHypotheses(model.taskInputs(), settings.hypotheses == "mixtures")),
      energies_(hypotheses_.size() / tasks()),
      weights_(tasks(), 1 / static_cast<double>(tasks())),
      workspace_(model.network(), energies_.size()),
      input_(energies_.size() * model.network().inputs()),
      outcome_(model.outputs()) {
  for (std::size_t h = 0; h < energies_.size(); ++h) {
    std::copy_n(&hypotheses_[h * tasks()], tasks(),
                &input_[h * model.network().inputs() + model.rowSize()]);
  }
  const float* log_variances = parameters + model.network().size();
  for (std::size_t k = 0; k < model.outputs(); ++k) {
    const double variance = std::exp(static_cast<double>(log_variances[k]));
    precisions_.push_back(1 / std::max(variance, settings.least_variance));
  }
}

void TaskPosterior::observe(const Transition& transition) {
  const Mlp& network = model_.network();
  model_.write(transition, input_.data(), outcome_.data());
  for (std::size_t h = 1; h < energies_.size(); ++h) {
    std::copy_n(input_.data(), model_.rowSize(), &input_[h * network.inputs()]);
  }
  const float* predicted =
      network.forward(parameters_, input_.data(), energies_.size(), workspace_);
  for (double& energy : energies_) {
    for (std::size_t k = 0; k < outcome_.size(); ++k) {
      const double error = static_cast<double>(*predicted++) - outcome_[k];
      energy += error * error * precisions_[k] / 2;
    }
  }
  observed_ = true;
  weigh();
}

void TaskPosterior::weigh() {
  const auto end = energies_.begin() + static_cast<std::ptrdiff_t>(tasks());
  const double least = *std::min_element(energies_.begin(), end);
  double sum = 0;
  for (std::size_t j = 0; j < tasks(); ++j) {
    sum += weights_[j] = std::exp(-kappa_ * (energies_[j] - least));
  }
  for (double& weight : weights_) weight /= sum;
}

std::vector<float> TaskPosterior::best() const {
  if (!observed_) return std::vector<float>(tasks(), 1 / static_cast<float>(tasks()));
  const auto least = std::min_element(energies_.begin(), energies_.end()) - energies_.begin();
  const auto z = hypotheses_.begin() + least * static_cast<std::ptrdiff_t>(tasks());
  return {z, z + static_cast<std::ptrdiff_t>(tasks())};
}

std::size_t TaskPosterior::draw(Rng& rng) const {
  double left = rng.uniform();
  for (std::size_t j = 0; j + 1 < tasks(); ++j) {
    left -= weights_[j];
    if (left < 0) return j;
  }
  return tasks() - 1;
}

}  // namespace pmeta
