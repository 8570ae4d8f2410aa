#include "pmeta_core/run/loaded_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "../allocations.h"
#include "../support.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::TempDir;
using testing::HasSubstr;

Experiment cartPole(const std::vector<std::string>& overrides = {}) {
  return Experiment::parse(R"(
experiment: cart
run_id: run
results_dir: /tmp/pmeta_unused
learner: dqn
rounds: 2
updates_per_round: 20
personal: {learning_rate: 0.003, alpha: 0.001, lambda: 20, eta: 0.01}
dqn: {hidden: [32, 24], batch_size: 16, buffer_size: 2000, num_envs: 2, evaluation_episodes: 3}
environment: {name: cart_pole}
)",
                           "cart.yaml", overrides);
}

struct Trained {
  TempDir dir;
  Experiment experiment;
  std::string policies;

  explicit Trained(Experiment plain)
      : experiment(Experiment::parse(plain.yaml(), "test", {"results_dir:=" + dir.path()})),
        policies(experiment.runDir() + "/policies/") {
    RunLog log(experiment);
    runLocally(experiment, &log);
  }
};

// the actions of a whole greedy episode as the learner records it are those of the loaded policy
void expectActsAsRecorded(LoadedPolicy& policy, int task) {
  const auto learner = policy.experiment().makeLearner(task);
  for (std::uint64_t start = 0; start < 5; ++start) {
    Rng rng(start, 0, Stream::kMeasure);
    const Episode episode = learner->record(policy.model(), rng);
    ASSERT_FALSE(episode.actions.empty());
    for (std::size_t t = 0; t < episode.actions.size(); ++t) {
      double action = -1;
      const std::size_t at = t * static_cast<std::size_t>(episode.observation_size);
      ASSERT_TRUE(policy.act(&episode.observations[at], &action));
      ASSERT_EQ(action, episode.actions[t]) << "start " << start << ", step " << t;
    }
  }
}

Experiment point(const std::string& task_encoding) {
  return Experiment::parse(R"(
experiment: point
run_id: run
results_dir: /tmp/pmeta_unused
learner: sac
rounds: 2
updates_per_round: 20
personal: {alpha: 0.001, lambda: 15, eta: 0.01}
sac: {hidden: [12, 10], batch_size: 16, buffer_size: 500, warm_up_steps: 40, context_hidden: [8],
      latent_size: 2, context_batch: 20, evaluation_episodes: 2, task_encoding: )" +
                               task_encoding + "}\nenvironment: {name: sparse_point_robot}\n",
                           "point.yaml");
}

// two numbers an action
std::vector<double> actionOf(LoadedPolicy& policy, double x, double y) {
  const double observation[] = {x, y};
  std::vector<double> action(2);
  EXPECT_TRUE(policy.act(observation, action.data()));
  return action;
}

TEST(LoadedPolicy, ActsAsTheActorOfItsTask) {
  const Trained run(point("one_hot"));
  const Experiment& experiment = run.experiment;
  const LocalResult local = runLocally(experiment);
  const std::string meta = run.policies + "meta.safetensors";
  LoadedPolicy third(meta, 3), first(meta, 0);
  EXPECT_NE(actionOf(third, 0.1, 0.2), actionOf(first, 0.1, 0.2)) << "the task tells";
  const auto learner = experiment.makeLearner(3);
  Rng rng(0, 0, Stream::kMeasure);
  const Episode episode = learner->record(local.meta, rng);
  ASSERT_EQ(episode.action_size, 2);
  for (std::size_t t = 0; t + 1 < episode.rewards.size(); ++t) {
    EXPECT_EQ(actionOf(third, episode.observations[2 * t], episode.observations[2 * t + 1]),
              (std::vector<double>{episode.actions[2 * t], episode.actions[2 * t + 1]}));
  }
  // a personal policy needs not be told
  LoadedPolicy personal(run.policies + "task_3.safetensors");
  EXPECT_EQ(personal.task(), 3);
  actionOf(personal, 0.1, 0.2);
  EXPECT_THAT(errorOf([&] { LoadedPolicy{meta}; }),
              HasSubstr("is a meta-policy that must be told its task: choose one from 0 to 9."));
  EXPECT_THAT(errorOf([&] { LoadedPolicy(meta, 10); }), HasSubstr("choose one from 0 to 9."));
}

