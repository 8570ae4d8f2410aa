#include "env_simulator.h"

#include <algorithm>
#include <utility>

#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"

namespace pmeta {

std::vector<std::string> concatenated(std::initializer_list<std::vector<std::string>> lists) {
  std::vector<std::string> names;
  for (const auto& list : lists) names.insert(names.end(), list.begin(), list.end());
  return names;
}

std::vector<std::string> numbered(const std::string& name, int count) {
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) names.push_back(name + "_" + std::to_string(i));
  return names;
}

EnvSimulator::EnvSimulator(std::vector<std::unique_ptr<Env>> environments, Recording recording)
    : environments_(std::move(environments)), recording_(std::move(recording)) {
  const EnvSpec& spec = environments_.front()->spec();
  observation_.resize(static_cast<std::size_t>(spec.observation_size));
  columns_.has_task = recording_.has_task;
  columns_.num_actions = spec.num_actions;
  columns_.inputs = recording_.inputs;
  columns_.state = recording_.state;
  columns_.compared =
      concatenated({recording_.state,
                    numbered("obs", recording_.has_observation ? spec.observation_size : 0),
                    recording_.measures,
                    {"done"}});
}

void EnvSimulator::start(int task, const double* state, bool ended) {
  env_ = environments_.at(task).get();
  std::vector<double> full(state, state + columns_.state.size());
  if (recording_.knows_end) full.push_back(ended ? 1 : 0);
  full.push_back(0);  // time limits are not recorded: count no steps
  env_->setState(full);
}

void EnvSimulator::step(const double* inputs, double* compared) {
  const Step step = env_->step(inputs, rng_, observation_.data());
  compared = std::copy_n(env_->state().begin(), columns_.state.size(), compared);
  if (recording_.has_observation) {
    compared = std::copy(observation_.begin(), observation_.end(), compared);
  }
  recording_.measure(*env_, step, inputs, compared);
  compared[recording_.measures.size()] = step.terminated ? 1 : 0;
}

std::vector<std::vector<double>> readTasks(const std::string& path,
                                           const std::vector<std::string>& columns,
                                           const Range& range) {
  const CsvTable table = CsvTable::load(path);
  const std::size_t task_column = table.column("task");
  std::vector<std::vector<double>> tasks(table.numRows());
  for (std::size_t row = 0; row < tasks.size(); ++row) {
    if (table.wholeNumber(row, task_column) != static_cast<int>(row)) {
      table.refuse(row, task_column, std::to_string(row) + ": tasks count from 0");
    }
    for (const std::string& name : columns) {
      tasks[row].push_back(table.number(row, table.column(name), range));
    }
  }
  if (tasks.empty()) throw Error(path + " holds no tasks, only a header.");
  return tasks;
}

void requireTasksFile(const std::string& kind, const std::string& tasks_file,
                      const std::string& example) {
  if (!tasks_file.empty()) return;
  throw Error("trajectories of " + kind +
              " need the file of their tasks: give --tasks FILE, e.g. " + example + ".");
}

}  // namespace pmeta
