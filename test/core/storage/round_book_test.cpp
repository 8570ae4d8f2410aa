#include "pmeta_core/storage/round_book.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "../support.h"
#include "pmeta_core/storage/run_log.h"
#include "three_tasks.h"

namespace pmeta {
namespace {

using test::addAll;
using test::csvOf;
using test::errorOf;
using test::makeReturn;
using test::threeTasks;
using Tasks = std::vector<int>;

TEST(RoundBook, GivesRowsByPolicyThenTaskWithCountersSummedOverRounds) {
  RoundBook book(threeTasks());
  addAll(book, 1);
  book.closeRound(1, {0, 1, 2}, {}, 2);
  addAll(book, 2);
  book.closeRound(2, {0, 1, 2}, {}, 4);
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 2u);
  EXPECT_EQ(csvOf(rounds),
            "1,0,train,personal,0,-100,0.1,3,1000,3,0.000000\n"
            "1,1,train,personal,0,-110,0.1,3,1001,3,0.000000\n"
            "1,2,train,personal,0,-120,0.1,3,1002,3,0.000000\n"
            "1,0,train,meta,0,-101,0.1,3,1000,3,0.000000\n"
            "1,1,train,meta,0,-111,0.1,3,1001,3,0.000000\n"
            "1,2,train,meta,0,-121,0.1,3,1002,3,0.000000\n"
            "2,0,train,personal,0,-200,0.1,3,3000,6,0.000000\n"
            "2,1,train,personal,0,-210,0.1,3,3002,6,0.000000\n"
            "2,2,train,personal,0,-220,0.1,3,3004,6,0.000000\n"
            "2,0,train,meta,0,-201,0.1,3,3000,6,0.000000\n"
            "2,1,train,meta,0,-211,0.1,3,3002,6,0.000000\n"
            "2,2,train,meta,0,-221,0.1,3,3004,6,0.000000\n");