TEST(LoadedPolicy, ActsOnTheLatentVectorOfItsFile) {
  const Trained run(point("inference"));
  const std::string path = run.policies + "task_1.safetensors";
  PolicyFile file = loadPolicy(path);
  ASSERT_EQ(file.metadata.count("task_input"), 1u);
  LoadedPolicy as_trained(path);
  file.metadata["task_input"] = "5,-5";
  savePolicy(path, file.model, file.metadata);
  LoadedPolicy elsewhere(path);
  EXPECT_NE(actionOf(as_trained, 0.1, 0.2), actionOf(elsewhere, 0.1, 0.2));
  for (const std::string bad : {"5", "5,-5,1", "5,x", "5,nan", ""}) {
    file.metadata["task_input"] = bad;
    savePolicy(path, file.model, file.metadata);
    EXPECT_THAT(errorOf([&] { LoadedPolicy{path}; }),
                HasSubstr("has a task_input that is not of 2 numbers."))
        << bad;
  }
  LoadedPolicy meta(run.policies + "meta.safetensors");
  actionOf(meta, 0.1, 0.2);
}

// what the run's own evaluation finds out, with the same draws
TEST(LoadedPolicy, ExploresAsEvaluationDoesAndThenActsOnWhatItFound) {
  for (const char* encoding : {"model", "inference"}) {
    const Trained run(point(encoding));
    LoadedPolicy policy(run.policies + "meta.safetensors");
    EXPECT_FALSE(policy.exploring());
    ASSERT_TRUE(policy.explore(7));
    EXPECT_EQ(policy.explorationEpisodes(), 2);

    Rng rng(7, 0, Stream::kEvaluate);
    const std::unique_ptr<Env> env = run.experiment.family().make(4);
    const std::unique_ptr<PolicyFamily> policies = run.experiment.policies(*env);
    const auto adaptation = run.experiment.adaptation(*policies, policy.model());
    for (int episode = 1; episode <= 3; ++episode) {
      std::unique_ptr<Actor> adapted;
      adaptation->beginEpisode(rng);
      if (episode == 3) adapted = adaptation->adapted(1);
      Actor& actor = adapted ? *adapted : *adaptation;
      policy.beginEpisode();
      EXPECT_EQ(policy.episode(), episode);
      EXPECT_EQ(policy.exploring(), episode < 3);
      EXPECT_EQ(policy.observes(), episode < 3);
      std::vector<double> observation = {0.1 * episode, 0.2}, next(2), action(2), expected(2);
      for (int t = 0; t < 10; ++t) {
        const std::vector<float> seen(observation.begin(), observation.end());
        actor.look(seen.data(), {0});
        ASSERT_TRUE(actor.act(0, rng, expected.data()));
        ASSERT_TRUE(policy.act(observation.data(), action.data()));
        EXPECT_EQ(action, expected) << encoding << ", episode " << episode << ", step " << t;
        next = {observation[0] + 0.1 * action[0], observation[1] + 0.1 * action[1]};
        const std::vector<float> next_seen(next.begin(), next.end());
        actor.observe({0, seen.data(), expected.data(), Step{next[0]}, next_seen.data()});
        ASSERT_TRUE(policy.observe(next[0], next.data()));
        observation = next;
      }
      if (!adapted) adaptation->episodeOver();
      EXPECT_EQ(policy.taskWeights(), adaptation->taskWeights());
    }
    const double somewhere[] = {0, 0};
    EXPECT_FALSE(policy.observe(std::nan(""), somewhere));
  }
}

TEST(LoadedPolicy, OnlyAMetaPolicyThatIsNotToldItsTaskExplores) {
  const Trained run(point("model"));
  LoadedPolicy personal(run.policies + "task_1.safetensors");
  EXPECT_FALSE(personal.explore(0));
  LoadedPolicy told(run.policies + "meta.safetensors", 1);
  EXPECT_FALSE(told.explore(0));
  const double observation[] = {0.1, 0.2};
  EXPECT_FALSE(told.observe(1, observation));
  EXPECT_TRUE(told.taskWeights().empty());
  EXPECT_EQ(actionOf(told, 0.1, 0.2), actionOf(told, 0.1, 0.2));
}

TEST(LoadedPolicy, ActsAsTheTableInMemory) {
  const Trained run(gridExperiment({"sizes:=[4, 6]"}));
  for (const int task : {0, 1}) {
    LoadedPolicy policy(run.policies + "task_" + std::to_string(task) + ".safetensors");
    EXPECT_EQ(policy.task(), task);
    EXPECT_EQ(policy.policy(), PolicyKind::kPersonal);
    expectActsAsRecorded(policy, task);
  }
  LoadedPolicy meta(run.policies + "meta.safetensors");
  EXPECT_EQ(meta.task(), -1);
  EXPECT_EQ(meta.round(), 10);
  EXPECT_EQ(meta.description(), "meta-policy of grid, round 10 of run run");
  expectActsAsRecorded(meta, 1);
}

