#include "pmeta_core/env/remote_env.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>

#include "../support.h"
#include "pmeta_core/env/remote_family.h"

namespace pmeta {
namespace {

using test::errorOf;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

RemoteDescription wheels() {
  RemoteDescription description;
  description.observation = {{"x", "m"}, {"speed", "m/s", -2, 2}};
  description.action = {{"left", "m/s", -0.5, 0.5}, {"right", "m/s", 0, 2}};
  description.horizon = 3;
  description.step_seconds = 0.1;
  return description;
}

// answers what it is told to, and writes down what it is asked
class Scripted : public RemoteLink {
 public:
  struct Script {
    RemoteAnswer answer{{1, 2}, 0.5};
    std::vector<double> start = {0, 0};
    std::chrono::milliseconds takes{0};
    std::vector<std::uint64_t> seeds;
    std::vector<std::pair<std::uint64_t, std::uint32_t>> steps;
    std::vector<double> action;
    std::vector<std::string> warnings;
  };

  explicit Scripted(Script& script) : script_(script) {}
  std::vector<double> reset(std::uint64_t, std::uint64_t seed) override {
    script_.seeds.push_back(seed);
    return script_.start;
  }
  RemoteAnswer step(std::uint64_t episode, std::uint32_t step,
                    const std::vector<double>& action) override {
    script_.steps.emplace_back(episode, step);
    script_.action = action;
    std::this_thread::sleep_for(script_.takes);
    return script_.answer;
  }
  void warn(const std::string& sentence) override { script_.warnings.push_back(sentence); }

 private:
  Script& script_;
};

class RemoteEnvTest : public ::testing::Test {
 protected:
  RemoteEnv make(const RemotePace& pace = {}, RemoteDescription description = wheels()) {
    return RemoteEnv(
        "/robot", description, pace, [this] { return std::make_unique<Scripted>(script_); },
        figures_);
  }
  Step act(RemoteEnv& env, std::vector<double> action = {0, 0}) {
    return env.step(action.data(), rng_, observation_.data());
  }