  const RoundSummary& summary = rounds[1].summary;
  EXPECT_EQ(summary.run_id, "run");
  EXPECT_EQ(summary.round, 2);
  EXPECT_EQ(summary.rounds, 4);
  EXPECT_EQ(summary.personal_return, -210);
  EXPECT_EQ(summary.meta_return, -211);
  EXPECT_EQ(summary.participants, (Tasks{0, 1, 2}));
  EXPECT_EQ(summary.seconds, 4);
  EXPECT_EQ(rounds[0].summary.eta_seconds, 3 * 2);
  EXPECT_EQ(summary.eta_seconds, 2 * 3) << "two rounds left at three seconds each";
  EXPECT_EQ(book.roundsTaken(), 2);
}

// returns and closings of all rounds as events in any order; closings keep theirs
TEST(RoundBook, RecordDoesNotDependOnArrivalOrder) {
  const Experiment experiment = threeTasks();
  std::string expected;
  std::mt19937 random(1);
  for (int attempt = 0; attempt < 200; ++attempt) {
    struct Event {
      bool close;
      int round, task;
      PolicyKind policy;
    };
    std::vector<Event> events;
    for (int round = 1; round <= 4; ++round) {
      events.push_back({true, round, 0, PolicyKind::kMeta});
      for (int task = 0; task < 3; ++task) {
        events.push_back({false, round, task, PolicyKind::kPersonal});
        events.push_back({false, round, task, PolicyKind::kMeta});
      }
    }
    if (attempt > 0) std::shuffle(events.begin(), events.end(), random);

    RoundBook book(experiment);
    std::string record;
    std::vector<RoundSummary> summaries;
    int closed = 0;
    for (const Event& event : events) {
      if (event.close) {
        ++closed;
        book.closeRound(closed, {0, 1, 2}, {}, 1);
      } else {
        EXPECT_TRUE(book.add(makeReturn(event.round, event.task, event.policy)));
      }
      if (attempt % 2 == 0) continue;
      const auto rounds = book.take();
      record += csvOf(rounds);
      for (const auto& round : rounds) summaries.push_back(round.summary);
    }
    const auto rest = book.take();
    record += csvOf(rest);
    for (const auto& round : rest) summaries.push_back(round.summary);
    if (attempt == 0) expected = record;
    ASSERT_EQ(std::count(record.begin(), record.end(), '\n'), 24);
    ASSERT_EQ(record, expected);
    ASSERT_EQ(summaries.size(), 4u);
    EXPECT_EQ(summaries[3].personal_return, -410);
  }
}

TEST(RoundBook, TakesNoReturnOutsideTheSchedule) {
  RoundBook book(threeTasks());
  TaskReturn asked = makeReturn(1, 0, PolicyKind::kMeta);
  asked.scheduled = false;
  EXPECT_FALSE(book.add(asked));
  asked.scheduled = true;
  EXPECT_TRUE(book.add(asked)) << "nothing stood in its place";
}

TEST(RoundBook, WaitsForTheClosingAndForEveryReturn) {
  RoundBook book(threeTasks());
  addAll(book, 1);
  EXPECT_TRUE(book.take().empty()) << "not closed";
  EXPECT_TRUE(book.take(true).empty()) << "not closed, even by force";
  book.closeRound(1, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 1u);

  book.closeRound(2, {0, 1, 2}, {}, 1);
  for (int task = 0; task < 3; ++task) book.add(makeReturn(2, task, PolicyKind::kPersonal));
  book.add(makeReturn(2, 0, PolicyKind::kMeta));
  EXPECT_TRUE(book.take().empty());
  EXPECT_EQ(book.awaited(), (Tasks{1, 2}));
  book.add(makeReturn(2, 2, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{1});
  book.add(makeReturn(2, 1, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_EQ(book.take().size(), 1u);
}

TEST(RoundBook, LaterRoundsWaitForEarlierOnes) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 1, 2}, {}, 1);
  addAll(book, 2);
  book.closeRound(2, {0, 1, 2}, {}, 1);
  EXPECT_TRUE(book.take().empty());
  addAll(book, 1);
  EXPECT_EQ(book.take().size(), 2u);
}

TEST(RoundBook, RefusesDuplicatesAndStrangers) {
  RoundBook book(threeTasks());
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  TaskReturn again = makeReturn(1, 0, PolicyKind::kPersonal);
  again.mean = 7;
  EXPECT_FALSE(book.add(again));
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kMeta))) << "another policy is no duplicate";

  for (const auto& [round, task] :
       std::vector<std::pair<int, int>>{{1, -1}, {1, 3}, {0, 1}, {-1, 1}, {5, 1}}) {
    EXPECT_FALSE(book.add(makeReturn(round, task, PolicyKind::kPersonal))) << round << " " << task;
  }
  TaskReturn other = makeReturn(1, 1, PolicyKind::kPersonal);
  other.run_id = "other";
  EXPECT_FALSE(book.add(other));

  book.closeRound(1, {0, 1, 2}, {}, 1);
  for (int task = 1; task < 3; ++task) {
    book.add(makeReturn(1, task, PolicyKind::kPersonal));
    book.add(makeReturn(1, task, PolicyKind::kMeta));
  }
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows[0].result.mean, -100) << "the first one counts";
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal))) << "given out already";
}

TEST(RoundBook, DoesWithoutThePersonalReturnOfAMissingTask) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {1}, 1);
  for (const int task : {0, 2}) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  for (const int task : {0, 1}) book.add(makeReturn(1, task, PolicyKind::kMeta));
  EXPECT_EQ(book.awaited(), Tasks{2}) << "task 1's meta return is in, its personal one not due";
  EXPECT_TRUE(book.take().empty());
  book.add(makeReturn(1, 2, PolicyKind::kMeta));
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].summary.missing, Tasks{1});
  EXPECT_EQ(rounds[0].summary.personal_return, -110);
  EXPECT_EQ(rounds[0].summary.meta_return, -111);
  EXPECT_EQ(rounds[0].rows.size(), 5u);
}

