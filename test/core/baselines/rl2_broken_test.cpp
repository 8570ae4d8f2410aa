// What becomes of RL²'s trials where simulations break down.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "baselines/opposite_goals.h"
#include "pmeta_core/baselines/rl2.h"

namespace pmeta {
namespace {

Rl2Settings smallSettings() {
  Rl2Settings settings;
  settings.hidden = 8;
  settings.head = {6};
  settings.episodes = 2;
  return settings;
}

// breaks down at the given steps, counted over all episodes
class BrittlePoint : public test::DensePoint {
 public:
  BrittlePoint(std::int64_t first, std::int64_t every)
      : DensePoint(SparsePointTask{}), first_(first), every_(every) {}
  Step step(const double* action, Rng& rng, double* observation) override {
    const Step step = DensePoint::step(action, rng, observation);
    const std::int64_t count = steps_++;
    if (count >= first_ && (count - first_) % every_ == 0) throw BrokenEpisode("it broke");
    return step;
  }

 private:
  std::int64_t first_, every_, steps_ = 0;
};

class BrittleGoals : public test::OppositeGoals {
 public:
  BrittleGoals(std::int64_t first, std::int64_t every) : first_(first), every_(every) {}
  std::unique_ptr<Env> create(int) const override {
    return std::make_unique<BrittlePoint>(first_, every_);
  }

 private:
  std::int64_t first_, every_;
};

TEST(Rl2, ATrialGoesOnAfterAnEpisodeThatBrokeDown) {
  Rl2Settings settings = smallSettings();
  settings.trials = 4;
  // each environment's first episode breaks down at its 8th step
  Rl2 rl2({std::make_shared<BrittleGoals>(7, 1000)}, settings);
  rl2.setModel(test::initialModel(rl2, 1));
  const IterationStats stats = rl2.iterate(0, 0);
  EXPECT_EQ(stats.broken_episodes, 4);
  EXPECT_EQ(stats.env_steps, (std::vector<std::int64_t>{2 * 27, 2 * 27}));
  EXPECT_TRUE(std::isfinite(rl2.losses().front().value));
}

TEST(Rl2, GivesUpWhereOneEpisodeAfterTheOtherBreaksDown) {
  Rl2Settings settings = smallSettings();
  settings.trials = settings.minibatches = 2;
  Rl2 rl2({std::make_shared<BrittleGoals>(0, 1)}, settings);
  rl2.setModel(test::initialModel(rl2, 1));
  const Model before = rl2.model();
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_EQ(rl2.iterate(0, i).updates, 0);
  EXPECT_TRUE(rl2.model() == before);
  EXPECT_THROW(rl2.iterate(0, 4), BrokenEpisode);
}

}  // namespace
}  // namespace pmeta
