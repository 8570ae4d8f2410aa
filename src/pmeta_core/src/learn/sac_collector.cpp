#include "pmeta_core/learn/sac_collector.h"

#include <algorithm>
#include <utility>

namespace pmeta {

SacCollector::SacCollector(std::unique_ptr<Env> env, const SacNetworks& networks,
                           const SacSettings& settings, std::vector<float> task_input,
                           TaskSource* source)
    : networks_(networks),
      settings_(settings),
      source_(source),
      rollout_(makeEnvs([&](int) { return std::move(env); }, 1), Rollout::AtEnd::kBeginAnother,
               BrokenEpisodes::kForgiven),
      replay_(static_cast<std::size_t>(settings.buffer_size),
              static_cast<int>(networks.observationSize()),
              static_cast<int>(networks.actionSize())),
      acting_(networks.actor(), std::move(task_input), 1, GaussianActor::By::kSample),
      action_(networks.actionSize()) {}

std::int64_t SacCollector::collect(const float* parameters, Rng& rng, const float* explorer) {
  parameters_ = parameters;
  explorer_ = explorer;
  std::int64_t transitions = 0;
  const auto step = [&](int steps, bool random) {
    random_ = random;
    for (int t = 0; t < steps; ++t) transitions += rollout_.step(*this, rng);
  };
  if (!started_) {
    started_ = random_ = true;
    rollout_.begin(1, *this, rng);
    step(settings_.warm_up_steps, true);
  }
  step(settings_.env_steps_per_update, false);
  // an update needs one, and each step so far may have broken its episode
  while (replay_.size() == 0) step(1, true);
  return transitions;
}

void SacCollector::begin(std::size_t, Rng& rng) {
  if (source_ == nullptr) return;
  std::optional<std::int64_t> episode;
  if (!random_) episode = episodes_++;
  explores_ = source_->begin(episode, parameters_, rng, acting_.taskInput());
}

void SacCollector::look(const float* observations, const std::vector<std::size_t>& envs) {
  if (random_) return;
  acting_.use(explores_ && explorer_ != nullptr ? explorer_ : parameters_);
  acting_.look(observations, envs);
}

bool SacCollector::act(std::size_t row, Rng& rng, double* action) {
  if (!random_) return acting_.act(row, rng, action);
  for (std::size_t j = 0; j < action_.size(); ++j) {
    action[j] = static_cast<float>(2 * rng.uniform() - 1);
  }
  return true;
}

void SacCollector::observe(const Experience& e) {
  std::copy_n(e.action, action_.size(), action_.begin());
  Transition transition{e.observation, action_.data(), static_cast<float>(e.step.evaluatedReward()),
                        e.step.terminated ? 0.0f : static_cast<float>(settings_.gamma),
                        e.next_observation};
  if (source_ != nullptr && !source_->observe(transition, explores_)) return;
  transition.reward = static_cast<float>(e.step.reward);
  replay_.add(transition);
}

void SacCollector::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.count("episodes", episodes_);
  writer.part("broken", rollout_.broken());
  writer.flag("prior_episode", explores_);
  writer.part("replay", replay_);
  if (!started_) return;
  writer.array("task_input", taskInput());
  rollout_.saveEpisodes(writer, "observation", {"env"});
}

void SacCollector::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  episodes_ = reader.count("episodes");
  reader.part("broken", rollout_.broken());
  explores_ = reader.flag("prior_episode");
  reader.part("replay", replay_);
  if (!started_) return;
  if (replay_.size() == 0) reader.refuse("replay", "is empty after the start");
  std::vector<float> task_input(taskInput().size());
  reader.array("task_input", task_input);
  if (source_ == nullptr && task_input != taskInput()) {
    reader.refuse("task_input", "is that of another task");
  }
  acting_.taskInput() = std::move(task_input);
  rollout_.loadEpisodes(reader, "observation", {"env"});
}

}  // namespace pmeta
