#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "../memory_state.h"
#include "../support.h"
#include "checkpoint_experiments.h"
#include "pmeta_core/storage/round_book.h"

namespace pmeta {
namespace {

using test::checkpointExperiment;
using test::checkpointKinds;
using test::errorOf;
using test::MemoryState;
using test::stateOf;
using test::trainedAgent;

// loads a state into a new agent and, if that goes well, trains on with it
std::string tryState(const Experiment& experiment, const MemoryState& state) {
  return errorOf([&] {
    TaskAgent agent(experiment, 1);
    test::load(agent, state);
    MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
    meta.round = agent.round();
    agent.trainRound(meta);
  });
}

TEST(HostileState, EveryArrayMayBeMissingOrOfAnotherSizeOrType) {
  for (const std::string& kind : checkpointKinds()) {
    const Experiment experiment = checkpointExperiment(kind, "/tmp/pmeta_unused");
    const MemoryState good = stateOf(trainedAgent(experiment, 2));
    EXPECT_EQ(tryState(experiment, good), "(no error)");
    for (const auto& [name, array] : good.arrays) {
      MemoryState bad = good;
      bad.arrays.erase(name);
      EXPECT_NE(tryState(experiment, bad).find(name), std::string::npos) << kind;
      bad.arrays[name] = array;
      bad.arrays[name].type =
          array.type == StateType::kUint8 ? StateType::kFloat32 : StateType::kUint8;
      EXPECT_NE(tryState(experiment, bad).find(name), std::string::npos) << kind;
      for (const std::size_t values : {-1, 1}) {
        if (array.bytes.empty() && values != 1) continue;
        bad.arrays[name] = array;
        bad.arrays[name].bytes.resize(array.bytes.size() + values * byteSize(array.type));
        EXPECT_NE(tryState(experiment, bad), "(no error)") << kind << " " << name;
      }
    }
  }
}

TEST(HostileState, EveryNumberMayBeAny) {
  // refused or harmless: an index that is not, a sanitizer finds
  int refused = 0;
  const std::vector<std::int64_t> whole = {-1,
                                           1,
                                           5,
                                           1 << 20,
                                           std::int64_t{1} << 40,
                                           std::numeric_limits<std::int64_t>::max(),
                                           std::numeric_limits<std::int64_t>::min()};
  const std::vector<double> real = {-1, 0, 1e30, std::numeric_limits<double>::infinity(),
                                    std::numeric_limits<double>::quiet_NaN()};
  for (const std::string& kind : checkpointKinds()) {
    const Experiment experiment = checkpointExperiment(kind, "/tmp/pmeta_unused");
    const MemoryState good = stateOf(trainedAgent(experiment, 2));
    for (const auto& [name, array] : good.arrays) {
      const auto spoil = [&](auto value) {
        using T = decltype(value);
        MemoryState bad = good;
        std::vector<T> values = bad.get<T>(name);
        if (values.empty()) return;
        values[values.size() / 2] = value;
        bad.set(name, values);
        refused += tryState(experiment, bad) != "(no error)";
      };
      if (array.type == StateType::kInt64) {
        for (const std::int64_t value : whole) spoil(value);
      } else if (array.type == StateType::kFloat64) {
        for (const double value : real) spoil(value);
      } else if (array.type == StateType::kFloat32) {
        for (const double value : real) spoil(static_cast<float>(value));
      } else {
        spoil(std::uint8_t{2});
      }
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(HostileState, IndicesAreHeldAgainstWhatTheyIndex) {
  const auto error = [](const std::string& kind, const std::string& name, auto value) {
    const Experiment experiment = checkpointExperiment(kind, "/tmp/pmeta_unused");
    MemoryState bad = stateOf(trainedAgent(experiment, 2));
    auto values = bad.get<decltype(value)>(name);
    values.at(0) = value;
    bad.set(name, values);
    return tryState(experiment, bad);
  };
  const auto refused = [&](const std::string& kind, const std::string& name, auto value) {
    EXPECT_NE(error(kind, name, value).find("does not fit this run"), std::string::npos)
        << kind << " " << name << " " << value;
  };
  using Int = std::int64_t;
  refused("dqn", "learner/learner/newest_target", Int{3});
  refused("dqn", "learner/learner/replay/buffer/next", Int{150});
  refused("dqn", "learner/learner/n_step/queue_0/size", Int{4});
  refused("dqn", "learner/learner/n_step/queue_2/first", Int{-1});
  refused("dqn", "learner/learner/n_step/queue_0/actions", 2.0f);
  refused("dqn", "learner/learner/replay/weights", 0.0);
  refused("dqn", "learner/learner/replay/weights", std::numeric_limits<double>::quiet_NaN());
  refused("dqn", "learner/learner/replay/max_priority", 0.5);
  refused("dqn", "learner/learner/updates", Int{-1});
  refused("dqn", "learner/optimizer/updates", Int{-1});
  refused("dqn", "learner/has_personal", std::uint8_t{2});
  refused("dqn", "learner/personal/values", std::numeric_limits<float>::infinity());
  refused("dqn", "round", Int{7});
  refused("sac_one_hot", "learner/learner/replay/next", Int{90});
  refused("sac_one_hot", "learner/learner/task_input", 1.0f);
  refused("sac_one_hot", "learner/learner/temperature/log_value",
          std::numeric_limits<double>::infinity());
  refused("sac_context", "learner/learner/context/next", Int{40});

  // an action in the replay is an index too: the observations of cart_pole are 4 numbers
  const Experiment experiment = checkpointExperiment("dqn", "/tmp/pmeta_unused");
  MemoryState bad = stateOf(trainedAgent(experiment, 2));
  auto transitions = bad.get<float>("learner/learner/replay/buffer/values");
  transitions[4] = 1e9f;
  bad.set("learner/learner/replay/buffer/values", transitions);
  EXPECT_NE(tryState(experiment, bad).find("holds no action"), std::string::npos);
}

TEST(HostileState, NothingToDrawFromIsRefused) {
  for (const std::string kind : {"dqn", "sac_context"}) {
    const Experiment experiment = checkpointExperiment(kind, "/tmp/pmeta_unused");
    MemoryState bad = stateOf(trainedAgent(experiment, 2));
    const std::string buffer =
        kind == "dqn" ? "learner/learner/replay/buffer/" : "learner/learner/context/";
    bad.set(buffer + "values", std::vector<float>());
    bad.set(buffer + "next", std::vector<std::int64_t>{0});
    if (kind == "dqn") bad.set("learner/learner/replay/weights", std::vector<double>());
    EXPECT_NE(tryState(experiment, bad).find("is empty after the"), std::string::npos);
  }
}

TEST(HostileState, AggregatorAndBookRefuseWhatIsNotTheirs) {
  const Experiment experiment = checkpointExperiment("table", "/tmp/pmeta_unused");
  MetaAggregator aggregator(experiment);
  RoundBook book(experiment);
  std::vector<TaskAgent> agents;
  for (int task = 0; task < 2; ++task) agents.emplace_back(experiment, task);
  for (int round = 1; round <= 2; ++round) {
    for (TaskAgent& agent : agents) {
      auto result = agent.trainRound(aggregator.metaPolicy());
      if (result->personal) book.add(*result->personal);
      aggregator.offer(std::make_shared<AuxiliaryUpdate>(std::move(result->update)));
    }
    const std::vector<int> missing = aggregator.closeRound();
    book.closeRound(round, aggregator.metaPolicy().participants, missing, 0.5);
    book.take();
  }
  const MemoryState good = stateOf(aggregator), good_book = stateOf(book);
  MetaAggregator other(experiment);
  test::load(other, good);
  EXPECT_TRUE(stateOf(other) == good);
  EXPECT_TRUE(other.metaPolicy().model == aggregator.metaPolicy().model);
  EXPECT_EQ(other.metaPolicy().round, 2);
  EXPECT_EQ(other.metaPolicy().participants, (std::vector<int>{0, 1}));
  EXPECT_EQ(other.counts()[1].accepted, 2);
  RoundBook other_book(experiment);
  test::load(other_book, good_book);
  EXPECT_TRUE(stateOf(other_book) == good_book);
  EXPECT_EQ(other_book.roundsTaken(), 1);
  EXPECT_TRUE(other_book.hasPersonal(2));

  const auto errorWith = [&](const MemoryState& good_state, const std::string& name, auto value) {
    MemoryState bad = good_state;
    auto values = bad.get<decltype(value)>(name);
    values.at(0) = value;
    bad.set(name, values);
    return errorOf([&] {
      if (&good_state == &good) {
        MetaAggregator loaded(experiment);
        test::load(loaded, bad);
      } else {
        RoundBook loaded(experiment);
        test::load(loaded, bad);
      }
    });
  };
  using Int = std::int64_t;
  EXPECT_NE(errorWith(good, "round", Int{7}), "(no error)");
  EXPECT_NE(errorWith(good, "counts", Int{-1}), "(no error)");
  EXPECT_NE(errorWith(good, "meta/values", std::numeric_limits<double>::quiet_NaN()), "(no error)");
  EXPECT_NE(errorWith(good_book, "rounds_taken", Int{2}), "(no error)");
  EXPECT_NE(errorWith(good_book, "env_steps", Int{-5}), "(no error)");
  EXPECT_NE(errorWith(good_book, "closed", Int{2}), "(no error)");
  EXPECT_NE(errorWith(good_book, "returns", Int{3}), "(no error)");
  EXPECT_NE(errorWith(good_book, "closed_0/participants", Int{-1}), "(no error)");
  EXPECT_NE(errorWith(good_book, "closed_0/participants", Int{1}), "(no error)");
  EXPECT_NE(errorWith(good_book, "return_0/counts", Int{2}), "(no error)");
}

}  // namespace
}  // namespace pmeta
