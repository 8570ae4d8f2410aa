#include "common/conversions.h"

#include <gtest/gtest.h>
#include <ros/serialization.h>

#include <functional>
#include <limits>
#include <thread>

#include "common/mailbox.h"
#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

// through the wire format and back
template <class Msg>
Msg overTheWire(const Msg& msg) {
  const std::uint32_t size = ros::serialization::serializationLength(msg);
  std::vector<std::uint8_t> buffer(size);
  ros::serialization::OStream out(buffer.data(), size);
  ros::serialization::serialize(out, msg);
  Msg copy;
  ros::serialization::IStream in(buffer.data(), size);
  ros::serialization::deserialize(in, copy);
  return copy;
}

pmeta::Model tableModel() {
  pmeta::Model model(pmeta::ModelLayout(pmeta::Precision::kFloat64, {{"q_table", {3, 2}}}));
  model.doubles() = {0.1, -0.0, 1e-310, -3e300, std::numeric_limits<double>::quiet_NaN(), 6};
  model.present = {1, 1, 1, 1, 0, 1};
  return model;
}

pmeta::Model networkModel() {
  pmeta::Model model(pmeta::ModelLayout(pmeta::Precision::kFloat32,
                                        {{"layer0.weight", {2, 2}}, {"layer0.bias", {2}}}));
  model.floats() = {0.1f, -2.f, 1e-40f, 3.4e38f, -0.f, 7.f};
  return model;
}

std::string errorOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const pmeta::Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Conversions, ModelsKeepEveryBit) {
  for (const pmeta::Model& model : {tableModel(), networkModel()}) {
    EXPECT_TRUE(fromMsg(overTheWire(toMsg(model))) == model);
  }
}

TEST(Conversions, ModelsThatAreMovedAreNotCopied) {
  pmeta::AuxiliaryUpdate update = {"run", 4, 9, networkModel(), 2.5};
  const float* values = update.model.floats().data();
  pmeta_msgs::AuxiliaryUpdate msg = toMsg(std::move(update));
  EXPECT_EQ(msg.model.float32_values.data(), values);
  const pmeta::AuxiliaryUpdate back = fromMsg(std::move(msg));
  EXPECT_EQ(back.model.floats().data(), values);
}

TEST(Conversions, MetaPolicyRoundTrip) {
  const pmeta::MetaPolicy meta = {"run", 3, networkModel(), {0, 2}, true, 7, true, "5e77"};
  const pmeta_msgs::MetaPolicy msg = overTheWire(toMsg(meta, 10));
  EXPECT_EQ(msg.rounds, 10u);
  const pmeta::MetaPolicy back = fromMsg(msg);
  EXPECT_EQ(back.run_id, "run");
  EXPECT_EQ(back.round, 3);
  EXPECT_TRUE(back.evaluate);
  EXPECT_EQ(back.incarnation, 7u);
  EXPECT_EQ(back.settings_hash, meta.settings_hash);
  EXPECT_TRUE(back.checkpoint);
  EXPECT_EQ(back.participants, (std::vector<int>{0, 2}));
  EXPECT_TRUE(back.model == meta.model);
}

TEST(Conversions, AuxiliaryUpdateRoundTrip) {
  const pmeta::AuxiliaryUpdate update = {"run", 4, 9, tableModel(), 2.5, "5e77"};
  const pmeta::AuxiliaryUpdate back = fromMsg(overTheWire(toMsg(update)));
  EXPECT_EQ(back.run_id, "run");
  EXPECT_EQ(back.task, 4);
  EXPECT_EQ(back.round, 9);
  EXPECT_EQ(back.weight, 2.5);
  EXPECT_EQ(back.settings_hash, "5e77");
  EXPECT_TRUE(back.model == update.model);
}

