#include "pmeta_core/baselines/rl2_update.h"

#include <algorithm>

namespace pmeta {

Rl2Update::Rl2Update(const Rl2Networks& networks, const PpoSettings& settings,
                     std::size_t max_trials, std::size_t max_steps)
    : networks_(networks),
      settings_(settings),
      recurrent_(networks.gru(), max_trials * max_steps, max_trials),
      mean_(networks.mean(), max_trials * max_steps),
      value_(networks.value(), max_trials * max_steps) {
  const std::size_t rows = max_trials * max_steps;
  order_.reserve(max_trials);
  batches_.reserve(max_steps);
  inputs_.resize(rows * networks.gru().inputs());
  for (AlignedFloats* by_action : {&actions_, &d_means_}) {
    by_action->resize(rows * networks.actionSize());
  }
  for (AlignedFloats* by_row :
       {&log_densities_, &old_values_, &advantages_, &returns_, &d_values_}) {
    by_row->resize(rows);
  }
  for (AlignedFloats* by_unit : {&d_hidden_, &d_hidden_of_value_}) {
    by_unit->resize(rows * networks.gru().units());
  }
}

// row(r, trial, t) for each row, in order
template <class Row>
void Rl2Update::forEachStep(Row&& row) const {
  std::size_t r = 0;
  for (std::size_t t = 0; t < batches_.size(); ++t) {
    for (std::size_t b = 0; b < batches_[t]; ++b) row(r++, order_[b], t);
  }
}

void Rl2Update::unroll(const float* parameters, const std::vector<Trial>& trials,
                       const std::vector<std::size_t>& chosen) {
  order_ = chosen;
  std::stable_sort(order_.begin(), order_.end(),
                   [&](std::size_t a, std::size_t b) { return trials[a].steps > trials[b].steps; });
  batches_.assign(trials[order_.front()].steps, 0);
  for (const std::size_t trial : order_) {
    for (std::size_t t = 0; t < trials[trial].steps; ++t) ++batches_[t];
  }
  const std::size_t inputs = networks_.gru().inputs(), actions = networks_.actionSize();
  rows_ = 0;
  forEachStep([&](std::size_t row, std::size_t trial, std::size_t t) {
    std::copy_n(&trials[trial].inputs[t * inputs], inputs, &inputs_[row * inputs]);
    std::copy_n(&trials[trial].actions[t * actions], actions, &actions_[row * actions]);
    ++rows_;
  });
  hidden_ = networks_.gru().unroll(parameters, inputs_.data(), batches_, nullptr, recurrent_);
  means_ = networks_.mean().forward(parameters + networks_.meanOffset(), hidden_, rows_, mean_);
  values_ = networks_.value().forward(parameters + networks_.valueOffset(), hidden_, rows_, value_);
}

void Rl2Update::evaluate(const float* parameters, const std::vector<Trial>& trials,
                         const std::vector<std::size_t>& chosen,
                         std::vector<TrialTargets>& targets) {
  for (const std::size_t trial : chosen) {
    targets[trial].log_densities.resize(trials[trial].steps);
    targets[trial].values.resize(trials[trial].steps);
  }
  unroll(parameters, trials, chosen);
  const std::size_t actions = networks_.actionSize();
  forEachStep([&](std::size_t row, std::size_t trial, std::size_t t) {
    targets[trial].values[t] = values_[row];
    targets[trial].log_densities[t] =
        static_cast<float>(logDensity(&actions_[row * actions], means_ + row * actions,
                                      parameters + networks_.logStdOffset(), actions));
  });
}

PpoLoss Rl2Update::gradient(const float* parameters, const std::vector<Trial>& trials,
                            const std::vector<TrialTargets>& targets,
                            const std::vector<std::size_t>& chosen, float* gradient) {
  unroll(parameters, trials, chosen);
  forEachStep([&](std::size_t row, std::size_t trial, std::size_t t) {
    log_densities_[row] = targets[trial].log_densities[t];
    old_values_[row] = targets[trial].values[t];
    advantages_[row] = targets[trial].advantages[t];
    returns_[row] = targets[trial].returns[t];
  });
  const PpoBatch batch = {rows_,
                          networks_.actionSize(),
                          actions_.data(),
                          log_densities_.data(),
                          old_values_.data(),
                          advantages_.data(),
                          returns_.data()};
  const PpoLoss loss =
      ppo(settings_, batch, means_, parameters + networks_.logStdOffset(), values_,
          {d_means_.data(), d_values_.data(), gradient + networks_.logStdOffset()});

  const std::size_t mean = networks_.meanOffset(), value = networks_.valueOffset();
  networks_.mean().backward(parameters + mean, hidden_, rows_, d_means_.data(), gradient + mean,
                            d_hidden_.data(), mean_);
  networks_.value().backward(parameters + value, hidden_, rows_, d_values_.data(), gradient + value,
                             d_hidden_of_value_.data(), value_);
  const std::size_t n = rows_ * networks_.gru().units();
  for (std::size_t k = 0; k < n; ++k) d_hidden_[k] += d_hidden_of_value_[k];
  networks_.gru().backward(parameters, inputs_.data(), d_hidden_.data(), gradient, nullptr, nullptr,
                           recurrent_);
  return loss;
}

}  // namespace pmeta
