#include <algorithm>
#include <charconv>
#include <filesystem>
#include <limits>

#include "pmeta_core/base/error.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta {
namespace {

constexpr char kRound[] = ".round_";
constexpr char kSuffix[] = ".h5";

}  // namespace

CheckpointFolder::CheckpointFolder(const Experiment& experiment, int task,
                                   const ModelLayout& layout)
    : dir_(experiment.runDir() + "/checkpoint"),
      name_(task == kAggregator ? "aggregator" : "task_" + std::to_string(task)) {
  identity_.run_id = experiment.settings().run_id;
  identity_.task = task;
  identity_.layout = layout.text();
  identity_.settings = experiment.definingSettings();
}

std::string CheckpointFolder::path(int round) const {
  return dir_ + "/" + name_ + kRound + std::to_string(round) + kSuffix;
}

void CheckpointFolder::write(int round, const std::function<void(StateWriter&)>& save) const {
  std::error_code error;
  std::filesystem::create_directories(dir_, error);
  if (error) {
    throw Error("the checkpoint folder " + dir_ + " cannot be made (" + error.message() +
                "): choose another results_dir.");
  }
  CheckpointIdentity identity = identity_;
  identity.round = round;
  writeCheckpoint(path(round), identity, save);

  // what is newer is of a past from which the run has gone back
  const std::vector<int> all = rounds();
  const auto saved = std::find(all.begin(), all.end(), round);
  for (auto other = all.begin(); other != all.end(); ++other) {
    const bool kept = other == saved || (saved != all.end() && other + 1 == saved);
    if (!kept) std::filesystem::remove(path(*other), error);
  }
}

std::vector<int> CheckpointFolder::rounds() const {
  const std::string prefix = name_ + kRound;
  const std::string suffix = kSuffix;
  std::vector<int> rounds;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(dir_, error)) {
    const std::string name = entry.path().filename().string();
    if (name.size() <= prefix.size() + suffix.size() || name.rfind(prefix, 0) != 0) continue;
    int round = 0;
    const char* end = name.data() + name.size() - suffix.size();
    const auto result = std::from_chars(name.data() + prefix.size(), end, round);
    if (result.ec != std::errc() || result.ptr != end || end != suffix || round < 1) continue;
    rounds.push_back(round);
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds;
}

int CheckpointFolder::newest(int at_most, std::vector<std::string>& refused) const {
  const std::vector<int> all = rounds();
  for (auto round = all.rbegin(); round != all.rend(); ++round) {
    if (*round > at_most) continue;
    try {
      CheckpointFile file(path(*round));
      file.require(identity_);
      return *round;
    } catch (const Error& error) {
      if (std::find(refused.begin(), refused.end(), error.what()) == refused.end()) {
        refused.push_back(error.what());
      }
    }
  }
  return 0;
}

void CheckpointFolder::read(int round, const std::function<void(StateReader&)>& load) const {
  CheckpointFile file(path(round));
  file.require(identity_);
  if (file.identity().round != round) {
    throw Error("the checkpoint " + path(round) + " cannot be used: it is of round " +
                std::to_string(file.identity().round) + ".");
  }
  file.load(load);
}

int newestCommonRound(const std::vector<CheckpointFolder>& folders,
                      std::vector<std::string>& refused, int at_most) {
  // whoever has less sets the others back
  int common = folders.empty() ? 0 : at_most;
  for (int before = 0; common != before;) {
    before = common;
    for (const CheckpointFolder& folder : folders) common = folder.newest(common, refused);
  }
  return common;
}

}  // namespace pmeta