TEST(LoadedPolicy, ActsAsTheNetworkInMemory) {
  for (const std::string dueling : {"false", "true"}) {
    const Trained run(cartPole({"dueling:=" + dueling}));
    LoadedPolicy policy(run.policies + "task_2.safetensors");
    expectActsAsRecorded(policy, 2);
  }
}

TEST(LoadedPolicy, RefusesObservationsThatNoStateHas) {
  const Trained run(gridExperiment({"sizes:=[4, 6]", "rounds:=1"}));
  LoadedPolicy policy(run.policies + "task_0.safetensors");
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  const std::vector<std::vector<double>> unknown = {{nan, 0},  {0, infinity}, {1e300, 0}, {-1, 0},
                                                    {0, -1e9}, {35, 35},      {3, 3},     {4, 4}};
  for (const std::vector<double>& observation : unknown) {
    double action = -1;
    EXPECT_FALSE(policy.act(observation.data(), &action)) << observation[0];
    EXPECT_EQ(action, -1);
  }
  const std::vector<double> known = {2, 3};
  double action = -1;
  EXPECT_TRUE(policy.act(known.data(), &action));
}

TEST(LoadedPolicy, RefusesObservationsThatAreNotFinite) {
  const Trained run(cartPole({"rounds:=1"}));
  LoadedPolicy policy(run.policies + "meta.safetensors");
  std::vector<double> observation(static_cast<std::size_t>(policy.spec().observation_size), 0.01);
  double action = -1;
  EXPECT_TRUE(policy.act(observation.data(), &action));
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e39}) {
    observation[1] = bad;
    EXPECT_FALSE(policy.act(observation.data(), &action));
  }
}

TEST(LoadedPolicy, ActingAllocatesNothing) {
  const Trained grid(gridExperiment({"rounds:=1"})), cart(cartPole({"rounds:=1"}));
  LoadedPolicy table(grid.policies + "task_4.safetensors");
  LoadedPolicy network(cart.policies + "meta.safetensors");
  const std::vector<double> cell = {1, 2};
  const std::vector<double> observation(static_cast<std::size_t>(network.spec().observation_size));
  double action = 0;
  network.act(observation.data(), &action);
  const std::size_t before = test::allocations();
  for (int k = 0; k < 100; ++k) {
    table.act(cell.data(), &action);
    network.act(observation.data(), &action);
  }
  EXPECT_EQ(test::allocations(), before);
}

TEST(LoadedPolicy, RefusesParametersThatDoNotFitTheirSettings) {
  const TempDir dir;
  const std::string path = dir / "policy.safetensors";
  const Experiment grid = gridExperiment();
  const auto error = [&](const std::string& key, const std::string& value) {
    auto metadata = policyMetadata(grid, {PolicyKind::kPersonal, 2, 10});
    metadata[key] = value;
    if (value.empty()) metadata.erase(key);
    savePolicy(path, grid.makeLearner(2)->personal(), metadata);
    return errorOf([&] { LoadedPolicy policy(path); });
  };
  ASSERT_EQ(error("unrelated", "text"), "(no error)");
  EXPECT_EQ(error("settings", ""), "the policy file " + path + " does not say its settings.");
  EXPECT_THAT(error("settings", gridExperiment({"sizes:=[4, 5, 6]"}).yaml()),
              HasSubstr("has parameters that do not fit its own settings."));
  EXPECT_THAT(error("settings", cartPole({"rounds:=10"}).yaml()),
              HasSubstr("do not fit its own settings."));
  EXPECT_THAT(error("settings", cartPole({"rounds:=10", "hidden:=[65536, 65536, 65536]"}).yaml()),
              HasSubstr("do not fit its own settings."));
  EXPECT_THAT(error("settings", "[[["), HasSubstr("the policy file " + path));
  EXPECT_THAT(error("settings", std::string(100000, '[')), HasSubstr("the policy file " + path));
  EXPECT_THAT(error("settings", "lamda: 5\n"), HasSubstr("unknown setting 'lamda'"));
  EXPECT_EQ(error("task", "5"),
            "the policy file " + path + " has a task that is no whole number from 0 to 4.");
  EXPECT_THAT(error("task", "-1"), HasSubstr("has a task that is no whole number"));
  EXPECT_THAT(error("task", ""), HasSubstr("does not say its task."));
  EXPECT_THAT(error("round", "99"), HasSubstr("has a round that is no whole number from 0 to 10."));
  EXPECT_THAT(error("policy", "best"), HasSubstr("is of neither a personal nor a meta policy."));
}

}  // namespace
}  // namespace pmeta
