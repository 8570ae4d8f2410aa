// MAML-TRPO and ProMP learn to adapt, the same with any number of threads, and go on as they were.
#include "pmeta_core/baselines/maml.h"

#include <gtest/gtest.h>

#include "baselines/opposite_goals.h"
#include "memory_state.h"
#include "pmeta_core/baselines/maml_trpo.h"
#include "pmeta_core/baselines/promp.h"
#include "support.h"

namespace pmeta {
namespace {

MamlSettings smallMaml() {
  MamlSettings maml;
  maml.hidden = {32, 32};
  maml.action_scale = 1;
  maml.episodes = 20;
  maml.inner_loss = "log_likelihood";
  return maml;
}

void train(MetaLearner& learner, int iterations) {
  learner.setModel(test::initialModel(learner, 1));
  for (int k = 0; k < iterations; ++k) learner.iterate(1, static_cast<std::uint64_t>(k));
}

TEST(Maml, TrpoLearnsToAdaptToOppositeGoals) {
  MamlTrpoSettings settings;
  settings.maml = smallMaml();
  MamlTrpo learner(test::oppositeGoals(), settings);
  train(learner, 30);
  const test::GoalReturns goals = test::evaluateOnGoals(learner, {20});
  EXPECT_GT(goals.mean(1), -8.5);
  EXPECT_GT(goals.worse(1), -9.5);
  EXPECT_NEAR(goals.mean(0), -20, 1);
}

TEST(Maml, PrompLearnsToAdaptToOppositeGoals) {
  ProMpSettings settings;
  settings.maml = smallMaml();
  settings.learning_rate = 3e-3;
  ProMp learner(test::oppositeGoals(), settings);
  train(learner, 30);
  const test::GoalReturns goals = test::evaluateOnGoals(learner, {20});
  EXPECT_GT(goals.mean(1), -8.5);
  EXPECT_GT(goals.worse(1), -9.5);
}

TEST(Maml, AnUntrainedPolicyIsEvaluatedToo) {
  const MamlTrpo learner(test::oppositeGoals(), {smallMaml(), {}});
  const test::GoalReturns goals = test::evaluateOnGoals(learner, {2});
  EXPECT_EQ(goals.episodes, (std::vector<int>{0, 2}));
  EXPECT_NEAR(goals.returns[0].first, goals.returns[0].second, 1);
}

TEST(Maml, CountsStepsOfEachTaskBeforeAndAfterTheInnerStep) {
  MamlSettings maml = smallMaml();
  maml.episodes = 3;
  maml.meta_batch = 4;
  MamlTrpo learner(test::oppositeGoals(), {maml, {}});
  learner.setModel(test::initialModel(learner, 1));
  const IterationStats stats = learner.iterate(1, 0);
  EXPECT_EQ(stats.env_steps, (std::vector<std::int64_t>(2, 2 * 2 * 3 * 20)));
  EXPECT_EQ(stats.updates, 1);
  EXPECT_EQ(learner.losses()[0].name, "return after the inner step");
}

TEST(Maml, ThreadsChangeNothing) {
  ProMpSettings settings;
  settings.maml = smallMaml();
  settings.maml.meta_batch = 6;
  std::vector<Model> models;
  for (const int threads : {1, 3}) {
    ProMp learner(test::oppositeGoals(0, threads), settings);
    train(learner, 3);
    models.push_back(learner.model());
  }
  EXPECT_EQ(models[0], models[1]);
}

TEST(Maml, ResumedIsUninterrupted) {
  ProMpSettings settings;
  settings.maml = smallMaml();
  settings.maml.episodes = 4;
  settings.kl_target = 0.01;
  ProMp whole(test::oppositeGoals(), settings);
  train(whole, 4);

  ProMp first(test::oppositeGoals(), settings);
  train(first, 2);
  test::MemoryState state;
  test::MemoryWriter writer(state);
  writer.part("learner", first);
  ProMp second(test::oppositeGoals(), settings);
  second.setModel(first.model());
  test::MemoryReader reader(state);
  reader.part("learner", second);
  for (std::uint64_t k = 2; k < 4; ++k) second.iterate(1, k);
  EXPECT_EQ(second.model(), whole.model());
}

TEST(Maml, RefusesABatchThatIsNoMultipleOfTheTasks) {
  MamlSettings maml;
  maml.meta_batch = 3;
  EXPECT_EQ(test::errorOf([&] { check("promp.", maml, 2); }),
            "promp.meta_batch is 3 but must be a multiple of the 2 training tasks, or 0 for one "
            "adaptation of each.");
}

}  // namespace
}  // namespace pmeta
