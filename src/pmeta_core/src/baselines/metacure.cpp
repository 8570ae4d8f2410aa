#include "pmeta_core/baselines/metacure.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "pmeta_core/baselines/for_each_task.h"
#include "pmeta_core/baselines/plain_adam.h"
#include "pmeta_core/baselines/replay_size.h"

namespace pmeta {
namespace {

EnvSpec specOf(const MetaTasks& tasks) { return tasks.family->make(0)->spec(); }

/// Moves parameters that do not begin at 0.
class Shifted : public Optimizer<float> {
 public:
  Shifted(Optimizer<float>& all, std::size_t begin) : all_(all), begin_(begin) {}

 private:
  void move(std::size_t offset, const float* gradient, std::size_t n, float* target,
            double tau) override {
    all_.apply(begin_ + offset, gradient, n, target, tau);
  }

  Optimizer<float>& all_;
  std::size_t begin_;
};

}  // namespace

MetaCure::MetaCure(const MetaTasks& tasks, const MetaCureSettings& settings)
    : settings_(settings),
      threads_(tasks.threads),
      policies_(specOf(tasks), settings),
      model_(policies_.layout()),
      adam_(model_.floats().data(), nullptr, model_.size(), plainAdam(settings.learning_rate)),
      exploiter_(networks().exploiter(), exploiterSettings(settings), {}),
      explorer_(networks().explorer(), explorerSettings(settings), {}),
      beliefs_(networks().encoder(), static_cast<std::size_t>(settings.meta_batch),
               static_cast<std::size_t>(settings.trial_episodes * specOf(tasks).horizon)),
      gain_(specOf(tasks), tasks.count(), settings),
      losses_{{"critic", 0},
              {"actor", 0},
              {"entropy", 0},
              {"value", 0},
              {"kl", 0},
              {"by_belief", 0},
              {"by_task", 0},
              {"explorer_critic", 0},
              {"explorer_actor", 0},
              {"explorer_entropy", 0},
              {"gain", 0}},
      drawn_(static_cast<std::size_t>(settings.meta_batch)),
      rows_(exploiter_.batch()),
      noise_(rows_.size() * networks().encoder().latentSize()),
      z_(noise_.size()),
      encoder_gradient_(networks().encoder().size()) {
  const std::size_t buffer_size = replaySize(tasks, settings.buffer_size, "metacure.");
  for (int i = 0; i < tasks.count(); ++i) {
    tasks_.push_back(std::make_unique<MetaCureCollector>(
        tasks.family->make(i), networks(), model_.floats().data(), settings, buffer_size));
  }
}

void MetaCure::setModel(const Model& model) {
  // in place: Adam and the tasks hold on to the memory
  std::copy(model.floats().begin(), model.floats().end(), model_.floats().begin());
  if (started_) return;
  exploiter_.resetTargets(model_.floats().data());
  explorer_.resetTargets(model_.floats().data() + networks().explorerOffset());
}

IterationStats MetaCure::iterate(std::uint64_t seed, std::uint64_t iteration) {
  IterationStats stats;
  if (!started_) {
    Rng initial(seed, 0, Stream::kInitialise, 1);  // the policy's are of round 0
    gain_.initialise(initial);
  }
  const std::int64_t broken_before = brokenEpisodes();
  Rng rng(seed, 0, Stream::kSample, iteration);
  collect(seed, iteration, rng, stats);
  started_ = true;
  stats.broken_episodes = brokenEpisodes() - broken_before;

  for (Loss& loss : losses_) loss.value = 0;
  for (int u = 0; u < settings_.updates_per_iteration; ++u) updateOnce(rng);
  for (Loss& loss : losses_) loss.value /= settings_.updates_per_iteration;
  stats.updates = settings_.updates_per_iteration;
  return stats;
}

// tasks know nothing of each other here, so that those that are visited may act side by side
void MetaCure::collect(std::uint64_t seed, std::uint64_t iteration, Rng& rng,
                       IterationStats& stats) {
  std::vector<int> visits(tasks_.size());
  for (int n = 0; n < settings_.tasks_per_iteration; ++n) ++visits[rng.below(tasks_.size())];
  stats.env_steps.assign(tasks_.size(), 0);
  forEachTask(tasks_.size(), threads_, [&](std::size_t i) {
    Rng acting(seed, i, Stream::kCollect, iteration);
    std::int64_t& steps = stats.env_steps[i];
    if (!started_) steps += tasks_[i]->warmUp(settings_.warm_up_steps, acting);
    for (int n = 0; n < visits[i]; ++n) steps += tasks_[i]->visit(acting);
  });
}

void MetaCure::updateOnce(Rng& rng) {
  const float* parameters = model_.floats().data();
  drawTrials(rng);
  beliefs_.infer(parameters + networks().encoderOffset(), trials_);
  drawRows(rng);
  adam_.beginUpdate();
  const SacLosses exploiter = exploiter_.apply(parameters, adam_, rng);
  const double kl = updateEncoder();
  const InformationGain::Losses predictors = gain_.learn();
  const double gain = updateExplorer(rng);
  Shifted explorers(adam_, networks().explorerOffset());
  const SacLosses explorer =
      explorer_.apply(parameters + networks().explorerOffset(), explorers, rng);

  const double all[] = {exploiter.critic,
                        exploiter.actor,
                        exploiter.entropy,
                        exploiter.value,
                        kl,
                        predictors.by_belief,
                        predictors.by_task,
                        explorer.critic,
                        explorer.actor,
                        explorer.entropy,
                        gain};
  for (std::size_t i = 0; i < losses_.size(); ++i) losses_[i].value += all[i];
}

void MetaCure::drawTrials(Rng& rng) {
  trials_.clear();
  for (std::size_t& task : drawn_) {
    task = rng.below(tasks_.size());
    const TrialStore& trials = tasks_[task]->trials();
    trials_.push_back(trials[rng.below(trials.size())]);
  }
}

// of the exploiter and the predictors
void MetaCure::drawRows(Rng& rng) {
  const std::size_t latent = networks().encoder().latentSize();
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    const std::size_t k = row / static_cast<std::size_t>(settings_.task_batch);
    const ReplayBuffer& replay = tasks_[drawn_[k]]->replay();
    const Transition step = replay[rng.below(replay.size())];
    rows_[row] = {k, rng.below(trials_[k].steps() + 1), step};
    const float* belief = beliefs_.at(k, rows_[row].t);
    float *noise = &noise_[row * latent], *z = &z_[row * latent];
    for (std::size_t i = 0; i < latent; ++i) {
      noise[i] = static_cast<float>(rng.normal());
      z[i] = belief[i] + std::sqrt(belief[latent + i]) * noise[i];
    }
    exploiter_.put(row, step, z, z);
    gain_.put(row, step, belief, drawn_[k]);
  }
}