  Scripted::Script script_;
  RemoteFigures figures_;
  Rng rng_{1, 0, Stream::kMeasure};
  std::vector<double> observation_ = {-7, -7};
};

TEST_F(RemoteEnvTest, AnEpisodeIsSeededByOneNumberAndItsStepsAreCounted) {
  RemoteEnv env = make();
  Rng same = rng_;
  env.reset(rng_, observation_.data());
  EXPECT_EQ(script_.seeds, (std::vector<std::uint64_t>{same()}));
  EXPECT_EQ(rng_.state(), same.state());
  const Step step = act(env);
  EXPECT_EQ(step.reward, 0.5);
  EXPECT_EQ(observation_, (std::vector<double>{1, 2}));
  act(env);
  env.reset(rng_, observation_.data());
  act(env);
  EXPECT_EQ(script_.steps,
            (std::vector<std::pair<std::uint64_t, std::uint32_t>>{{1, 1}, {1, 2}, {2, 1}}));
}

TEST_F(RemoteEnvTest, ActionsAreClippedAndScaledToWhatTheBodyTakes) {
  RemoteEnv env = make();
  env.reset(rng_, observation_.data());
  act(env, {-1, 0});
  EXPECT_EQ(script_.action, (std::vector<double>{-0.5, 1}));
  act(env, {3, 1});
  EXPECT_EQ(script_.action, (std::vector<double>{0.5, 2}));
  EXPECT_EQ(env.spec().action[0].high, 1);
  EXPECT_EQ(env.spec().observation[1].unit, "m/s");
  EXPECT_FALSE(env.spec().restorable);
}

TEST_F(RemoteEnvTest, TheHorizonTruncatesWhateverTheBodySays) {
  RemoteEnv env = make();
  env.reset(rng_, observation_.data());
  EXPECT_FALSE(act(env).truncated);
  EXPECT_FALSE(act(env).truncated);
  EXPECT_TRUE(act(env).truncated);
  env.reset(rng_, observation_.data());
  script_.answer.terminated = script_.answer.truncated = true;
  const Step last = act(env);
  EXPECT_TRUE(last.terminated);
  EXPECT_FALSE(last.truncated);
}

TEST_F(RemoteEnvTest, WhatCannotBeLearntFromBreaksTheEpisodeAndIsTold) {
  RemoteEnv env = make();
  const auto refused = [&](const RemoteAnswer& answer) {
    script_.answer = {{1, 2}, 0.5};
    env.reset(rng_, observation_.data());
    script_.answer = answer;
    observation_ = {-7, -7};
    const std::string sentence = errorOf([&] { act(env); });
    EXPECT_EQ(observation_, (std::vector<double>{-7, -7})) << "nothing of it may be seen";
    EXPECT_EQ(script_.warnings.back(), sentence);
    return sentence;
  };
  const std::string tail = "; the episode cannot go on, reset it.";
  EXPECT_EQ(refused({{1}, 0}),
            "/robot, in step 1 of an episode, answered 1 numbers of an "
            "observation, which has 2" +
                tail);
  EXPECT_EQ(refused({{1, std::nan("")}, 0}),
            "/robot, in step 1 of an episode, answered that observation speed is nan, which is no "
            "finite number of 32 bits" +
                tail);
  EXPECT_EQ(refused({{1, 2}, kInfinity}),
            "/robot, in step 1 of an episode, answered that the reward is inf, which is no finite "
            "number of 32 bits" +
                tail);
  EXPECT_NE(refused({{1e39, 2}, 0}), "(no error)") << "infinite once it is in a replay";
  EXPECT_EQ(figures_.lost, 4);

  script_.start = {0, 0, 0};
  EXPECT_EQ(
      errorOf([&] { env.reset(rng_, observation_.data()); }),
      "/robot, at the start of an episode, answered 3 numbers of an observation, which has 2" +
          tail);
}

TEST_F(RemoteEnvTest, StepsThatTheRateIsAheadOfAreCounted) {
  RemotePace pace;
  pace.rate = 1000;
  RemoteEnv env = make(pace);
  script_.takes = std::chrono::milliseconds(5);
  env.reset(rng_, observation_.data());
  for (int i = 0; i < 3; ++i) act(env);
  EXPECT_EQ(figures_.late_steps, 2) << "the first of an episode is due at once";
}

TEST_F(RemoteEnvTest, AnUnhurriedRateIsKept) {
  RemotePace pace;
  pace.rate = 20;
  pace.pause = 0.05;
  RemoteEnv env = make(pace);
  const auto start = std::chrono::steady_clock::now();
  for (int episode = 0; episode < 2; ++episode) {
    env.reset(rng_, observation_.data());
    for (int i = 0; i < 3; ++i) act(env);
  }
  // twice from the first to the third step, and one pause
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(250));
}

TEST(RemoteDescription, EveryDifferenceIsNamed) {
  const auto found = [](const std::function<void(RemoteDescription&)>& change) {
    RemoteDescription told = wheels();
    change(told);
    return difference(wheels(), told);
  };
  EXPECT_EQ(found([](auto&) {}), "");
  EXPECT_EQ(found([](auto& d) { d.horizon = 0; }), "");
  EXPECT_EQ(found([](auto& d) { std::swap(d.observation[0], d.observation[1]); }),
            "observation 0 is 'speed' but must be 'x'");
  EXPECT_EQ(found([](auto& d) { d.observation[1].unit = "km/h"; }),
            "observation 'speed' is in 'km/h' but must be in 'm/s'");
  EXPECT_EQ(found([](auto& d) { d.action[1].high = 3; }),
            "action 'right' is from 0 to 3 but must be from 0 to 2");
  EXPECT_EQ(found([](auto& d) { d.action[1].low = std::nan(""); }),
            "action 'right' is from nan to 2 but must be from 0 to 2");
  EXPECT_EQ(found([](auto& d) { d.action.pop_back(); }),
            "it has 1 numbers of its action but must have 2");
  EXPECT_EQ(found([](auto& d) {
              d.choices = {"go", "stop"};
            }),
            "its choices are go, stop but must be ");
  EXPECT_EQ(found([](auto& d) { d.horizon = 4; }), "its horizon is 4 but must be 3");
  EXPECT_EQ(found([](auto& d) { d.step_seconds = 0.2; }),
            "its step takes 0.2 s but must take 0.1 s");
}

Experiment remote(const std::vector<std::string>& overrides) {
  return Experiment::parse(R"(
experiment: wheels
learner: sac
results_dir: /tmp/pmeta_unused
environment:
  name: remote
  servers: [/robots/left, /right]
  test_servers: [/spare]
  horizon: 50
  observations: {x: {unit: m}, speed: {unit: m/s, limits: [-2, 2]}}
  actions: {drive: {unit: m/s, limits: [-0.5, 0.5]}}
)",
                           "wheels.yaml", overrides);
}

