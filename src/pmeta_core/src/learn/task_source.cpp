#include "pmeta_core/learn/task_source.h"

#include <algorithm>
#include <utility>

namespace pmeta {

InferredTasks::InferredTasks(const SacNetworks& networks, const ContextSettings& settings,
                             ContextStore& store)
    : networks_(networks),
      settings_(settings),
      store_(store),
      task_(networks.encoder(), settings) {}

bool InferredTasks::begin(std::optional<std::int64_t> episode, const float* parameters, Rng& rng,
                          std::vector<float>& task_input) {
  // while no step has become context there is nothing else to draw from
  if (!episode || store_.kept().size() == 0 || *episode % settings_.prior_interval == 0) {
    for (float& z : task_input) z = static_cast<float>(rng.normal());
    return true;
  }
  store_.draw(parameters + networks_.encoderOffset(), rng, task_);
  task_input = task_.z;
  return false;
}

bool InferredTasks::observe(const Transition& judged, bool explores) {
  if (explores || settings_.posterior_episodes) store_.add(judged);
  return true;
}

OwnOrDrawnTask::OwnOrDrawnTask(std::vector<float> own, const TaskModelSettings& settings,
                               ReplayBuffer& kept)
    : own_(std::move(own)),
      interval_(settings.exploring_interval),
      explored_to_replay_(settings.explored_to_replay),
      kept_(kept) {}

bool OwnOrDrawnTask::begin(std::optional<std::int64_t> episode, const float*, Rng& rng,
                           std::vector<float>& task_input) {
  const bool explores = episode && interval_ > 0 && (*episode + 1) % interval_ == 0;
  if (!explores) {
    task_input = own_;
    return false;
  }
  std::fill(task_input.begin(), task_input.end(), 0.0f);
  task_input[rng.below(task_input.size())] = 1;
  return true;
}

bool OwnOrDrawnTask::observe(const Transition& judged, bool explores) {
  kept_.add(judged);
  return !explores || explored_to_replay_;
}

}  // namespace pmeta