TEST(RoundBook, WaitsForThePersonalReturnOfAnExcludedTask) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {}, 1, {1});
  for (int task = 0; task < 3; ++task) book.add(makeReturn(1, task, PolicyKind::kMeta));
  for (const int task : {0, 2}) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  EXPECT_EQ(book.awaited(), Tasks{1});
  EXPECT_TRUE(book.take().empty());
  book.add(makeReturn(1, 1, PolicyKind::kPersonal));
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].summary.excluded, Tasks{1});
  EXPECT_EQ(rounds[0].rows.size(), 6u);
}

TEST(RoundBook, ForcedRoundsComeOutAsTheyAre) {
  RoundBook book(threeTasks());
  book.closeRound(1, {0, 2}, {1}, 1);
  book.add(makeReturn(1, 2, PolicyKind::kPersonal));
  book.add(makeReturn(2, 0, PolicyKind::kPersonal));
  const auto rounds = book.take(true);
  ASSERT_EQ(rounds.size(), 1u) << "round 2 is not closed";
  EXPECT_EQ(csvOf(rounds), "1,2,train,personal,0,-120,0.1,3,1002,3,0.000000\n");
  EXPECT_EQ(rounds[0].summary.personal_return, -120);
  EXPECT_TRUE(std::isnan(rounds[0].summary.meta_return));
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal))) << "too late";

  book.closeRound(2, {0}, {1, 2}, 1);
  const auto second = book.take(true);
  EXPECT_EQ(csvOf(second), "2,0,train,personal,0,-200,0.1,3,2000,3,0.000000\n");
}

TEST(RoundBook, RoundsThatDoNotEvaluateWaitForNoReturn) {
  RoundBook book(threeTasks({"evaluation_interval:=3"}));
  EXPECT_FALSE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  EXPECT_TRUE(book.hasPersonal(1));
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_TRUE(book.take().empty()) << "not closed";
  book.closeRound(1, {0, 1, 2}, {}, 1);
  book.closeRound(2, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 2u);
  EXPECT_FALSE(book.hasPersonal(3));
  EXPECT_EQ(book.awaited(), (Tasks{0, 1, 2}));
  book.closeRound(3, {0, 1, 2}, {}, 1);
  EXPECT_TRUE(book.take().empty());
  addAll(book, 3);
  EXPECT_EQ(book.take().size(), 1u);
  EXPECT_FALSE(book.hasPersonal(4)) << "the last round evaluates";
}

TEST(RoundBook, TestTasksOweOnlyMetaReturnsForEachContext) {
  const Experiment experiment = Experiment::parse(
      "learner: sac\nenvironment: {name: half_cheetah_dir, directions: [-1], test_directions: "
      "[1]}\n"
      "sac: {hidden: [4], task_encoding: inference, exploration_episodes: [2, 5]}\n"
      "personal: {alpha: 0.001, eta: 0.01}\nrun_id: run\n",
      "test");
  ASSERT_EQ(experiment.totalTasks(), 2);
  RoundBook book(experiment);
  TaskReturn test = makeReturn(1, 1, PolicyKind::kMeta);
  EXPECT_FALSE(book.add(test)) << "task 1 is a test task";
  test.split = Split::kTest;
  test.context_episodes = 3;
  EXPECT_FALSE(book.add(test)) << "after 3 episodes nobody evaluates";
  EXPECT_TRUE(book.hasPersonal(1) == false);
  EXPECT_TRUE(book.add(makeReturn(1, 0, PolicyKind::kPersonal)));
  EXPECT_TRUE(book.hasPersonal(1)) << "a test task has no personal policy";
  book.closeRound(1, {0}, {}, 1);
  for (const int context : {0, 2, 5}) {
    EXPECT_TRUE(book.take().empty());
    TaskReturn meta = makeReturn(1, 0, PolicyKind::kMeta);
    meta.context_episodes = test.context_episodes = context;
    meta.mean = context;
    test.mean = 10 * context;
    EXPECT_TRUE(book.add(meta));
    EXPECT_TRUE(book.add(test));
  }
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows.size(), 7u);
  EXPECT_EQ(rounds[0].summary.meta_return, 5) << "after the most exploration";
  EXPECT_EQ(rounds[0].summary.test_return, 50);
}