std::string refused(const std::vector<std::string>& overrides) {
  return errorOf([&] { remote(overrides); });
}

TEST(RemoteFamily, ItsSettingsDescribeTheBody) {
  const Experiment experiment = remote({});
  const auto& family = dynamic_cast<const RemoteFamily&>(experiment.family());
  EXPECT_TRUE(family.hasOneBody());
  EXPECT_EQ(family.taskName(0), "robots_left");
  EXPECT_EQ(family.numTasks(), 2);
  EXPECT_EQ(family.numTestTasks(), 1);
  EXPECT_EQ(family.taskDescription(2), "behind the services of /spare");
  EXPECT_EQ(family.description().observation[0].high, kInfinity);
  EXPECT_EQ(family.description().action[0].low, -0.5);
  // the same of what it writes
  const Experiment again = Experiment::parse(experiment.yaml(), "again");
  EXPECT_EQ(again.settingsHash(), experiment.settingsHash());
  EXPECT_EQ(remote({"environment.timeout:=1"}).settingsHash(), experiment.settingsHash());
  EXPECT_NE(experiment.describe().find("environment.observations.speed.limits"), std::string::npos);
}

TEST(RemoteFamily, WhatIsMissingOrWrongIsSaid) {
  EXPECT_EQ(refused({"servers:=[]"}),
            "environment.servers must name a namespace for each task, e.g. [/robot_0].");
  EXPECT_EQ(refused({"servers:=[robot]"}),
            "environment.servers holds 'robot' but must hold full names of ROS, e.g. /robot_0.");
  EXPECT_EQ(refused({"servers:=[/a/b, /a_b]"}),
            "environment.servers names /a_b twice: a robot can have one task only.");
  EXPECT_EQ(refused({"environment.actions.drive.limits:=[]"}),
            "environment.actions.drive.limits must be [low, high] of what the robot takes.");
  EXPECT_EQ(refused({"environment.observations.speed.limits:=[2, -2]"}),
            "environment.observations.speed.limits must be [low, high], or [] for none.");
  EXPECT_EQ(
      refused({"environment.actions.dri-ve.unit:=m"}),
      "environment.actions has the name 'dri-ve' but must have one of letters, digits and _.");
  EXPECT_EQ(refused({"choices:=[left, right]"}),
            "environment.actions must name one number, without limits, where there are choices.");
}

TEST(RemoteFamily, ABodyHasOneEnvironmentAndOneAgent) {
  EXPECT_EQ(
      refused({"algorithm:=pearl"}),
      "environment 'remote' has one body for each task, but algorithm pearl acts in all tasks "
      "in one process: choose one in which each task has an agent.");
  EXPECT_EQ(
      refused({"learner:=dqn", "choices:=[left, right]", "environment.actions.drive.limits:=[]"}),
      "environment 'remote' has one body for each task, but dqn.num_envs is 10: set it to 1.");
}

TEST(RemoteFamily, AnAgentTrainsEvaluatesAndRecordsInTheOneBody) {
  Scripted::Script script;
  int links = 0;
  RemoteFamily::connector() = [&](const std::string&, const auto&, const auto&, auto&) {
    ++links;
    return std::make_unique<Scripted>(script);
  };
  const auto learner = remote({"sac.hidden:=[4]", "sac.batch_size:=8", "sac.warm_up_steps:=20",
                               "sac.evaluation_episodes:=3"})
                           .makeLearner(0);
  Rng rng(1, 0, Stream::kMeasure);
  learner->beginRound(learner->initialModel(0), false);
  EXPECT_EQ(links, 0) << "nobody has acted yet";
  learner->update(rng);
  EXPECT_EQ(script.seeds.size(), 1u);
  EXPECT_EQ(learner->evaluate(learner->personal(), rng).episodes, 3);
  learner->record(learner->personal(), rng);
  EXPECT_EQ(script.seeds.size(), 1u + 3 + 1);
  EXPECT_EQ(learner->update(rng).broken_episodes, 0);
  EXPECT_EQ(script.seeds.size(), 6u) << "the training episode was cut short: another has begun";
  EXPECT_EQ(links, 1);
  RemoteFamily::connector() = nullptr;
}

TEST(RemoteFamily, AProgramWithoutRosSaysThatItNeedsIt) {
  EXPECT_EQ(errorOf([] { remote({}).makeLearner(0); }),
            "environment.name is remote, whose robots are reached over ROS: use ./pmeta run or "
            "roslaunch.");
}

}  // namespace
}  // namespace pmeta
