#include "pmeta_core/act/evaluation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "../support.h"

namespace pmeta {
namespace {

// acts by a function of all observations at once; an action is one number
class FunctionActor : public Actor {
 public:
  using Function = std::function<void(const float* observations, int batch, double* actions)>;

  explicit FunctionActor(Function function) : function_(std::move(function)) {}
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    actions_.resize(envs.size());
    function_(observations, static_cast<int>(envs.size()), actions_.data());
  }
  bool act(std::size_t row, Rng&, double* action) override {
    *action = actions_[row];
    return knows;
  }

  bool knows = true;

 private:
  Function function_;
  std::vector<double> actions_;
};

// counts up from a random start by the action; ends above 10, or after 20 steps
class Counter : public Env {
 public:
  Counter() {
    spec_.name = "counter";
    spec_.observation_size = 2;
    spec_.action_size = 1;
    spec_.horizon = 20;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    value_ = static_cast<double>(rng.below(8));
    steps_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng&, double* observation) override {
    value_ += action[0];
    ++steps_;
    observe(observation);
    return {value_, value_ > 10, steps_ == spec_.horizon};
  }
  std::vector<double> configuration() const override { return {value_, 7, value_}; }

 private:
  void observe(double* observation) const {
    observation[0] = value_;
    observation[1] = -value_;
  }
  EnvSpec spec_;
  double value_ = 0;
  int steps_ = 0;
};

Evaluation makeEvaluation(int episodes) {
  std::vector<std::unique_ptr<Env>> envs;
  for (int i = 0; i < episodes; ++i) envs.push_back(std::make_unique<Counter>());
  return Evaluation(std::move(envs));
}

// even numbers go up by one, odd ones by three
double actionAt(float observation) { return std::fmod(observation, 2.0f) == 0 ? 1 : 3; }

void actions(const float* observations, int batch, double* actions) {
  for (int b = 0; b < batch; ++b) {
    EXPECT_EQ(observations[2 * b + 1], -observations[2 * b]) << "rows stay together";
    actions[b] = actionAt(observations[2 * b]);
  }
}

double returnFrom(double value) {
  double sum = 0;
  for (int t = 0; t < 20 && value <= 10; ++t) {
    value += actionAt(static_cast<float>(value));
    sum += value;
  }
  return sum;
}

// one step of dense reward -5 that counts 3
class Sparse : public Env {
 public:
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng&, double* observation) override { observation[0] = 0; }
  Step step(const double*, Rng&, double* observation) override {
    observation[0] = 0;
    return {-5, true, false, 3};
  }

 private:
  EnvSpec spec_{"sparse", 1, 1, 0, 1};
};

TEST(Evaluation, CountsTheSparseRewardWhereThereIsOne) {
  std::vector<std::unique_ptr<Env>> envs;
  envs.push_back(std::make_unique<Sparse>());
  Evaluation evaluation(std::move(envs));
  Rng rng(1, 0, Stream::kEvaluate);
  FunctionActor still([](const float*, int, double* actions) { actions[0] = 0; });
  EXPECT_EQ(evaluation.run(still, rng).mean, 3);
  const Episode episode = evaluation.record(still, rng);
  EXPECT_EQ(episode.rewards, std::vector<double>{3});
  EXPECT_EQ(episode.position_size, 0) << "where the observation says all";
  EXPECT_TRUE(episode.positions.empty());
}

TEST(Evaluation, IsTheMeanOverEpisodesRunOneByOne) {
  for (const int episodes : {1, 2, 10, 37}) {
    Evaluation evaluation = makeEvaluation(episodes);
    FunctionActor act(actions);
    Rng rng(1, 0, Stream::kEvaluate), same = rng;
    std::vector<double> returns;
    double mean = 0, squares = 0;
    for (int i = 0; i < episodes; ++i) {
      returns.push_back(returnFrom(static_cast<double>(same.below(8))));
      mean += returns.back() / episodes;
    }
    for (const double value : returns) squares += (value - mean) * (value - mean) / episodes;
    const ReturnStats stats = evaluation.run(act, rng);
    EXPECT_EQ(stats.episodes, episodes);
    EXPECT_NEAR(stats.mean, mean, 1e-12);
    EXPECT_NEAR(stats.std, std::sqrt(squares), 1e-6);
  }
}

TEST(Evaluation, FewerEnvironmentsTakeTurnsWithTheSameEpisodes) {
  for (const int width : {1, 3}) {
    const auto make = [](int) { return std::make_unique<Counter>(); };
    Evaluation in_turns(makeEnvs(make, width), 7);
    Evaluation at_once = makeEvaluation(7);
    FunctionActor act(actions);
    Rng rng(1, 0, Stream::kEvaluate), same = rng;
    const ReturnStats stats = in_turns.run(act, rng);
    const ReturnStats expected = at_once.run(act, same);
    EXPECT_EQ(in_turns.width(), static_cast<std::size_t>(width));
    EXPECT_EQ(stats.episodes, 7);
    EXPECT_EQ(stats.mean, expected.mean);
    EXPECT_EQ(stats.std, expected.std);
  }
}

