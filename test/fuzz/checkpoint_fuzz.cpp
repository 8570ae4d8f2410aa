#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <sstream>
#include <vector>

#include "../core/memory_state.h"
#include "../core/storage/checkpoint_experiments.h"
#include "fuzz_support.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/run/task_agent.h"
#include "pmeta_core/storage/checkpoint.h"
#include "targets.h"

namespace pmeta::fuzz {
namespace {

using test::MemoryState;

/// A run of a small experiment after two rounds, as the aggregator and task 0 would save it.
struct SavedRun {
  explicit SavedRun(const std::string& kind)
      : experiment(test::checkpointExperiment(kind, "/tmp/pmeta_unused")) {
    MetaAggregator aggregator(experiment);
    std::deque<TaskAgent> agents;
    for (int task = 0; task < experiment.numTasks(); ++task) agents.emplace_back(experiment, task);
    for (int round = 0; round < 2; ++round) {
      for (TaskAgent& agent : agents) {
        const auto result = agent.trainRound(aggregator.metaPolicy());
        aggregator.offer(std::make_shared<AuxiliaryUpdate>(result->update));
      }
      aggregator.closeRound();
    }
    meta = aggregator.metaPolicy();
    agent_state = test::stateOf(agents.front());
    aggregator_state = test::stateOf(aggregator);
  }

  Experiment experiment;
  MetaPolicy meta;
  MemoryState agent_state, aggregator_state;
};

const SavedRun& savedRun(const std::string& kind) {
  static std::map<std::string, SavedRun> runs;
  const auto found = runs.find(kind);
  return found != runs.end() ? found->second : runs.emplace(kind, SavedRun(kind)).first->second;
}

template <class Number>
void put(MemoryState::Array& array, std::size_t at, Number value) {
  if (at < array.bytes.size() / sizeof value) {
    std::memcpy(&array.bytes[at * sizeof value], &value, sizeof value);
  }
}

void setNumber(MemoryState::Array& array, std::size_t at, const std::string& text) {
  const double number = std::strtod(text.c_str(), nullptr);
  const auto whole = static_cast<std::uint64_t>(std::strtoll(text.c_str(), nullptr, 10));
  switch (array.type) {
    case StateType::kFloat32:
      return put(array, at, std::strtof(text.c_str(), nullptr));
    case StateType::kFloat64:
      return put(array, at, number);
    case StateType::kInt64:
    case StateType::kUint64:
      return put(array, at, whole);
    default:
      return put(array, at, static_cast<std::uint8_t>(whole));
  }
}

// lines "drop NAME", "size NAME VALUES" and "set NAME INDEX NUMBER"
void edit(MemoryState& state, const std::string& line) {
  constexpr std::size_t kMost = 1 << 16;
  std::istringstream words(line);
  std::string what, name, number;
  std::size_t n = 0;
  words >> what >> name >> n >> number;
  const auto array = state.arrays.find(name);
  if (array == state.arrays.end()) return;
  if (what == "drop") state.arrays.erase(array);
  if (what == "size") array->second.bytes.resize(std::min(n, kMost) * byteSize(array->second.type));
  if (what == "set") setNumber(array->second, n, number);
}

// what loads must also be able to go on
void goOnAsAgent(const SavedRun& run, const MemoryState& state) {
  TaskAgent agent(run.experiment, 0);
  test::load(agent, state);
  agent.evaluateMeta(run.meta);
  agent.trainRound(run.meta);
  test::stateOf(agent);
}

void goOnAsAggregator(const SavedRun& run, const MemoryState& state) {
  MetaAggregator aggregator(run.experiment);
  test::load(aggregator, state);
  AuxiliaryUpdate update = {
      run.experiment.settings().run_id, 0, aggregator.metaPolicy().round + 1, run.meta.model, 1,
      run.experiment.settingsHash()};
  const auto answer = aggregator.offer(std::make_shared<AuxiliaryUpdate>(update));
  if (answer.verdict == MetaAggregator::Verdict::kAccepted) aggregator.closeRound();
  test::stateOf(aggregator);
}

}  // namespace

// either "file", then a file, which has no right to its hash unless it is whole; or "agent KIND" or
// "aggregator KIND", then changes to the arrays of a state, as if they had come with a right hash.
// HDF5 itself is not the target: the hash is there so that it reads no file that was damaged.
void fuzzCheckpoint(const std::uint8_t* data, std::size_t size) {
  std::string rest = textOf(data, size);
  std::istringstream words(cutBefore(rest, "\n"));
  std::string what, kind;
  words >> what >> kind;
  try {
    if (what == "file") {
      const MemoryFile file(rest);
      const CheckpointFile checkpoint(file.path());
      return;
    }
    const auto& kinds = test::checkpointKinds();
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) return;
    const SavedRun& run = savedRun(kind);
    MemoryState state = what == "agent" ? run.agent_state : run.aggregator_state;
    while (!rest.empty()) edit(state, cutBefore(rest, "\n"));
    what == "agent" ? goOnAsAgent(run, state) : goOnAsAggregator(run, state);
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
