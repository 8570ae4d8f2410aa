#include "pmeta_core/adapt/task_posterior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

namespace pmeta {
namespace {

// a linear model that knows the rewards of three tasks, whatever happens: f(x, z) = z . rewards
struct Known {
  explicit Known(const std::vector<float>& rewards, TaskModelSettings with = {})
      : settings(std::move(with)) {
    settings.hidden = {};
    model.emplace(1, 1, rewards.size(), settings, true);
    parameters.resize(model->size());
    std::copy(rewards.begin(), rewards.end(), parameters.begin() + 3);
  }
  // looks into what it is of
  TaskPosterior posterior() const& { return TaskPosterior(*model, settings, parameters.data()); }
  TaskPosterior posterior() const&& = delete;

  TaskModelSettings settings;
  std::optional<TaskModel> model;
  std::vector<float> parameters;
};

void observe(TaskPosterior& posterior, float reward, float state = 0.5f) {
  const float action = 0.1f, next = -state;
  posterior.observe({&state, &action, reward, 0, &next});
}

TEST(TaskPosterior, KnowsNothingBeforeAnyTransition) {
  const Known known({1, 2, 3, 4});
  const TaskPosterior posterior = known.posterior();
  EXPECT_EQ(posterior.weights(), std::vector<double>(4, 0.25));
  EXPECT_EQ(posterior.best(), std::vector<float>(4, 0.25f));
}

TEST(TaskPosterior, OneInformativeTransitionTellsTheTask) {
  for (std::size_t task = 0; task < 3; ++task) {
    const Known known({-1, 0, 1});
    TaskPosterior posterior = known.posterior();
    observe(posterior, static_cast<float>(task) - 1);
    std::vector<float> own(3);
    own[task] = 1;
    EXPECT_EQ(posterior.best(), own);
    EXPECT_EQ(posterior.energies()[task], 0);
  }
}

TEST(TaskPosterior, WeightsAreBayesRule) {
  TaskModelSettings settings;
  settings.kappa = 0.3;
  Known known({-1, 0.5f, 2}, settings);
  known.parameters.back() = std::log(0.7f);
  TaskPosterior posterior = known.posterior();
  const std::vector<float> seen = {0.4f, 1, -0.2f};
  for (const float reward : seen) observe(posterior, reward);
  std::vector<double> expected;
  double sum = 0;
  for (const double predicted : {-1.0, 0.5, 2.0}) {
    double energy = 0;
    for (const float reward : seen) energy += std::pow(predicted - reward, 2) / (2 * 0.7);
    expected.push_back(std::exp(-0.3 * energy));
    sum += expected.back();
  }
  for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(posterior.weights()[j], expected[j] / sum, 1e-6);
}

TEST(TaskPosterior, TheVarianceHasAFloor) {
  TaskModelSettings settings;
  settings.least_variance = 0.04;
  Known known({0, 1, 2}, settings);
  known.parameters.back() = -30;
  TaskPosterior posterior = known.posterior();
  observe(posterior, 0);
  EXPECT_NEAR(posterior.energies()[1], 1 / 0.08, 1e-5);
}

TEST(TaskPosterior, EnergiesAddUpInAnyOrder) {
  const Known known({-1, 0.5f, 2});
  const std::vector<float> rewards = {0.3f, -0.9f, 1.7f, 0.1f};
  TaskPosterior forward = known.posterior(), backward = known.posterior();
  std::vector<double> sum(3);
  for (std::size_t i = 0; i < rewards.size(); ++i) {
    observe(forward, rewards[i], static_cast<float>(i));
    observe(backward, rewards[3 - i], static_cast<float>(3 - i));
    TaskPosterior alone = known.posterior();
    observe(alone, rewards[i], static_cast<float>(i));
    for (std::size_t h = 0; h < 3; ++h) sum[h] += alone.energies()[h];
  }
  for (std::size_t h = 0; h < 3; ++h) {
    EXPECT_NEAR(forward.energies()[h], backward.energies()[h], 1e-12);
    EXPECT_NEAR(forward.energies()[h], sum[h], 1e-12);
  }
}

TEST(TaskPosterior, EqualLikelihoodsGiveEqualWeightsAndNothingIsEverNan) {
  const Known equal({1, 1, 1});
  TaskPosterior posterior = equal.posterior();
  observe(posterior, -5);
  for (const double w : posterior.weights()) EXPECT_DOUBLE_EQ(w, 1.0 / 3);

  const Known apart({-1e6f, 0, 1e6f});
  TaskPosterior sure = apart.posterior();
  for (int i = 0; i < 1000; ++i) observe(sure, 1e6f);
  EXPECT_EQ(sure.weights(), (std::vector<double>{0, 0, 1}));
}

TEST(TaskPosterior, MixturesLieBetweenTwoTasks) {
  TaskModelSettings settings;
  settings.hypotheses = "mixtures";
  const Known known({-2, 0, 8}, settings);
  TaskPosterior posterior = known.posterior();
  EXPECT_EQ(posterior.energies().size(), 3u + 9u);
  for (std::size_t h = 0; h < posterior.energies().size(); ++h) {
    const auto z = posterior.hypotheses().begin() + static_cast<std::ptrdiff_t>(3 * h);
    EXPECT_EQ(std::accumulate(z, z + 3, 0.0f), 1);
  }
  observe(posterior, 6);
  EXPECT_EQ(posterior.best(), (std::vector<float>{0, 0.25f, 0.75f}));
  settings.hypotheses = "vertices";
  const Known far({-2, 0, 8}, settings);
  TaskPosterior of_vertices = far.posterior();
  EXPECT_EQ(of_vertices.energies().size(), 3u);
}

TEST(TaskPosterior, DrawsTasksByTheirWeights) {
  TaskModelSettings settings;
  settings.kappa = 1;
  settings.least_variance = 1;
  const Known known({0, 1, 9}, settings);
  TaskPosterior posterior = known.posterior();
  observe(posterior, 0);
  Rng rng(1, 0, Stream::kEvaluate);
  std::vector<int> drawn(3);
  for (int i = 0; i < 20000; ++i) ++drawn[posterior.draw(rng)];
  EXPECT_NEAR(drawn[0] / 20000.0, posterior.weights()[0], 0.015);
  EXPECT_NEAR(drawn[1] / 20000.0, posterior.weights()[1], 0.015);
  EXPECT_EQ(drawn[2], 0);
}

TEST(TaskPosterior, PredictsDynamicsToo) {
  TaskModelSettings settings;
  settings.dynamics = true;
  settings.hidden = {};
  const TaskModel model(1, 1, 2, settings, true);
  // outputs: reward, change; inputs: s, a, z
  std::vector<float> parameters(model.size());
  parameters[4 + 2] = -std::log1p(20.0f);
  parameters[4 + 3] = std::log1p(20.0f);
  TaskPosterior posterior(model, settings, parameters.data());
  const float s = 2, a = 0, next = 3;
  posterior.observe({&s, &a, 0, 0, &next});
  EXPECT_EQ(posterior.best(), (std::vector<float>{0, 1}));
  EXPECT_NEAR(posterior.energies()[1], 0, 1e-9);
}

}  // namespace
}  // namespace pmeta
