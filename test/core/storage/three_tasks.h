#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/storage/round_book.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta::test {

/// Three small grids in four rounds.
inline Experiment threeTasks(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(), {"sizes:=[2, 3, 4]", "rounds:=4"});
  return gridExperiment(overrides);
}

/// Numbers that name their round, task and policy.
inline TaskReturn makeReturn(int round, int task, PolicyKind policy) {
  TaskReturn result;
  result.run_id = "run";
  result.task = task;
  result.round = round;
  result.policy = policy;
  result.mean = -100.0 * round - 10 * task - (policy == PolicyKind::kMeta ? 1 : 0);
  result.std = 0.1;
  result.episodes = 3;
  if (policy == PolicyKind::kPersonal) {
    result.env_steps = 1000 * round + task;
    result.updates = 3;
  }
  return result;
}

/// The rows as rounds.csv has them.
inline std::string csvOf(const std::vector<RoundBook::Round>& rounds) {
  std::string text;
  for (const auto& round : rounds) {
    for (const RoundRow& row : round.rows) text += RunLog::csvLine(row) + "\n";
  }
  return text;
}

/// All that is due of a round.
inline void addAll(RoundBook& book, int round) {
  for (int task = 0; task < 3; ++task) {
    EXPECT_TRUE(book.add(makeReturn(round, task, PolicyKind::kPersonal)));
    EXPECT_TRUE(book.add(makeReturn(round, task, PolicyKind::kMeta)));
  }
}

}  // namespace pmeta::test
