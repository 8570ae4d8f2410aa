#include "pmeta_core/baselines/inner_step.h"

#include <algorithm>

namespace pmeta {

void innerStep(const GaussianMlp& policy, const ActionData& data, Surrogate kind, double alpha,
               const double* parameters, double* adapted) {
  PolicyOnData on_data(policy, data);
  on_data.at(parameters);
  std::vector<double> gradient(policy.size());
  on_data.gradient(kind, gradient.data());
  for (std::size_t k = 0; k < policy.size(); ++k) adapted[k] = parameters[k] - alpha * gradient[k];
}

InnerStepObjective::InnerStepObjective(const GaussianMlp& policy,
                                       const std::vector<InnerStepData>& tasks, Surrogate inner,
                                       double alpha)
    : policy_(policy), inner_(inner), alpha_(alpha) {
  for (const InnerStepData& data : tasks) {
    tasks_.push_back({{policy, data.before}, {policy, data.after}, {}});
  }
}

void InnerStepObjective::at(const double* theta) {
  for (Task& task : tasks_) {
    task.before.at(theta);
    task.adapted.resize(policy_.size());
    task.before.gradient(inner_, task.adapted.data());
    for (std::size_t k = 0; k < policy_.size(); ++k) {
      task.adapted[k] = theta[k] - alpha_ * task.adapted[k];
    }
    task.after.at(task.adapted.data());
  }
}

// `term` writes a task's part; tasks count alike, in their order
template <class Term>
void InnerStepObjective::mean(double* sum, const Term& term) const {
  std::fill_n(sum, policy_.size(), 0.0);
  std::vector<double> part(policy_.size());
  for (const Task& task : tasks_) {
    term(task, part);
    for (std::size_t k = 0; k < policy_.size(); ++k) {
      sum[k] += part[k] / static_cast<double>(tasks_.size());
    }
  }
}

double InnerStepObjective::loss(Surrogate kind, double clip) const {
  double sum = 0;
  for (const Task& task : tasks_) sum += task.after.loss(kind, clip);
  return sum / static_cast<double>(tasks_.size());
}

double InnerStepObjective::kl() const {
  double sum = 0;
  for (const Task& task : tasks_) sum += task.after.kl();
  return sum / static_cast<double>(tasks_.size());
}

// g <- (I - alpha H) g; H is symmetric
void InnerStepObjective::throughStep(const Task& task, std::vector<double>& gradient) const {
  std::vector<double> product(policy_.size());
  task.before.hessianProduct(inner_, gradient.data(), product.data());
  for (std::size_t k = 0; k < policy_.size(); ++k) gradient[k] -= alpha_ * product[k];
}

void InnerStepObjective::gradient(Surrogate kind, double* gradient, double clip) const {
  mean(gradient, [&](const Task& task, std::vector<double>& part) {
    task.after.gradient(kind, part.data(), clip);
    throughStep(task, part);
  });
}

void InnerStepObjective::klProduct(const double* direction, double* product) const {
  mean(product, [&](const Task& task, std::vector<double>& part) {
    std::vector<double> at_adapted(direction, direction + policy_.size());
    throughStep(task, at_adapted);
    task.after.klProduct(at_adapted.data(), part.data());
    throughStep(task, part);
  });
}

std::vector<double> InnerStepObjective::innerKl() const {
  std::vector<double> kls;
  for (const Task& task : tasks_) kls.push_back(task.before.kl());
  return kls;
}

void InnerStepObjective::innerKlGradient(double* gradient) const {
  mean(gradient,
       [](const Task& task, std::vector<double>& part) { task.before.klGradient(part.data()); });
}

}  // namespace pmeta
