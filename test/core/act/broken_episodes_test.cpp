#include "pmeta_core/act/broken_episodes.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <utility>

#include "../memory_state.h"
#include "../support.h"
#include "pmeta_core/learn/sac.h"

namespace pmeta {
namespace {

using test::errorOf;

TEST(BrokenEpisodes, TheTenthRunningIsOneTooMany) {
  BrokenEpisodes broken(9);
  const BrokenEpisode episode("env, step 3: qpos[0] is not finite");
  for (int i = 0; i < 9; ++i) broken.broke(episode);
  broken.ended();
  for (int i = 0; i < 9; ++i) broken.broke(episode);
  EXPECT_EQ(broken.count(), 18);

  BrokenEpisodes loaded(9);
  test::load(loaded, test::stateOf(broken));
  EXPECT_EQ(loaded.count(), 18);
  EXPECT_EQ(errorOf([&] { loaded.broke(episode); }),
            "10 episodes running have broken down, the last one in env, step 3: qpos[0] is not "
            "finite; the episode cannot go on, reset it.");
  EXPECT_EQ(loaded.count(), 19);
}

TEST(BrokenEpisodes, WhereNoneIsForgivenTheFirstIsGivenOn) {
  BrokenEpisodes broken(0);
  EXPECT_EQ(errorOf([&] { broken.broke(BrokenEpisode("env, step 3: it broke")); }),
            "env, step 3: it broke; the episode cannot go on, reset it.");
}

// counts episodes in its observation; of those in `broken` the third step breaks
class Fragile : public Env {
 public:
  explicit Fragile(std::set<int> broken, bool starts = true)
      : broken_(std::move(broken)), starts_(starts) {}
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng&, double* observation) override {
    if (!starts_) throw BrokenEpisode("fragile, step 0: too many contacts");
    ++episode_;
    steps_ = 0;
    write(observation);
  }
  Step step(const double*, Rng&, double* observation) override {
    ++steps_;
    write(observation);
    if (steps_ == 3 && broken_.count(episode_) > 0) throw BrokenEpisode("fragile: it broke");
    return {1, false, steps_ == spec_.horizon};
  }

 private:
  void write(double* observation) const {
    observation[0] = episode_;
    observation[1] = steps_;
  }
  EnvSpec spec_{"fragile", 2, 1, 0, 5};
  std::set<int> broken_;
  bool starts_;
  int episode_ = 0;
  int steps_ = 0;
};

SacSettings settings(const std::string& encoding = "none") {
  SacSettings s;
  s.hidden = {4};
  s.batch_size = 4;
  s.buffer_size = 200;
  s.warm_up_steps = 30;
  s.env_steps_per_update = 1;
  s.task_encoding = encoding;
  s.context.hidden = {4};
  return s;
}

std::vector<float> parametersOf(const SacLearner& learner) {
  std::size_t size = 0;
  for (const Block& block : learner.networks().blocks()) size += block.size();
  std::vector<float> parameters(size);
  Rng rng(1, 0, Stream::kInitialise);
  learner.networks().initialise(parameters.data(), rng);
  return parameters;
}

TEST(BrokenEpisodes, ABrokenStepNeverEntersTheReplayAndTrainingGoesOn) {
  SacLearner learner(std::make_unique<Fragile>(std::set<int>{1, 3, 4}), settings());
  const std::vector<float> parameters = parametersOf(learner);
  Rng rng(1, 0, Stream::kSample);
  EXPECT_EQ(learner.collect(parameters.data(), rng), 31 - 3) << "of 31 steps three broke";
  EXPECT_EQ(learner.brokenEpisodes(), 3);
  ASSERT_EQ(learner.replay().size(), 28u);
  for (std::size_t i = 0; i < learner.replay().size(); ++i) {
    const Transition t = learner.replay()[i];
    EXPECT_EQ(t.next_observation[0], t.observation[0]) << "from one episode into the next";
    EXPECT_EQ(t.next_observation[1], t.observation[1] + 1);
    const int episode = static_cast<int>(t.observation[0]);
    const bool broken = episode == 1 || episode == 3 || episode == 4;
    EXPECT_LT(t.next_observation[1], broken ? 3 : 6);
    EXPECT_GT(t.discount, 0) << "a broken episode is truncated: its last state has a future";
  }
}

TEST(BrokenEpisodes, TrainingGivesUpWhereEachEpisodeBreaks) {
  std::set<int> all;
  for (int episode = 1; episode <= 10; ++episode) all.insert(episode);
  for (const bool starts : {true, false}) {
    SacLearner learner(std::make_unique<Fragile>(all, starts), settings());
    const std::vector<float> parameters = parametersOf(learner);
    Rng rng(1, 0, Stream::kSample);
    EXPECT_THROW(learner.collect(parameters.data(), rng), BrokenEpisode);
    EXPECT_EQ(learner.brokenEpisodes(), BrokenEpisodes::kForgiven + 1);
    EXPECT_EQ(learner.replay().size(), starts ? 20u : 0u);
  }
}

}  // namespace
}  // namespace pmeta
