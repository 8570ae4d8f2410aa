#include "pmeta_core/messages/protocol.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <sstream>

#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

constexpr std::int64_t kMostRounds = std::numeric_limits<int>::max() - 1;

constexpr std::size_t kMostTasks = 1000000;

std::vector<std::int64_t> tasksOf(const std::vector<int>& tasks) {
  return {tasks.begin(), tasks.end()};
}

// ascending task numbers
std::vector<int> readTasks(StateReader& reader, const std::string& name) {
  std::vector<std::int64_t> tasks(reader.size<std::int64_t>(name, kMostTasks));
  reader.array(name, tasks);
  const bool ascending = std::adjacent_find(tasks.begin(), tasks.end(),
                                            std::greater_equal<std::int64_t>()) == tasks.end();
  if (!tasks.empty() && (!ascending || tasks.front() < 0 || tasks.back() > kMostRounds)) {
    reader.refuse(name, "must be ascending task numbers");
  }
  return {tasks.begin(), tasks.end()};
}

}  // namespace

void saveLosses(StateWriter& writer, const std::vector<Loss>& losses) {
  std::string names;
  std::vector<double> values;
  for (const Loss& loss : losses) {
    names += loss.name + "\n";
    values.push_back(loss.value);
  }
  writer.text("loss_names", names);
  writer.array("losses", values);
}

std::vector<Loss> readLosses(StateReader& reader) {
  std::vector<double> values(reader.size<double>("losses", kMostLosses));
  reader.array("losses", values);
  const std::string text = reader.text("loss_names", kMostLosses * (kLongestLossName + 1));
  std::istringstream names(text);
  std::vector<Loss> losses;
  for (std::string name; std::getline(names, name);) losses.push_back({name, 0});
  if (losses.size() != values.size() || (!text.empty() && text.back() != '\n')) {
    reader.refuse("loss_names", "does not name " + std::to_string(values.size()) + " losses");
  }
  for (std::size_t i = 0; i < losses.size(); ++i) losses[i].value = values[i];
  return losses;
}

const char* name(PolicyKind policy) {
  return policy == PolicyKind::kPersonal ? "personal" : "meta";
}
const char* name(Split split) { return split == Split::kTrain ? "train" : "test"; }

std::string otherSettings(const std::string& who, const std::string& theirs,
                          const std::string& ours) {
  return who + " has other settings, of hash " + shown(theirs) + " where this party's is " +
         shown(ours) +
         ": start both with the same settings file and overrides, those of the run folder's "
         "config.yaml.";
}

void TaskReturn::saveState(StateWriter& writer) const {
  const std::vector<std::int64_t> counts = {task,
                                            round,
                                            split == Split::kTest,
                                            policy == PolicyKind::kMeta,
                                            context_episodes,
                                            episodes,
                                            env_steps,
                                            updates,
                                            scheduled,
                                            broken_episodes};
  const std::vector<double> numbers = {mean, std, seconds};
  writer.array("counts", counts);
  writer.array("numbers", numbers);
  saveLosses(writer, losses);
}

void TaskReturn::loadState(StateReader& reader) {
  std::vector<std::int64_t> counts(10);
  std::vector<double> numbers(3);
  reader.counts("counts", counts);
  reader.array("numbers", numbers);
  const auto most = [&](std::size_t first) { return std::max(counts[first], counts[first + 1]); };
  if (most(0) > kMostRounds || most(2) > 1 || most(4) > kMostRounds) {
    reader.refuse("counts", "holds a number out of its range");
  }
  task = static_cast<int>(counts[0]);
  round = static_cast<int>(counts[1]);
  split = counts[2] == 0 ? Split::kTrain : Split::kTest;
  policy = counts[3] == 0 ? PolicyKind::kPersonal : PolicyKind::kMeta;
  context_episodes = static_cast<int>(counts[4]);
  episodes = static_cast<int>(counts[5]);
  env_steps = counts[6];
  updates = counts[7];
  scheduled = counts[8] != 0;
  broken_episodes = counts[9];
  losses = readLosses(reader);
  mean = numbers[0];
  std = numbers[1];
  seconds = numbers[2];
}

void RoundSummary::saveState(StateWriter& writer) const {
  writer.count("round", round);
  writer.array("participants", tasksOf(participants));
  writer.array("missing", tasksOf(missing));
  writer.array("excluded", tasksOf(excluded));
  writer.value("seconds", seconds);
}

void RoundSummary::loadState(StateReader& reader) {
  round = static_cast<int>(reader.count("round", 0, kMostRounds));
  participants = readTasks(reader, "participants");
  missing = readTasks(reader, "missing");
  excluded = readTasks(reader, "excluded");
  seconds = reader.value<double>("seconds");
}

}  // namespace pmeta