TEST(Conversions, TaskReturnRoundTrip) {
  for (const auto policy : {pmeta::PolicyKind::kPersonal, pmeta::PolicyKind::kMeta}) {
    for (const auto split : {pmeta::Split::kTrain, pmeta::Split::kTest}) {
      pmeta::TaskReturn result;
      result.run_id = "run";
      result.task = 2;
      result.round = 5;
      result.split = split;
      result.policy = policy;
      result.mean = -1.25;
      result.std = 0.5;
      result.episodes = 15;
      result.env_steps = 1LL << 40;
      result.updates = 30;
      result.broken_episodes = 3;
      result.seconds = 0.125;
      result.scheduled = policy == pmeta::PolicyKind::kMeta;
      const pmeta_msgs::TaskReturn msg = overTheWire(toMsg(result, "grid_4x4"));
      EXPECT_EQ(msg.task_name, "grid_4x4");
      EXPECT_EQ(msg.policy_name, pmeta::name(policy));
      EXPECT_EQ(msg.split_name, pmeta::name(split));
      const pmeta::TaskReturn back = fromMsg(msg);
      EXPECT_EQ(back.run_id, result.run_id);
      EXPECT_EQ(back.task, result.task);
      EXPECT_EQ(back.round, result.round);
      EXPECT_EQ(back.split, result.split);
      EXPECT_EQ(back.policy, result.policy);
      EXPECT_EQ(back.mean, result.mean);
      EXPECT_EQ(back.std, result.std);
      EXPECT_EQ(back.episodes, result.episodes);
      EXPECT_EQ(back.broken_episodes, 3);
      EXPECT_EQ(back.env_steps, result.env_steps);
      EXPECT_EQ(back.updates, result.updates);
      EXPECT_EQ(back.seconds, result.seconds);
      EXPECT_EQ(back.scheduled, result.scheduled);
    }
  }
}

TEST(Conversions, TrajectoriesCarryTheEpisodeAndItsTask) {
  const auto experiment = pmeta::Experiment::parse("run_id: r", "test");
  pmeta::Episode episode;
  episode.observation_size = 2;
  episode.action_size = 1;
  episode.observations = {0, 0, 0, 1};
  episode.actions = {3};
  episode.rewards = {-5};
  episode.position_size = 3;
  episode.positions = {1, 2, 3, 4, 5, 6};
  episode.truncated = true;
  episode.state_values = {-1, -2};
  episode.greedy_actions = {3, -1};
  episode.action_grid = 2;
  episode.action_values = {0.1f, 0.2f, -3, 4};
  const pmeta_msgs::Trajectory msg =
      overTheWire(toMsg(episode, experiment, 1, 4, pmeta::PolicyKind::kMeta));
  EXPECT_EQ(msg.run_id, "r");
  EXPECT_EQ(msg.task, 1u);
  EXPECT_EQ(msg.task_name, "grid_5x5");
  EXPECT_EQ(msg.header.frame_id, "task_1");
  EXPECT_EQ(msg.environment, "gridworld");
  EXPECT_EQ(msg.round, 4u);
  EXPECT_EQ(msg.policy, pmeta_msgs::Trajectory::META);
  EXPECT_EQ(msg.observations, episode.observations);
  EXPECT_EQ(msg.actions, episode.actions);
  EXPECT_EQ(msg.rewards, episode.rewards);
  EXPECT_EQ(msg.position_size, 3u);
  EXPECT_EQ(msg.positions, episode.positions);
  EXPECT_EQ(msg.state_values, episode.state_values);
  EXPECT_EQ(msg.greedy_actions, episode.greedy_actions);
  EXPECT_EQ(msg.action_grid, 2u);
  EXPECT_EQ(msg.action_values, episode.action_values);
  EXPECT_EQ(msg.episode_return, -5);
  EXPECT_FALSE(msg.terminated);
  EXPECT_TRUE(msg.truncated);
}

