// Soft actor-critic on the trajectories of all tasks.
#include "pmeta_core/baselines/pooled_sac.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "baselines/opposite_goals.h"
#include "memory_state.h"
#include "support.h"

namespace pmeta {
namespace {

PooledSacSettings smallPooled(const std::string& task_encoding) {
  PooledSacSettings settings;
  settings.sac.task_encoding = task_encoding;
  settings.sac.hidden = {32, 32};
  settings.sac.batch_size = 64;
  settings.sac.buffer_size = 5000;
  settings.sac.gamma = 0.9;
  settings.sac.reward_scale = 5;
  settings.sac.warm_up_steps = 200;
  settings.sac.env_steps_per_update = 40;
  settings.updates_per_iteration = 40;
  settings.learning_rate = 3e-3;
  return settings;
}

void train(PooledSac& learner, int iterations) {
  learner.setModel(test::initialModel(learner, 1));
  for (int k = 0; k < iterations; ++k) learner.iterate(1, static_cast<std::uint64_t>(k));
}

TEST(PooledSac, ToldItsTaskItReachesOppositeGoals) {
  PooledSac learner(test::oppositeGoals(), smallPooled("one_hot"));
  train(learner, 40);
  EXPECT_GT(test::evaluateOnGoals(learner, {}).worse(0), -7);
}

TEST(PooledSac, WithAHeadForEachTaskToo) {
  PooledSac learner(test::oppositeGoals(), smallPooled("multi_head"));
  train(learner, 40);
  EXPECT_GT(test::evaluateOnGoals(learner, {}).worse(0), -7);
}

TEST(PooledSac, EachTaskHasALastLayerOfItsOwn) {
  const PooledSac learner(test::oppositeGoals(), smallPooled("multi_head"));
  std::map<std::string, std::size_t> rows;
  for (const Block& block : learner.model().layout.blocks()) rows[block.name] = block.shape[0];
  EXPECT_EQ(rows["actor.layer2.weight"], 2u * 4);  // mean and log_std of two numbers of an action
  EXPECT_EQ(rows["critic2.layer2.weight"], 2u * 1);
}

TEST(PooledSac, NotToldItCannot) {
  PooledSac learner(test::oppositeGoals(), smallPooled("none"));
  train(learner, 20);
  EXPECT_LT(test::evaluateOnGoals(learner, {}).mean(0), -19.9);
}

TEST(PooledSac, WithGradientSurgeryToo) {
  PooledSacSettings settings = smallPooled("one_hot");
  settings.gradient_surgery = true;
  PooledSac learner(test::oppositeGoals(), settings);
  train(learner, 40);
  EXPECT_GT(test::evaluateOnGoals(learner, {}).worse(0), -7);
}

TEST(PooledSac, ThreadsChangeNothing) {
  std::vector<Model> models;
  for (const int threads : {1, 2}) {
    PooledSac learner(test::oppositeGoals(0, threads), smallPooled("one_hot"));
    train(learner, 2);
    models.push_back(learner.model());
  }
  EXPECT_EQ(models[0], models[1]);
}

TEST(PooledSac, ResumedIsUninterrupted) {
  PooledSac whole(test::oppositeGoals(), smallPooled("one_hot"));
  train(whole, 3);
  PooledSac first(test::oppositeGoals(), smallPooled("one_hot"));
  train(first, 1);
  test::MemoryState state;
  test::MemoryWriter writer(state);
  writer.part("learner", first);
  PooledSac second(test::oppositeGoals(), smallPooled("one_hot"));
  second.setModel(first.model());
  test::MemoryReader reader(state);
  reader.part("learner", second);
  for (std::uint64_t k = 1; k < 3; ++k) second.iterate(1, k);
  EXPECT_EQ(second.model(), whole.model());
}

TEST(PooledSac, ABatchHasARowForEachTask) {
  PooledSacSettings settings = smallPooled("none");
  settings.sac.batch_size = 1;
  EXPECT_EQ(test::errorOf([&] { PooledSac(test::oppositeGoals(), settings); }),
            "pooled_sac.batch_size is 1 but must have a row for each of the 2 tasks.");
}

}  // namespace
}  // namespace pmeta
