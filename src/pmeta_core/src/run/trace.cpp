#include "pmeta_core/run/trace.h"

#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_core/run/finished_run.h"
#include "pmeta_core/storage/run_lock.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {
namespace {

class Table {
 public:
  void add(PolicyKind policy, Split split, int task, int context_episodes, const Episode& episode) {
    size_ = static_cast<std::size_t>(episode.observation_size);
    const std::string whose = std::string(name(policy)) + "," + name(split) + "," +
                              std::to_string(task) + "," + std::to_string(context_episodes);
    for (std::size_t step = 0; (step + 1) * size_ <= episode.observations.size(); ++step) {
      rows_ += whose + "," + std::to_string(step);
      for (std::size_t k = 0; k < size_; ++k) {
        rows_ += "," + formatNumber(episode.observations[step * size_ + k]);
      }
      rows_ += "\n";
    }
  }

  std::string text() const {
    std::string header = "policy,split,task,context_episodes,step";
    for (std::size_t k = 0; k < size_; ++k) header += ",observation_" + std::to_string(k);
    return header + "\n" + rows_;
  }

 private:
  std::size_t size_ = 0;
  std::string rows_;
};

}  // namespace

void writeTrajectories(const std::string& run_dir) {
  const FinishedRun run(run_dir, Kept::kLast);
  const Experiment& experiment = run.experiment();
  const RunLock lock(run_dir);
  Table table;
  const auto add = [&](const ShownPolicy& shown) {
    table.add(shown.result.policy, shown.result.split, shown.result.task,
              shown.result.context_episodes, shown.episode);
  };
  for (int task = 0; task < experiment.numTasks(); ++task) {
    if (const auto personal = run.personal(task)) add(*personal);
  }
  const std::vector<int> counts = experiment.contextEpisodes();
  if (counts.size() == 1) {
    for (const ShownPolicy& meta : run.meta()) add(meta);
  }
  for (std::size_t i = 1; i < counts.size(); ++i) {
    const FinishedRun after(run_dir, Kept::kLast,
                            {"exploration_episodes:=[" + std::to_string(counts[i]) + "]"});
    for (const ShownPolicy& meta : after.meta()) add(meta);
  }
  writeFileAtomically(run_dir + "/trajectories.csv", table.text());
}

}  // namespace pmeta
