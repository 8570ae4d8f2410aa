#include "pmeta_core/baselines/rl2.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "pmeta_core/baselines/advantages.h"
#include "pmeta_core/baselines/plain_adam.h"
#include "pmeta_core/baselines/rl2_actor.h"

namespace pmeta {
namespace {

std::size_t largestMinibatch(const Rl2Settings& settings) {
  return static_cast<std::size_t>((settings.trials + settings.minibatches - 1) /
                                  settings.minibatches);
}

PpoSettings ppoSettings(const Rl2Settings& settings) {
  PpoSettings ppo = settings.ppo;
  if (settings.baseline == "linear") ppo.value_coefficient = 0;
  return ppo;
}

EnvSpec specOf(const MetaTasks& tasks) { return tasks.family->make(0)->spec(); }

}  // namespace

Rl2::Rl2(const MetaTasks& tasks, const Rl2Settings& settings)
    : settings_(settings),
      num_tasks_(tasks.count()),
      policies_(specOf(tasks), settings),
      model_(policies_.layout()),
      adam_(model_.floats().data(), nullptr, model_.size(), plainAdam(settings.learning_rate)),
      sampler_(tasks, policies_.networks(), settings.episodes,
               static_cast<std::size_t>(settings.trials)),
      update_(policies_.networks(), ppoSettings(settings), largestMinibatch(settings),
              static_cast<std::size_t>(settings.episodes * specOf(tasks).horizon)),
      losses_{{"last_episode_return", 0},
              {"first_episode_return", 0},
              {"policy", 0},
              {"value", 0},
              {"entropy", 0},
              {"kl", 0},
              {"clipped", 0}},
      trials_(static_cast<std::size_t>(settings.trials)),
      targets_(trials_.size()),
      gradient_(model_.size()) {}

void Rl2::setModel(const Model& model) {
  checkModel(model, policies_.layout(), "the aggregator");
  // in place: Adam holds on to the memory
  std::copy(model.floats().begin(), model.floats().end(), model_.floats().begin());
}

IterationStats Rl2::iterate(std::uint64_t seed, std::uint64_t iteration) {
  IterationStats stats;
  sampler_.play(model_.floats().data(), seed, iteration, trials_, stats);
  order_.clear();
  for (std::size_t k = 0; k < trials_.size(); ++k) {
    if (trials_[k].steps > 0) order_.push_back(k);
  }
  if (order_.empty()) return stats;  // every episode broke down at its start
  makeTargets();
  Rng rng(seed, 0, Stream::kSample, iteration);
  const PpoLoss loss = learn(rng, stats.updates);

  double first = 0, last = 0;
  for (const Trial& trial : trials_) {
    first += trial.first_return / settings_.trials;
    last += trial.last_return / settings_.trials;
  }
  const double all[] = {last, first, loss.policy, loss.value, loss.entropy, loss.kl, loss.clipped};
  for (std::size_t i = 0; i < losses_.size(); ++i) losses_[i].value = all[i];
  return stats;
}

void Rl2::makeTargets() {
  const std::size_t most = largestMinibatch(settings_);
  for (std::size_t k = 0; k < order_.size(); k += most) {
    const auto from = order_.begin() + static_cast<std::ptrdiff_t>(k);
    const auto count = static_cast<std::ptrdiff_t>(std::min(most, order_.size() - k));
    minibatch_.assign(from, from + count);
    update_.evaluate(model_.floats().data(), trials_, minibatch_, targets_);
  }
  if (settings_.scale_rewards) scaleRewards();
  settings_.baseline == "linear" ? linearAdvantages() : valueAdvantages();
  normaliseAdvantages();
}

// by the deviation of the discounted return so far within a trial, these trials included
void Rl2::scaleRewards() {
  for (const std::size_t k : order_) {
    double discounted = 0;
    for (std::size_t t = 0; t < trials_[k].steps; ++t) {
      discounted = settings_.gamma * discounted + trials_[k].rewards[t];
      return_variance_.add(discounted);
    }
  }
  const double scale = 1 / std::sqrt(return_variance_.variance() + 1e-8);
  for (const std::size_t k : order_) {
    for (std::size_t t = 0; t < trials_[k].steps; ++t) {
      trials_[k].rewards[t] = static_cast<float>(scale * trials_[k].rewards[t]);
    }
  }
}

void Rl2::valueAdvantages() {
  for (const std::size_t k : order_) {
    const Trial& trial = trials_[k];
    TrialTargets& targets = targets_[k];
    targets.advantages.resize(trial.steps);
    targets.returns.resize(trial.steps);
    generalisedAdvantages(trial.rewards.data(), targets.values.data(), trial.steps, 0.0,
                          settings_.gamma, settings_.gae_lambda, targets.advantages.data());
    for (std::size_t t = 0; t < trial.steps; ++t) {
      targets.returns[t] = targets.advantages[t] + targets.values[t];
    }
  }
}

// a baseline for each task, over the steps of whole trials
void Rl2::linearAdvantages() {
  const std::size_t inputs = policies_.networks().gru().inputs();
  const std::size_t size = policies_.networks().observationSize();
  for (int task = 0; task < num_tasks_; ++task) {
    std::vector<Path> paths;
    std::vector<std::size_t> of_task;
    for (const std::size_t k : order_) {
      const Trial& trial = trials_[k];
      if (trial.task != task) continue;
      of_task.push_back(k);
      Path path;
      for (std::size_t t = 0; t < trial.steps; ++t) {
        const float* observation = &trial.inputs[t * inputs];
        path.observations.insert(path.observations.end(), observation, observation + size);
        path.rewards.push_back(trial.rewards[t]);
      }
      path.last_observation.resize(size);  // nothing is worth anything there
      paths.push_back(std::move(path));
    }
    if (paths.empty()) continue;
    LinearBaseline baseline;
    baseline.fit(paths, settings_.gamma);
    const auto all = advantages(paths, baseline, {settings_.gamma, settings_.gae_lambda});
    auto next = all.begin();
    for (const std::size_t k : of_task) {
      const auto end = next + static_cast<std::ptrdiff_t>(trials_[k].steps);
      targets_[k].advantages.assign(next, end);
      targets_[k].returns = targets_[k].values;  // the critic stays as it is
      next = end;
    }
  }
}

void Rl2::normaliseAdvantages() {
  double sum = 0, squares = 0, count = 0;
  for (const std::size_t k : order_) {
    for (const float a : targets_[k].advantages) sum += a;
    count += static_cast<double>(targets_[k].advantages.size());
  }
  const double mean = sum / count;
  for (const std::size_t k : order_) {
    for (const float a : targets_[k].advantages) squares += (a - mean) * (a - mean);
  }
  const double deviation = std::sqrt(squares / count) + 1e-5;
  for (const std::size_t k : order_) {
    for (float& a : targets_[k].advantages) a = static_cast<float>((a - mean) / deviation);
  }
}

// means over all updates
PpoLoss Rl2::learn(Rng& rng, std::int64_t& updates) {
  PpoLoss mean;
  const auto minibatches = static_cast<std::size_t>(settings_.minibatches);
  for (int epoch = 0; epoch < settings_.epochs; ++epoch) {
    for (std::size_t k = order_.size(); k > 1; --k) std::swap(order_[k - 1], order_[rng.below(k)]);
    for (std::size_t m = 0; m < minibatches; ++m) {
      const auto at = [&](std::size_t i) {
        return order_.begin() + static_cast<std::ptrdiff_t>(i * order_.size() / minibatches);
      };
      if (at(m) == at(m + 1)) continue;  // where trials broke down at once
      minibatch_.assign(at(m), at(m + 1));
      const PpoLoss loss =
          update_.gradient(model_.floats().data(), trials_, targets_, minibatch_, gradient_.data());
      move();
      ++updates;
      mean.policy += loss.policy;
      mean.value += loss.value;
      mean.entropy += loss.entropy;
      mean.kl += loss.kl;
      mean.clipped += loss.clipped;
    }
  }
  for (double* sum : {&mean.policy, &mean.value, &mean.entropy, &mean.kl, &mean.clipped}) {
    *sum /= static_cast<double>(updates);
  }
  return mean;
}

void Rl2::move() {
  const double norm =
      std::sqrt(std::inner_product(gradient_.begin(), gradient_.end(), gradient_.begin(), 0.0));
  const double factor = settings_.max_gradient_norm / (norm + 1e-6);
  if (factor < 1) {
    for (float& g : gradient_) g = static_cast<float>(factor * g);
  }
  adam_.beginUpdate();
  adam_.apply(0, gradient_.data(), gradient_.size());
}

std::unique_ptr<Adaptation> Rl2::adapt(const Model& policy, int) const {
  return std::make_unique<Rl2Adaptation>(policies_.networks(), policy.floats().data());
}

void Rl2::saveState(StateWriter& writer) const {
  writer.part("adam", adam_);
  writer.part("return_variance", return_variance_);
  writer.part("trials", sampler_);
}

void Rl2::loadState(StateReader& reader) {
  reader.part("adam", adam_);
  reader.part("return_variance", return_variance_);
  reader.part("trials", sampler_);
}

}  // namespace pmeta
