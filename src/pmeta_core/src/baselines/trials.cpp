#include "pmeta_core/baselines/trials.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "pmeta_core/act/rollout.h"
#include "pmeta_core/baselines/for_each_task.h"
#include "pmeta_core/baselines/rl2_actor.h"

namespace pmeta {

/// Environments of one task, and the trials that go on in them.
class TrialSampler::OneTask : private Actor {
 public:
  OneTask(std::vector<std::unique_ptr<Env>> envs, const Rl2Networks& networks, int episodes)
      : networks_(networks),
        episodes_(episodes),
        rollout_(std::move(envs), Rollout::AtEnd::kStop, BrokenEpisodes::kForgiven) {}

  /// Returns the transitions made.
  std::int64_t play(const float* parameters, const std::vector<Trial*>& trials, Rng& rng) {
    trials_ = &trials;
    Rl2Actor acting(networks_, parameters, trials.size(), Rl2Actor::By::kSample);
    acting_ = &acting;
    for (Trial* trial : trials) trial->steps = 0;
    std::int64_t transitions = 0;
    for (int episode = 0; episode < episodes_; ++episode) {
      rollout_.begin(trials.size(), *this, rng);
      while (rollout_.running()) transitions += rollout_.step(*this, rng);
      for (std::size_t i = 0; i < trials.size(); ++i) {
        trials[i]->last_return = rollout_.returned(i);
        if (episode == 0) trials[i]->first_return = trials[i]->last_return;
      }
    }
    return transitions;
  }

  const BrokenEpisodes& broken() const { return rollout_.broken(); }
  BrokenEpisodes& broken() { return rollout_.broken(); }

 private:
  void begin(std::size_t env, Rng& rng) override { acting_->begin(env, rng); }
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    acting_->look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return acting_->act(row, rng, action);
  }

  void observe(const Experience& e) override {
    Trial& trial = *(*trials_)[e.env];
    const AlignedFloats& last = acting_->memory(e.env).last;
    const std::size_t inputs = networks_.gru().inputs(), actions = networks_.actionSize();
    const std::size_t t = trial.steps++;
    trial.inputs.resize(std::max(trial.inputs.size(), trial.steps * inputs));
    trial.actions.resize(std::max(trial.actions.size(), trial.steps * actions));
    trial.rewards.resize(std::max(trial.rewards.size(), trial.steps));
    float* input =
        std::copy_n(e.observation, networks_.observationSize(), &trial.inputs[t * inputs]);
    std::copy(last.begin(), last.end(), input);
    std::copy_n(e.action, actions, &trial.actions[t * actions]);
    trial.rewards[t] = static_cast<float>(e.step.reward);
    acting_->observe(e);
  }

  const Rl2Networks& networks_;
  int episodes_;
  Rollout rollout_;
  // of the call of play()
  const std::vector<Trial*>* trials_ = nullptr;
  Rl2Actor* acting_ = nullptr;
};

TrialSampler::TrialSampler(const MetaTasks& tasks, const Rl2Networks& networks, int episodes,
                           std::size_t max_trials)
    : threads_(tasks.threads) {
  const auto count = static_cast<std::size_t>(tasks.count());
  const auto side_by_side = static_cast<int>((max_trials + count - 1) / count);
  for (int task = 0; task < tasks.count(); ++task) {
    tasks_.push_back(std::make_unique<OneTask>(
        makeEnvs([&](int) { return tasks.family->make(task); }, side_by_side), networks, episodes));
  }
}

TrialSampler::~TrialSampler() = default;

void TrialSampler::play(const float* parameters, std::uint64_t seed, std::uint64_t iteration,
                        std::vector<Trial>& trials, IterationStats& stats) {
  std::vector<std::vector<Trial*>> of_task(tasks_.size());
  const std::uint64_t first = iteration % tasks_.size() * trials.size();
  for (std::size_t k = 0; k < trials.size(); ++k) {
    const std::size_t task = (first + k) % tasks_.size();
    trials[k].task = static_cast<int>(task);
    of_task[task].push_back(&trials[k]);
  }
  stats.env_steps.resize(tasks_.size());
  std::vector<std::int64_t> broken(tasks_.size());
  forEachTask(tasks_.size(), threads_, [&](std::size_t task) {
    if (of_task[task].empty()) return;
    Rng rng(seed, task, Stream::kCollect, iteration);
    const std::int64_t before = tasks_[task]->broken().count();
    stats.env_steps[task] += tasks_[task]->play(parameters, of_task[task], rng);
    broken[task] = tasks_[task]->broken().count() - before;
  });
  stats.broken_episodes += std::accumulate(broken.begin(), broken.end(), std::int64_t{0});
}

void TrialSampler::saveState(StateWriter& writer) const {
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    writer.part("task_" + std::to_string(task), tasks_[task]->broken());
  }
}

void TrialSampler::loadState(StateReader& reader) {
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    reader.part("task_" + std::to_string(task), tasks_[task]->broken());
  }
}

}  // namespace pmeta
