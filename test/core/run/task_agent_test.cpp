#include "pmeta_core/run/task_agent.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <regex>

#include "../support.h"
#include "pmeta_core/run/meta_aggregator.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;

MetaPolicy firstMeta(const Experiment& experiment) {
  return MetaAggregator(experiment).metaPolicy();
}

// a policy with other values, as if published after `round` aggregations
MetaPolicy laterMeta(const Experiment& experiment, int round) {
  MetaPolicy meta = firstMeta(experiment);
  meta.round = round;
  for (std::size_t k = 0; k < meta.model.size(); ++k) {
    meta.model.doubles()[k] = -std::fmod(k * 0.37 + round, 9);
  }
  return meta;
}

TEST(TaskAgent, ReportsItsRound) {
  const Experiment experiment = gridExperiment({"q_learning.updates:=2"});
  TaskAgent agent(experiment, 1);
  const MetaPolicy meta = laterMeta(experiment, 4);
  const auto result = agent.trainRound(meta);
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(agent.task(), 1);
  EXPECT_EQ(result->update.run_id, "run");
  EXPECT_EQ(result->update.task, 1);
  EXPECT_EQ(result->update.round, 5);
  EXPECT_EQ(result->update.weight, 1);
  EXPECT_EQ(result->personal->run_id, "run");
  EXPECT_EQ(result->personal->round, 5);
  EXPECT_EQ(result->personal->task, 1);
  EXPECT_EQ(result->personal->policy, PolicyKind::kPersonal);
  EXPECT_EQ(result->personal->split, Split::kTrain);
  EXPECT_EQ(result->personal->episodes, 24);
  EXPECT_EQ(result->personal->updates, 3 * 2);
  EXPECT_EQ(result->personal->env_steps, 3 * 2 * 2 * 24 * 4);
  EXPECT_GT(result->loss, 0);
  EXPECT_GT(result->distance, 0);
}

TEST(TaskAgent, SendsAuxiliaryOrPersonalParametersAsTheAlgorithmSays) {
  // beside the agent, a learner that sees the same draws
  for (const std::string algorithm : {"pmeta", "model_averaging", "independent"}) {
    const Experiment experiment = gridExperiment({"algorithm:=" + algorithm});
    TaskAgent agent(experiment, 2);
    const MetaPolicy meta = laterMeta(experiment, 0);
    const auto result = agent.trainRound(meta);
    const auto learner = experiment.makeLearner(2);
    Rng rng(0, 2, Stream::kSample, 1);
    learner->beginRound(meta.model, false);
    for (int r = 0; r < 3; ++r) learner->update(rng);
    ASSERT_FALSE(learner->personal() == learner->auxiliary());
    EXPECT_TRUE(result->update.model ==
                (algorithm == "pmeta" ? learner->auxiliary() : learner->personal()))
        << algorithm;
    EXPECT_EQ(result->distance, distance(learner->personal(), meta.model));
    EXPECT_EQ(result->personal->mean, learner->evaluate(learner->personal(), rng).mean);
  }
}

TEST(TaskAgent, ARestartedAgentSendsWhatOneThatNeverStoppedSends) {
  const Experiment experiment = gridExperiment({"personal_init:=meta"});
  TaskAgent steady(experiment, 3);
  for (int round = 0; round < 5; ++round) {
    const MetaPolicy meta = laterMeta(experiment, round);
    const auto expected = steady.trainRound(meta);
    TaskAgent restarted(experiment, 3);
    const auto found = restarted.trainRound(meta);
    EXPECT_TRUE(found->update.model == expected->update.model) << "round " << round;
    EXPECT_EQ(found->personal->mean, expected->personal->mean);
    EXPECT_EQ(found->distance, expected->distance);
  }
}

TEST(TaskAgent, KeptParametersDependOnThePast) {
  const Experiment experiment = gridExperiment({"personal_init:=keep"});
  TaskAgent steady(experiment, 3), restarted(experiment, 3);
  steady.trainRound(laterMeta(experiment, 0));
  const MetaPolicy meta = laterMeta(experiment, 1);
  EXPECT_FALSE(steady.trainRound(meta)->update.model == restarted.trainRound(meta)->update.model);
}

TEST(TaskAgent, SeedTaskAndRoundEachChangeTheDraws) {
  const Experiment experiment = gridExperiment({"sizes:=[4, 4]"});
  const Experiment other = gridExperiment({"sizes:=[4, 4]", "seed:=1"});
  MetaPolicy meta = laterMeta(experiment, 0);
  const Model base = TaskAgent(experiment, 0).trainRound(meta)->update.model;
  EXPECT_TRUE(TaskAgent(experiment, 0).trainRound(meta)->update.model == base);
  EXPECT_FALSE(TaskAgent(other, 0).trainRound(meta)->update.model == base);
  EXPECT_FALSE(TaskAgent(experiment, 1).trainRound(meta)->update.model == base);
  meta.round = 1;
  EXPECT_FALSE(TaskAgent(experiment, 0).trainRound(meta)->update.model == base);
}