TEST(RoundBook, IndependentRunsHaveNoMetaReturns) {
  RoundBook book(threeTasks({"algorithm:=independent"}));
  book.closeRound(1, {0, 1, 2}, {}, 1);
  for (int task = 0; task < 3; ++task) book.add(makeReturn(1, task, PolicyKind::kPersonal));
  EXPECT_EQ(book.awaited(), Tasks{});
  const auto rounds = book.take();
  ASSERT_EQ(rounds.size(), 1u);
  EXPECT_EQ(rounds[0].rows.size(), 3u);
  EXPECT_TRUE(std::isnan(rounds[0].summary.meta_return));
}

TEST(RoundBook, AwaitsNobodyOnceTheRunIsOver) {
  RoundBook book(threeTasks({"rounds:=1"}));
  EXPECT_EQ(book.awaited(), (Tasks{0, 1, 2}));
  addAll(book, 1);
  book.closeRound(1, {0, 1, 2}, {}, 1);
  EXPECT_EQ(book.take().size(), 1u);
  EXPECT_EQ(book.awaited(), Tasks{});
  EXPECT_TRUE(book.take(true).empty());
}

TEST(RoundBook, RefusesWhatIsNoResult) {
  const Experiment experiment = threeTasks();
  RoundBook book(experiment);
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  const std::vector<std::function<void(TaskReturn&)>> spoilers = {
      [](TaskReturn& r) { r.mean = std::nan(""); },
      [](TaskReturn& r) { r.mean = -HUGE_VAL; },
      [](TaskReturn& r) { r.mean = 1e200; },
      [](TaskReturn& r) { r.std = HUGE_VAL; },
      [](TaskReturn& r) { r.std = -1; },
      [](TaskReturn& r) { r.seconds = 1e308; },
      [](TaskReturn& r) { r.seconds = -1; },
      [](TaskReturn& r) { r.episodes = 0; },
      [](TaskReturn& r) { r.env_steps = -500000; },
      [](TaskReturn& r) { r.env_steps = kHuge; },
      [](TaskReturn& r) { r.updates = kHuge; },
      [](TaskReturn& r) { r.broken_episodes = -1; }};
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    TaskReturn spoiled = makeReturn(2, 1, PolicyKind::kPersonal);
    spoilers[i](spoiled);
    EXPECT_EQ(errorOf([&] {
                book.add(spoiled);
              }).rfind("the return of task 1 in round 2 is no result: ", 0),
              0u)
        << i;
  }
  EXPECT_TRUE(book.add(makeReturn(2, 1, PolicyKind::kPersonal))) << "its place is still free";
  EXPECT_FALSE(book.add(makeReturn(2, 1, PolicyKind::kPersonal)))
      << "a duplicate is none the less one";
}

TEST(RoundBook, CountersThatOverflowOnlyWhenTheyAreSummedAreRefused) {
  const Experiment experiment = threeTasks();
  RoundBook book(experiment);
  TaskReturn large = makeReturn(1, 0, PolicyKind::kPersonal);
  large.env_steps = kMostCounted - 10;
  EXPECT_TRUE(book.add(large));
  TaskReturn more = makeReturn(2, 0, PolicyKind::kPersonal);
  more.env_steps = 11;
  EXPECT_THROW(book.add(more), Error);
  more.env_steps = 10;
  EXPECT_TRUE(book.add(more));
}

}  // namespace
}  // namespace pmeta