TEST(Conversions, DamagedModelsAreRefusedWithTheReason) {
  const pmeta_msgs::ModelBlob good = toMsg(tableModel());
  const auto refusal = [&](const std::function<void(pmeta_msgs::ModelBlob&)>& spoil) {
    pmeta_msgs::ModelBlob msg = good;
    spoil(msg);
    return errorOf([&] { fromMsg(msg); });
  };
  using Blob = pmeta_msgs::ModelBlob;
  EXPECT_EQ(refusal([](Blob& m) { m.float64_values[0] = 0.2; }),
            "a model's checksum does not fit its values: it was damaged on the way.");
  EXPECT_EQ(refusal([](Blob& m) { m.present[4] = 1; }),
            "a model's checksum does not fit its values: it was damaged on the way.");
  EXPECT_EQ(refusal([](Blob& m) { m.float64_values.resize(5); }),
            "a model carries 5 values where its layout has 6.");
  EXPECT_EQ(refusal([](Blob& m) { m.present.resize(2); }),
            "a model carries a presence mask of 2 entries for 6 values.");
  EXPECT_EQ(refusal([](Blob& m) { m.float32_values = {1.f}; }),
            "a model carries values of another precision than its layout says.");
  EXPECT_NE(
      refusal([](Blob& m) { m.layout = "float64\nq_table 2 3\n"; }).find("does not fit its layout"),
      std::string::npos);
  EXPECT_NE(refusal([](Blob& m) { m.layout = "nonsense"; }), "no error");
}

TEST(Conversions, ImpossibleReturnsAreRefused) {
  pmeta_msgs::TaskReturn msg = toMsg(pmeta::TaskReturn(), "grid");
  msg.policy = pmeta_msgs::TaskReturn::POLICY_UNKNOWN;
  EXPECT_EQ(errorOf([&] { fromMsg(msg); }), "a return is of no known policy (0).");
  msg = toMsg(pmeta::TaskReturn(), "grid");
  msg.split = 9;
  EXPECT_EQ(errorOf([&] { fromMsg(msg); }), "a return is of no known split (9).");
  msg = toMsg(pmeta::TaskReturn(), "grid");
  msg.task = 0xffffffffu;
  EXPECT_EQ(errorOf([&] { fromMsg(msg); }), "a message has an impossible task, 4294967295.");
}

TEST(Conversions, RoundSummaryRoundTrip) {
  const auto experiment = pmeta::Experiment::parse("run_id: run", "test");
  pmeta::RoundSummary summary;
  summary.run_id = "run";
  summary.round = 3;
  summary.rounds = 9;
  summary.personal_return = -1;
  summary.meta_return = -2;
  summary.test_return = -3;
  summary.participants = {0, 2};
  summary.missing = {1};
  summary.excluded = {3, 4};
  summary.seconds = 0.5;
  summary.eta_seconds = 3;
  const pmeta::RoundSummary back = fromMsg(overTheWire(toMsg(summary, experiment)));
  EXPECT_EQ(back.run_id, "run");
  EXPECT_EQ(back.round, 3);
  EXPECT_EQ(back.rounds, 9);
  EXPECT_EQ(back.personal_return, -1);
  EXPECT_EQ(back.meta_return, -2);
  EXPECT_EQ(back.test_return, -3);
  EXPECT_EQ(back.participants, summary.participants);
  EXPECT_EQ(back.missing, summary.missing);
  EXPECT_EQ(back.excluded, summary.excluded);
  EXPECT_EQ(back.seconds, 0.5);
  EXPECT_EQ(back.eta_seconds, 3);
}

pmeta::Authenticator someKey() { return pmeta::Authenticator(pmeta::Key{1, 2, 3}); }

// signed, over the wire, and then each change by itself
template <class Msg>
void expectGuarded(Msg msg, const std::vector<std::function<void(Msg&)>>& changes) {
  using pmeta::Authenticity;
  EXPECT_EQ(authenticate(someKey(), msg), Authenticity::kUnsigned);
  sign(someKey(), msg);
  EXPECT_EQ(msg.mac.size(), 32u);
  msg = overTheWire(msg);
  EXPECT_EQ(authenticate(someKey(), msg), Authenticity::kAuthentic);
  EXPECT_EQ(authenticate(pmeta::Authenticator(pmeta::Key{9}), msg), Authenticity::kForged);
  EXPECT_EQ(authenticate(pmeta::Authenticator(), msg), Authenticity::kAuthentic)
      << "without a key a MAC is not looked at";
  for (std::size_t i = 0; i < changes.size(); ++i) {
    Msg changed = msg;
    changes[i](changed);
    EXPECT_EQ(authenticate(someKey(), changed), Authenticity::kForged) << "change " << i;
  }
}