TEST(TaskAgent, StopsWhenToldSo) {
  const Experiment experiment = gridExperiment({"updates_per_round:=5"});
  TaskAgent agent(experiment, 0);
  std::vector<int> seen;
  const auto stopped = agent.trainRound(firstMeta(experiment), [&](int done) {
    seen.push_back(done);
    return done < 3;
  });
  EXPECT_FALSE(stopped.has_value());
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3}));

  // and trains the same round again as if nothing had been
  seen.clear();
  const auto again = agent.trainRound(firstMeta(experiment), [&](int done) {
    seen.push_back(done);
    return true;
  });
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3, 4, 5}));
  EXPECT_TRUE(again->update.model ==
              TaskAgent(experiment, 0).trainRound(firstMeta(experiment))->update.model);
}

TEST(TaskAgent, EvaluatesTheMetaPolicyOnItsTask) {
  const Experiment experiment = gridExperiment();
  TaskAgent agent(experiment, 2);
  const MetaPolicy meta = laterMeta(experiment, 3);
  const std::vector<TaskReturn> results = agent.evaluateMeta(meta);
  ASSERT_EQ(results.size(), 1u);
  const TaskReturn& result = results.front();
  EXPECT_EQ(result.policy, PolicyKind::kMeta);
  EXPECT_EQ(result.round, 3);
  EXPECT_EQ(result.task, 2);
  EXPECT_EQ(result.run_id, "run");
  EXPECT_EQ(result.env_steps, 0);
  EXPECT_EQ(result.updates, 0);
  EXPECT_EQ(result.episodes, 35);
  Rng rng(0, 0, Stream::kMeasure);
  EXPECT_EQ(result.mean, experiment.makeLearner(2)->evaluate(meta.model, rng).mean);
}

TEST(TaskAgent, PoliciesThatDoNotFitAreRefused) {
  const Experiment experiment = gridExperiment();
  TaskAgent agent(experiment, 0);
  MetaPolicy other = firstMeta(gridExperiment({"sizes:=[4, 5]"}));
  const std::string sentence = "the aggregator sent a model of layout " +
                               hexHash(other.model.layout.hash()) + " but this run has " +
                               hexHash(agent.layout().hash()) +
                               ": start it with the same configuration.";
  EXPECT_EQ(errorOf([&] { agent.trainRound(other); }), sentence);
  EXPECT_EQ(errorOf([&] { agent.evaluateMeta(other); }), sentence);
  EXPECT_EQ(errorOf([&] { agent.recordMeta(other); }), sentence);
  MetaPolicy broken = firstMeta(experiment);
  broken.model.doubles()[5] = std::nan("");
  EXPECT_EQ(errorOf([&] { agent.trainRound(broken); }),
            "the aggregator sent a value that is not finite (entry 5).");
}

TEST(TaskAgent, RecordsFromTheSameStartWhateverThePolicyAndRound) {
  const Experiment experiment = gridExperiment();
  TaskAgent agent(experiment, 4);
  agent.trainRound(firstMeta(experiment));
  const Episode personal = agent.recordPersonal();
  EXPECT_EQ(errorOf([&] { agent.recordMeta(laterMeta(experiment, 6)); }),
            "the meta-policy of round 6 has not been evaluated: do that before recording an "
            "episode of it.");
  agent.evaluateMeta(laterMeta(experiment, 6));
  const Episode meta = agent.recordMeta(laterMeta(experiment, 6));
  const std::vector<double> start(personal.observations.begin(), personal.observations.begin() + 2);
  EXPECT_EQ(std::vector<double>(meta.observations.begin(), meta.observations.begin() + 2), start);
  EXPECT_EQ(agent.recordPersonal().observations, personal.observations);

  // drawn from the stream that is for evaluation
  Rng rng(0, 4, Stream::kEvaluate);
  double seen[2];
  experiment.family().make(4)->reset(rng, seen);
  EXPECT_EQ(std::vector<double>(seen, seen + 2), start);
}

