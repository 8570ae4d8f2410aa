#include "pmeta_core/learn/task_model.h"

#include <algorithm>
#include <cmath>

namespace pmeta {
namespace {

// changes are small beside the numbers that change
constexpr float kChange = 20;

float symlog(float x) { return std::copysign(std::log1p(std::abs(x)), x); }

MlpSpec modelNetwork(std::size_t observation_size, std::size_t action_size, std::size_t task_inputs,
                     const TaskModelSettings& settings, bool portable) {
  const std::size_t inputs = observation_size * (settings.dynamics ? 1 : 2) + action_size;
  return mlpSpec("task_model", inputs + task_inputs, settings.hidden,
                 1 + (settings.dynamics ? observation_size : 0), portable);
}

}  // namespace

void bind(Settings& s, const std::string& prefix, TaskModelSettings& d) {
  s.bind(prefix + "hidden", d.hidden, "units of each hidden layer of the task model",
         Range::between(1, 65536));
  s.bind(prefix + "dynamics", d.dynamics,
         "it predicts next observations, too; for tasks that differ in dynamics");
  s.bind(prefix + "buffer_size", d.buffer_size, "recent transitions that it learns from",
         Range::between(1, 1e9));
  s.bind(prefix + "exploring_interval", d.exploring_interval,
         "every how-many-th training episode acts as on a task drawn from all, by the actor that "
         "context_explorer names; 0: none does",
         Range::between(0, 1e6));
  s.bind(prefix + "explored_to_replay", d.explored_to_replay,
         "actor and critics learn from these episodes, too");
  s.bind(prefix + "kappa", d.kappa,
         "weight of a transition's likelihood at test time: consecutive ones are not independent",
         Range::above(0));
  s.bind(prefix + "least_variance", d.least_variance,
         "of the error of a prediction at test time, in squares of the reward's unit",
         Range::above(0));
  s.bind(prefix + "hypotheses", d.hypotheses,
         "what an explored task may be: vertices (one of those trained on) or mixtures (also in "
         "between two of them)",
         {"vertices", "mixtures"});
}

TaskModel::TaskModel(int observation_size, int action_size, std::size_t task_inputs,
                     const TaskModelSettings& settings, bool portable)
    : observation_size_(static_cast<std::size_t>(observation_size)),
      action_size_(static_cast<std::size_t>(action_size)),
      task_inputs_(task_inputs),
      dynamics_(settings.dynamics),
      network_(modelNetwork(observation_size_, action_size_, task_inputs, settings, portable)) {}

std::vector<Block> TaskModel::blocks() const {
  std::vector<Block> all = network_.blocks();
  all.push_back({"task_model.log_variance", {outputs()}});
  return all;
}

void TaskModel::initialise(float* parameters, Rng& rng) const {
  network_.initialise(parameters, rng);
  std::fill_n(parameters + network_.size(), outputs(), 0.0f);
}

void TaskModel::write(const Transition& t, float* row, float* outcome) const {
  row = std::transform(t.observation, t.observation + observation_size_, row, symlog);
  row = std::copy_n(t.action, action_size_, row);
  *outcome++ = t.reward;
  float* changes = dynamics_ ? outcome : row;
  for (std::size_t k = 0; k < observation_size_; ++k) {
    changes[k] = symlog(kChange * (t.next_observation[k] - t.observation[k]));
  }
}

}  // namespace pmeta