// by what the exploiter's critics have left; returns the mean KL
double MetaCure::updateEncoder() {
  const std::size_t latent = networks().encoder().latentSize();
  const auto kl_weight =
      static_cast<float>(settings_.kl_weight / static_cast<double>(rows_.size()));
  double kl = 0;
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    const auto [k, t, step] = rows_[row];
    const float* belief = beliefs_.at(k, t);
    addBeliefGradient(belief, latent, &noise_[row * latent],
                      &exploiter_.taskInputGradient()[row * latent], kl_weight,
                      beliefs_.gradientAt(k, t));
    kl += beliefKl(belief, latent) / static_cast<double>(rows_.size());
  }
  const std::size_t offset = networks().encoderOffset();
  beliefs_.backward(model_.floats().data() + offset, encoder_gradient_.data());
  adam_.apply(offset, encoder_gradient_.data(), encoder_gradient_.size());
  return kl;
}

// gives the explorer its rows; returns the mean gain
double MetaCure::updateExplorer(Rng& rng) {
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    rows_[row] = explorerRow(row, rng);
    const Row& r = rows_[row];
    gain_.put(row, r.step, beliefs_.at(r.trial, r.t), drawn_[r.trial]);
  }
  const std::vector<float>& gains = gain_.gains();
  double mean = 0;
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    const auto [k, t, step] = rows_[row];
    const std::size_t next = std::min(t + 1, trials_[k].steps());
    Transition transition = step;
    transition.reward += static_cast<float>(settings_.gain_weight) * gains[row];
    if (settings_.pairing == "trial") transition.next_observation = trials_[k].place(next);
    explorer_.put(row, transition, beliefs_.at(k, t), beliefs_.at(k, next));
    mean += gains[row] / static_cast<double>(rows_.size());
  }
  return mean;
}

MetaCure::Row MetaCure::explorerRow(std::size_t row, Rng& rng) const {
  const std::size_t k = rows_[row].trial;
  const StoredTrial& trial = trials_[k];
  if (settings_.pairing == "released") {
    const ReplayBuffer& replay = tasks_[drawn_[k]]->replay();
    const Transition step = replay[rng.below(replay.size())];
    return {k, rng.below(trial.steps() + 1), step};
  }
  const std::size_t t = rng.below(trial.steps());
  const TrialStep step = trial[t];
  const float discount = t + 1 == trial.steps() ? 0 : static_cast<float>(settings_.sac.gamma);
  return {k, t, {step.observation, step.action, step.reward, discount, step.next_observation}};
}

std::int64_t MetaCure::brokenEpisodes() const {
  std::int64_t count = 0;
  for (const auto& task : tasks_) count += task->brokenEpisodes();
  return count;
}

std::unique_ptr<Adaptation> MetaCure::adapt(const Model& policy, int) const {
  return std::make_unique<MetaCureAdaptation>(networks(), policy.floats().data());
}

void MetaCure::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.part("adam", adam_);
  writer.part("exploiter", exploiter_);
  writer.part("explorer", explorer_);
  writer.part("gain", gain_);
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    writer.part("task_" + std::to_string(i), *tasks_[i]);
  }
}

void MetaCure::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  reader.part("adam", adam_);
  reader.part("exploiter", exploiter_);
  reader.part("explorer", explorer_);
  reader.part("gain", gain_);
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    const std::string name = "task_" + std::to_string(i);
    reader.part(name, *tasks_[i]);
    if (started_ && (tasks_[i]->replay().size() == 0 || tasks_[i]->trials().size() == 0)) {
      reader.refuse(name, "has no transitions after the start");
    }
  }
}

}  // namespace pmeta