TEST(Conversions, ScoresHaveThePoliciesByTaskAndWhatIsNotThereIsNan) {
  const pmeta::Experiment experiment = pmeta::Experiment::parse(
      "{run_id: run, environment: {name: gridworld, sizes: [4, 5, 6]}}", "test");
  pmeta::RoundBook::Round round;
  round.summary.run_id = "run";
  round.summary.round = 3;
  round.summary.rounds = 10;
  round.summary.personal_return = -2;
  for (const auto policy : {pmeta::PolicyKind::kPersonal, pmeta::PolicyKind::kMeta}) {
    pmeta::RoundRow row;
    row.result.task = policy == pmeta::PolicyKind::kPersonal ? 1 : 2;
    row.result.policy = policy;
    row.result.mean = policy == pmeta::PolicyKind::kPersonal ? -2 : -7;
    round.rows.push_back(row);
  }
  const pmeta_msgs::Scores msg = overTheWire(toScores(round, experiment));
  EXPECT_EQ(msg.round, 3u);
  EXPECT_EQ(msg.training_tasks, 3u);
  EXPECT_EQ(msg.tasks, (std::vector<std::string>{"grid_4x4", "grid_5x5", "grid_6x6"}));
  ASSERT_EQ(msg.personal.size(), 3u);
  EXPECT_TRUE(std::isnan(msg.personal[0]));
  EXPECT_EQ(msg.personal[1], -2);
  EXPECT_TRUE(std::isnan(msg.meta[1]));
  EXPECT_EQ(msg.meta[2], -7);
  EXPECT_EQ(msg.personal_mean, -2);
}

TEST(Conversions, StatesHaveNamesAndAStrangersNumberIsUnknown) {
  pmeta_msgs::RoundSummary round;
  round.state = pmeta_msgs::RoundSummary::BLOCKED;
  EXPECT_EQ(stateName(round), "blocked");
  round.state = 250;
  EXPECT_EQ(stateName(round), "unknown");
  pmeta_msgs::AgentStatus status;
  status.state = pmeta_msgs::AgentStatus::FAILED;
  EXPECT_EQ(stateName(status), "failed");
  status.state = 6;
  EXPECT_EQ(stateName(status), "unknown");
}

TEST(Conversions, TheMacOfAnUpdateGuardsEachField) {
  using M = pmeta_msgs::AuxiliaryUpdate;
  expectGuarded<M>(
      toMsg(pmeta::AuxiliaryUpdate{"run", 4, 9, tableModel(), 2.5, "a"}),
      {[](M& m) { m.run_id = "other"; }, [](M& m) { m.task = 3; },
       [](M& m) { m.task = 0xffffffffu; }, [](M& m) { m.round = 8; }, [](M& m) { m.weight = 2; },
       [](M& m) { m.settings_hash = "5e77"; }, [](M& m) { m.model.layout += " "; },
       [](M& m) { m.model.layout_hash ^= 1; }, [](M& m) { m.model.float64_values[0] = 0.2; },
       [](M& m) { m.model.float64_values.push_back(0); },
       [](M& m) { m.model.float32_values.push_back(0); }, [](M& m) { m.model.present[4] = 1; },
       [](M& m) { m.model.present.clear(); }, [](M& m) { m.model.checksum ^= 1; },
       [](M& m) { m.mac[31] ^= 0x80; }});
}

