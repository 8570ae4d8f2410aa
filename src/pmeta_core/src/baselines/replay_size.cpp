#include "pmeta_core/baselines/replay_size.h"

#include <unistd.h>

#include <algorithm>

#include "pmeta_core/base/error.h"

namespace pmeta {

// all of the run, since the tasks together hold no more than that; pages that no transition has
// reached cost nothing
std::size_t replaySize(const MetaTasks& tasks, int wanted, const std::string& prefix) {
  constexpr std::int64_t kMost = 1000000;
  const EnvSpec spec = tasks.family->make(0)->spec();
  const std::int64_t total = tasks.total_steps > 0 ? tasks.total_steps : kMost;
  const std::int64_t each = wanted > 0 ? wanted : std::min(total, kMost);
  const double bytes_each = 4.0 * (2 * spec.observation_size + spec.action_size + 2);
  const auto filled = static_cast<double>(std::min(each * tasks.count(), total));
  const double memory =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  if (filled * bytes_each > memory) {
    const auto fits = static_cast<std::int64_t>(memory / 2 / bytes_each / tasks.count());
    throw Error("the replays of " + std::to_string(tasks.count()) + " tasks would come to " +
                std::to_string(static_cast<std::int64_t>(filled)) +
                " transitions, which do not fit into this machine's memory: set " + prefix +
                "buffer_size to at most " + std::to_string(fits) + " a task.");
  }
  return static_cast<std::size_t>(each);
}

}  // namespace pmeta