TEST(TaskAgent, WatchingDoesNotChangeTraining) {
  const Experiment experiment = gridExperiment({"personal_init:=keep", "slip:=0.2"});
  TaskAgent watched(experiment, 1), alone(experiment, 1);
  for (int round = 0; round < 3; ++round) {
    const MetaPolicy meta = laterMeta(experiment, round);
    watched.evaluateMeta(meta);
    watched.recordMeta(meta);
    const auto a = watched.trainRound(meta), b = alone.trainRound(meta);
    watched.recordPersonal();
    EXPECT_TRUE(a->update.model == b->update.model);
  }
}

TEST(TaskAgent, WhatIsEvaluatedOutsideTheScheduleChangesNothing) {
  const Experiment experiment =
      gridExperiment({"evaluation_interval:=3", "catch_up:=0.5", "rounds:=7"});
  TaskAgent asked(experiment, 1), alone(experiment, 1);
  for (int round = 0; round < 7; ++round) {
    MetaPolicy meta = laterMeta(experiment, round);
    const auto expected = alone.evaluateMeta(meta);
    meta.evaluate = true;
    const auto results = asked.evaluateMeta(meta);
    ASSERT_EQ(results.size(), 1u);
    EXPECT_EQ(results[0].round, round);
    EXPECT_EQ(results[0].scheduled, round % 3 == 0);
    EXPECT_EQ(expected.size(), round % 3 == 0 ? 1u : 0u);

    const auto a = asked.trainRound(meta);
    meta.evaluate = false;
    const auto b = alone.trainRound(meta);
    EXPECT_TRUE(a->update.model == b->update.model);
    EXPECT_EQ(a->update.weight, b->update.weight);
    ASSERT_TRUE(a->personal);
    EXPECT_EQ(a->personal->scheduled, b->personal.has_value());
    EXPECT_EQ(a->personal->updates, 3 * (round % 3 + 1)) << "since the last scheduled one";
    if (!b->personal) continue;
    EXPECT_EQ(a->personal->mean, b->personal->mean);
    EXPECT_EQ(a->personal->updates, b->personal->updates);
    EXPECT_EQ(a->personal->env_steps, b->personal->env_steps);
  }
}

TEST(TaskAgent, TheRecordedEpisodeIsOfThePolicyWhoseReturnIsShown) {
  const Experiment experiment = Experiment::parse(
      "learner: sac\nrounds: 2\nupdates_per_round: 3\n"
      "environment: {name: half_cheetah_vel, horizon: 10, velocities: [1, 2],"
      " test_velocities: [3]}\n"
      "sac: {hidden: [16, 16], batch_size: 16, warm_up_steps: 50, evaluation_episodes: 1,"
      " task_encoding: inference, exploration_episodes: [1, 2], context_hidden: [8, 8],"
      " context_batch: 16}",
      "test");
  for (const int task : {0, 2}) {
    TaskAgent agent(experiment, task);
    MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
    meta.round = 1;
    const std::vector<TaskReturn> returns = agent.evaluateMeta(meta);
    ASSERT_EQ(returns.size(), 3u);
    const auto sum = [](const Episode& episode) {
      return std::accumulate(episode.rewards.begin(), episode.rewards.end(), 0.0);
    };
    EXPECT_DOUBLE_EQ(sum(agent.recordMeta(meta)), returns[2].mean);
    EXPECT_NE(returns[0].mean, returns[2].mean) << "before exploration it acts in another way";
    EXPECT_NE(returns[1].mean, returns[2].mean);
    if (!agent.trains()) continue;
    const auto result = agent.trainRound(meta);
    EXPECT_DOUBLE_EQ(sum(agent.recordPersonal()), result->personal->mean);
  }
}

TEST(TaskAgent, TasksThatTheMetaPolicyLagsOnCountMore) {
  const Experiment experiment = gridExperiment({"catch_up:=0.5"});
  TaskAgent agent(experiment, 1);
  MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
  EXPECT_EQ(agent.trainRound(meta)->update.weight, 1) << "nothing to compare with yet";
  double log_weight = 0;
  for (int round = 1; round <= 3; ++round) {
    meta.round = round;
    const double behind = agent.evaluateMeta(meta).back().mean;
    const auto result = agent.trainRound(meta);
    const double personal = result->personal->mean;
    ASSERT_GT(personal, behind) << "the initial table knows nothing";
    const double gap = std::min(1.0, (personal - behind) / std::abs(personal));
    log_weight = 0.8 * log_weight + 0.5 * gap;
    EXPECT_NEAR(result->update.weight, std::exp(log_weight), 1e-12);
  }
  // a meta-policy that is ahead lets the weight fade
  MetaPolicy ahead = meta;
  for (int round = 4; round < 20; ++round) {
    ahead.round = round;
    agent.trainRound(ahead);
    ahead.model = agent.personal();
  }
  TaskAgent other(experiment, 1);
  meta.round = 1;
  other.evaluateMeta(meta);
  const double weight = other.trainRound(meta)->update.weight;
  ASSERT_GT(weight, 1);
  ahead.round = 2;
  other.evaluateMeta(ahead);
  meta.round = 2;
  EXPECT_NEAR(other.trainRound(meta)->update.weight, std::pow(weight, 0.8), 1e-12);
}