TEST(Conversions, TheMacOfAMetaPolicyGuardsEachField) {
  using M = pmeta_msgs::MetaPolicy;
  expectGuarded<M>(
      toMsg(pmeta::MetaPolicy{"run", 3, networkModel(), {0, 2}, false, 0, false, "a"}, 10),
      {[](M& m) { m.run_id = "other"; }, [](M& m) { m.round = 4; }, [](M& m) { m.rounds = 4; },
       [](M& m) { m.settings_hash = "5e77"; }, [](M& m) { m.participants.pop_back(); },
       [](M& m) { m.model.float32_values[5] = 8; }});
}

TEST(Conversions, TheMacOfAReturnGuardsEachField) {
  using M = pmeta_msgs::TaskReturn;
  expectGuarded<M>(
      toMsg(pmeta::TaskReturn(), "grid"),
      {[](M& m) { m.run_id = "other"; }, [](M& m) { m.task = 1; },
       [](M& m) { m.task_name = "grib"; }, [](M& m) { m.round = 1; },
       [](M& m) { m.policy = M::META; }, [](M& m) { m.policy = 7; },
       [](M& m) { m.split = M::TEST; }, [](M& m) { m.context_episodes = 1; },
       [](M& m) { m.return_mean = 1; }, [](M& m) { m.return_std = 1; },
       [](M& m) { m.episodes = 1; }, [](M& m) { m.env_steps = 1; }, [](M& m) { m.updates = 1; },
       [](M& m) { m.broken_episodes = 1; }, [](M& m) { m.losses = {1}, m.loss_names = {"td"}; },
       [](M& m) { m.wall_s = 1; }});
}

TEST(Conversions, TheMacOfARoundMessageGuardsEachField) {
  using M = pmeta_msgs::RoundSummary;
  M msg = toMsg(pmeta::RoundSummary(), pmeta::Experiment::parse("run_id: run", "test"));
  msg.message = "all is well";
  msg.header.stamp = ros::Time(5, 6);
  expectGuarded<M>(
      msg, {[](M& m) { m.run_id = "other"; }, [](M& m) { m.experiment = ""; },
            [](M& m) { m.header.stamp.nsec = 7; }, [](M& m) { m.state = M::FINISHED; },
            [](M& m) { m.message = ""; }, [](M& m) { m.round = 1; }, [](M& m) { m.rounds = 1; },
            [](M& m) { m.personal_return = 1; }, [](M& m) { m.meta_return = 1; },
            [](M& m) { m.test_return = 1; }, [](M& m) { m.participants = {1}; },
            [](M& m) { m.missing = {1}; }, [](M& m) { m.excluded = {1}; },
            [](M& m) { m.round_s = 1; }, [](M& m) { m.eta_s = 1; }, [](M& m) { m.refused = 1; }});
}

TEST(Conversions, TheMacOfAnAgentsStateGuardsWhatIsActedOn) {
  using M = pmeta_msgs::AgentStatus;
  M msg;
  msg.run_id = "run";
  msg.state = M::TRAINING;
  expectGuarded<M>(msg, {[](M& m) { m.run_id = "other"; }, [](M& m) { m.task = 1; },
                         [](M& m) { m.task = 0xffffffffu; }, [](M& m) { m.state = M::FAILED; },
                         [](M& m) { m.message = "failed"; }, [](M& m) { m.incarnation = 1; }});
}

TEST(Mailbox, DropsTheOldestWhenFull) {
  Mailbox<int> mailbox(2);
  for (int i = 1; i <= 3; ++i) mailbox.push(i);
  EXPECT_EQ(mailbox.pop(std::chrono::seconds(0)), 2);
  EXPECT_EQ(mailbox.pop(std::chrono::seconds(0)), 3);
  EXPECT_EQ(mailbox.pop(std::chrono::milliseconds(1)), std::nullopt);
}

TEST(Mailbox, ClosingWakesTheWorkerForGood) {
  Mailbox<int> mailbox(1);
  std::thread worker([&] { EXPECT_EQ(mailbox.pop(std::chrono::seconds(60)), std::nullopt); });
  mailbox.close();
  worker.join();
  mailbox.push(1);
  EXPECT_EQ(mailbox.pop(std::chrono::seconds(60)), std::nullopt);
}

}  // namespace
}  // namespace pmeta_nodes