TEST(Evaluation, StopsAtTheHorizon) {
  Evaluation evaluation = makeEvaluation(3);
  int calls = 0;
  Rng rng(2, 0, Stream::kEvaluate);
  FunctionActor still([&](const float*, int batch, double* actions) {
    ++calls;
    for (int b = 0; b < batch; ++b) actions[b] = 0;
  });
  evaluation.run(still, rng);
  EXPECT_EQ(calls, 20);
}

TEST(Evaluation, RecordsTheFirstEpisode) {
  Evaluation evaluation = makeEvaluation(5);
  FunctionActor act(actions);
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Rng rng(seed, 0, Stream::kEvaluate), same = rng;
    const Episode e = evaluation.record(act, rng);
    double value = static_cast<double>(same.below(8));
    EXPECT_EQ(e.observation_size, 2);
    EXPECT_EQ(e.action_size, 1);
    ASSERT_EQ(e.observations.size(), 2 * (e.rewards.size() + 1));
    ASSERT_EQ(e.actions.size(), e.rewards.size());
    EXPECT_EQ(e.position_size, 3);
    ASSERT_EQ(e.positions.size(), 3 * (e.rewards.size() + 1));
    EXPECT_EQ(e.observations[0], value);
    EXPECT_EQ(e.positions[2], value);
    double sum = 0;
    for (std::size_t t = 0; t < e.rewards.size(); ++t) {
      EXPECT_EQ(e.actions[t], actionAt(static_cast<float>(value)));
      value += e.actions[t];
      EXPECT_EQ(e.observations[2 * t + 2], value);
      EXPECT_EQ(e.positions[3 * t + 3], value);
      EXPECT_EQ(e.positions[3 * t + 4], 7);
      sum += e.rewards[t];
    }
    EXPECT_TRUE(e.terminated);
    EXPECT_FALSE(e.truncated);
    EXPECT_EQ(sum, returnFrom(e.observations[0]));
  }
}

// gives reward 1 a step and breaks down at its own, 0 being the start
class Fragile : public Env {
 public:
  explicit Fragile(int breaks_at) : breaks_at_(breaks_at) {}
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng&, double* observation) override {
    steps_ = 0;
    if (breaks_at_ == 0) throw BrokenEpisode("fragile, step 0: it broke");
    observation[0] = 0;
  }
  Step step(const double*, Rng&, double* observation) override {
    observation[0] = ++steps_;
    if (steps_ == breaks_at_) throw BrokenEpisode("fragile: it broke");
    return {1, false, steps_ == spec_.horizon};
  }

 private:
  EnvSpec spec_{"fragile", 1, 1, 0, 5};
  int breaks_at_;
  int steps_ = 0;
};

TEST(Evaluation, AnEpisodeThatBreaksDownCountsWithItsReturnUntilThen) {
  std::vector<std::unique_ptr<Env>> envs;
  for (const int breaks_at : {3, 9, 0, 1}) envs.push_back(std::make_unique<Fragile>(breaks_at));
  Evaluation evaluation(std::move(envs));
  Rng rng(1, 0, Stream::kEvaluate);
  FunctionActor still(
      [](const float*, int batch, double* actions) { std::fill_n(actions, batch, 0); });
  for (int again = 0; again < 2; ++again) {
    const ReturnStats stats = evaluation.run(still, rng);
    EXPECT_EQ(stats.episodes, 4);
    EXPECT_EQ(stats.broken_episodes, 3);
    EXPECT_EQ(stats.mean, (2 + 5 + 0 + 0) / 4.0);
  }
  const Episode episode = evaluation.record(still, rng);
  EXPECT_EQ(episode.rewards, (std::vector<double>{1, 1}));
  EXPECT_EQ(episode.observations, (std::vector<double>{0, 1, 2})) << "without what broke it";
  EXPECT_TRUE(episode.truncated);
  EXPECT_FALSE(episode.terminated);
}

TEST(Evaluation, ExploringTellsWhetherTheEpisodeBrokeDown) {
  for (const int breaks_at : {0, 3, 9}) {
    std::vector<std::unique_ptr<Env>> envs;
    envs.push_back(std::make_unique<Fragile>(breaks_at));
    Evaluation evaluation(std::move(envs));
    Rng rng(1, 0, Stream::kEvaluate);
    int looks = 0;
    FunctionActor still([&](const float*, int, double* actions) {
      ++looks;
      actions[0] = 0;
    });
    EXPECT_EQ(evaluation.explore(still, rng), breaks_at == 9);
    EXPECT_EQ(looks, std::min(breaks_at, 5));
  }
}

TEST(Evaluation, AnActorThatKnowsNoActionIsAnError) {
  Evaluation evaluation = makeEvaluation(2);
  FunctionActor lost(actions);
  lost.knows = false;
  Rng rng(1, 0, Stream::kEvaluate);
  EXPECT_EQ(test::errorOf([&] { evaluation.run(lost, rng); }),
            "the policy knows no action where an episode of counter has come to.");
}

}  // namespace
}  // namespace pmeta