// a round of training, from the initial meta-policy
std::string trainingError(const Experiment& experiment) {
  TaskAgent agent(experiment, 0);
  try {
    agent.trainRound(firstMeta(experiment));
  } catch (const TaskFailed& failure) {
    return failure.what();
  }
  return "(no failure)";
}

TEST(TaskAgent, ASimulationThatAlwaysBreaksDownFailsTheTask) {
  const test::TempDir dir;
  const std::string model =
      std::regex_replace(test::readFile(PMETA_TEST_DATA "/../../config/models/walker2d.xml"),
                         std::regex("timestep=\"[^\"]*\""), "timestep=\"0.5\"");
  test::writeFile(dir / "walker2d.xml", model);
  const Experiment experiment = Experiment::parse(
      "learner: sac\nupdates_per_round: 3\n"
      "sac: {hidden: [4], batch_size: 4, buffer_size: 100, warm_up_steps: 2000, "
      "evaluation_episodes: 1}\n"
      "environment: {name: walker_2d_params, model_file: " +
          dir.path() + "/walker2d.xml}\n",
      "walker.yaml");
  const std::string error = trainingError(experiment);
  EXPECT_NE(error.find(") failed in round 1: 10 episodes running have broken down, the last one in "
                       "walker_2d_params, step "),
            std::string::npos)
      << error;
  EXPECT_NE(error.find("; take a smaller timestep in the model (environment.model_file)"),
            std::string::npos)
      << error;
}

TEST(TaskAgent, TrainingThatDivergesFailsTheTaskBeforeAnythingIsSent) {
  const Experiment dqn = Experiment::parse(
      "learner: dqn\nupdates_per_round: 30\npersonal: {learning_rate: 1e30}\n"
      "dqn: {hidden: [8], batch_size: 8, num_envs: 2, evaluation_episodes: 1}\n"
      "environment: {name: cart_pole}\n",
      "cart_pole.yaml");
  std::string error = trainingError(dqn);
  EXPECT_EQ(error.rfind("task 0 (" + dqn.family().taskName(0) + ") failed in round 1: ", 0), 0u)
      << error;
  EXPECT_NE(error.find("; lower personal.learning_rate (1e+30), personal.alpha"), std::string::npos)
      << error;

  const Experiment sac = Experiment::parse(
      "learner: sac\nupdates_per_round: 30\npersonal: {learning_rate: 1e30}\n"
      "sac: {hidden: [8], batch_size: 8, warm_up_steps: 20, evaluation_episodes: 1}\n"
      "environment: {name: half_cheetah_dir, horizon: 20}\n",
      "half_cheetah_dir.yaml");
  error = trainingError(sac);
  EXPECT_NE(error.find("; lower personal.learning_rate (1e+30)"), std::string::npos) << error;
}

TEST(TaskAgent, AMetaPolicyThatCannotBeEvaluatedFailsTheTask) {
  const Experiment experiment = Experiment::parse(
      "learner: sac\nsac: {hidden: [8], evaluation_episodes: 1}\n"
      "environment: {name: half_cheetah_dir, horizon: 20}\n",
      "half_cheetah_dir.yaml");
  MetaPolicy meta = firstMeta(experiment);
  meta.round = 1;
  for (float& value : meta.model.floats()) value = 3e38f;
  TaskAgent agent(experiment, 0);
  EXPECT_THROW(agent.evaluateMeta(meta), TaskFailed);
}

TEST(TaskAgent, TellsAllLossesOfItsLastUpdate) {
  const Experiment experiment = gridExperiment();
  TaskAgent agent(experiment, 0);
  MetaPolicy meta;
  meta.model = experiment.makeLearner(0)->initialModel(0);
  const auto result = agent.trainRound(meta);
  ASSERT_TRUE(result);
  ASSERT_EQ(result->losses.size(), 1u);
  EXPECT_EQ(result->losses.front().name, "td");
  EXPECT_EQ(result->losses.front().value, result->loss);
  ASSERT_TRUE(result->personal);
  ASSERT_EQ(result->personal->losses.size(), 1u);
  EXPECT_EQ(result->personal->losses.front().name, "td");
  EXPECT_EQ(result->personal->losses.front().value, result->loss);
}

}  // namespace
}  // namespace pmeta
