#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "goal_learners.h"

namespace pmeta {
namespace {

using test::makeLearner;
using test::run;
using test::sac;
using test::smallSac;

TEST(SacPersonalLearner, EvaluatesWithTheMeanOfItsOwnContext) {
  auto learner = makeLearner(smallSac("inference"));
  learner.beginRound(learner.initialModel(1), false);
  Rng rng(1, 0, Stream::kSample);
  run(learner, 20, rng);
  Rng starts(2, 0, Stream::kEvaluate);
  const Episode episode = learner.record(learner.personal(), starts);
  const float* parameters = learner.personal().floats().data();
  const SacNetworks& networks = sac(learner).networks();
  const LatentPosterior posterior =
      sac(learner).context().posterior(parameters + networks.encoderOffset());
  const std::vector<float> z(posterior.mean.begin(), posterior.mean.end());
  EXPECT_EQ(learner.taskInput(learner.personal()), z);
  GaussianActor actor(networks.actor(), z, 1, GaussianActor::By::kMean, parameters);
  ASSERT_EQ(episode.actions.size(), 10u);
  for (std::size_t t = 0; t < episode.actions.size(); ++t) {
    const std::vector<float> seen(&episode.observations[2 * t], &episode.observations[2 * t] + 2);
    double action = 0;
    actor.look(seen.data(), {0});
    actor.act(0, rng, &action);
    EXPECT_EQ(episode.actions[t], action);
  }
}

TEST(SacPersonalLearner, AdaptedReturnsCompareLikeWithLike) {
  auto learner = makeLearner(smallSac("inference"));
  Model policy = learner.initialModel(1);
  Rng rng(3, 0, Stream::kEvaluate), same = rng;
  const std::vector<AdaptedReturn> returns = learner.evaluateAdapted(policy, rng);
  ASSERT_EQ(returns.size(), 2u);
  EXPECT_EQ(returns[0].context_episodes, 0);
  EXPECT_EQ(returns[1].context_episodes, 2);
  EXPECT_EQ(returns[0].stats.episodes, 4);
  EXPECT_NE(returns[0].stats.mean, returns[1].stats.mean);
  // nothing was collected, so evaluate() has the prior's mean for z
  EXPECT_EQ(learner.evaluate(policy, same).mean, returns[0].stats.mean);
  // an actor blind to z gains nothing: the starts are the same
  const Mlp& actor = sac(learner).networks().actor();
  for (std::size_t o = 0; o < 8; ++o) {
    for (std::size_t i = 2; i < 4; ++i) policy.floats()[o * actor.inputs() + i] = 0;
  }
  const std::vector<AdaptedReturn> blind = learner.evaluateAdapted(policy, rng);
  EXPECT_EQ(blind[0].stats.mean, blind[1].stats.mean);
}

TEST(SacPersonalLearner, MetaPoliciesAreJudgedAfterEachNumberOfEpisodesAskedFor) {
  SacSettings settings = smallSac("inference");
  settings.context.exploration_episodes = {1, 3};
  const auto learner = makeLearner(settings);
  Rng rng(3, 0, Stream::kEvaluate), same = rng;
  const Model policy = learner.initialModel(1);
  const std::vector<AdaptedReturn> returns = learner.evaluateAdapted(policy, rng);
  ASSERT_EQ(returns.size(), 3u);
  EXPECT_EQ(returns[0].context_episodes, 0);
  EXPECT_EQ(returns[1].context_episodes, 1);
  EXPECT_EQ(returns[2].context_episodes, 3);
  EXPECT_EQ(returns[0].task_input, std::vector<float>(2));
  EXPECT_NE(returns[1].task_input, returns[2].task_input);
  const Episode episode = learner.recordAdapted(policy, returns[2], same);
  const std::unique_ptr<Actor> actor =
      learner.learner().policies().actor(policy, returns[2].task_input, 1);
  const std::vector<float> start(episode.observations.begin(), episode.observations.begin() + 2);
  double action = 0;
  actor->look(start.data(), {0});
  actor->act(0, same, &action);
  EXPECT_EQ(episode.actions[0], action);
}

TEST(SacPersonalLearner, WithoutAnEncoderThereIsNothingToAdapt) {
  const auto learner = makeLearner();
  Rng rng(3, 0, Stream::kEvaluate), same = rng;
  const std::vector<AdaptedReturn> returns = learner.evaluateAdapted(learner.initialModel(1), rng);
  ASSERT_EQ(returns.size(), 1u);
  EXPECT_EQ(returns[0].context_episodes, 0);
  EXPECT_EQ(returns[0].stats.mean, learner.evaluate(learner.initialModel(1), same).mean);
}

}  // namespace
}  // namespace pmeta
