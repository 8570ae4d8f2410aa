#include "pmeta_core/replay/n_step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pmeta_core/base/rng.h"

namespace pmeta {
namespace {

// one raw episode: states are numbered, so that every transition can be told apart
struct RawEpisode {
  std::vector<float> states;  // steps + 1
  std::vector<float> actions;
  std::vector<double> rewards;
  bool terminated = false;
  bool truncated = false;  // neither: still going on
};

struct Expected {
  float state, action, n_step_return, discount, next;
};

// straight from the definition, episode by episode
std::vector<Expected> transitionsOf(const RawEpisode& e, int n, double gamma, bool bootstrap) {
  std::vector<Expected> out;
  const int steps = static_cast<int>(e.rewards.size());
  for (int t = 0; t < steps; ++t) {
    const int end = std::min(t + n, steps);
    if (end - t < n && !e.terminated && !e.truncated) break;
    double sum = 0;
    for (int j = t; j < end; ++j) sum += std::pow(gamma, j - t) * e.rewards[j];
    const bool last = end == steps && (e.terminated || e.truncated);
    const bool bootstraps = !last || (!e.terminated && bootstrap);
    out.push_back({e.states[t], e.actions[t], static_cast<float>(sum),
                   bootstraps ? static_cast<float>(std::pow(gamma, end - t)) : 0.0f,
                   e.states[end]});
  }
  return out;
}

// a step from where the episode is to `to`, added there, too
Step addStep(NStepAccumulator& n_step, int env, float to, RawEpisode& e, Rng& rng,
             PrioritisedReplay& replay) {
  Step step;
  step.reward = rng.normal();
  const std::uint64_t end = rng.below(16);  // short episodes, some of one step
  step.terminated = end == 0 || end == 2;
  step.truncated = end == 1 || end == 2;
  const float action = static_cast<float>(rng.below(5));
  const float from = e.states.back();
  n_step.add(env, &from, &action, step, &to, replay);
  e.states.push_back(to);
  e.actions.push_back(action);
  e.rewards.push_back(step.reward);
  e.terminated = step.terminated;
  e.truncated = step.truncated;
  return step;
}

class NStep : public ::testing::TestWithParam<bool> {};

TEST_P(NStep, EqualsTheDefinitionOnRawEpisodes) {
  const bool bootstrap = GetParam();
  const double gamma = 0.9;
  const int num_envs = 3;
  for (const int n : {1, 2, 3, 10}) {
    Rng rng(static_cast<std::uint64_t>(n), 0, Stream::kCollect);
    PrioritisedReplay replay(100000, 1, 1, 0.6, 0.4);
    NStepAccumulator n_step(num_envs, n, gamma, 1, 1, bootstrap);
    std::vector<std::vector<RawEpisode>> raw(num_envs);
    float state = 0;
    for (auto& episodes : raw) episodes.push_back({{state++}, {}, {}});
    for (int t = 0; t < 2000; ++t) {
      for (int i = 0; i < num_envs; ++i) {
        RawEpisode& e = raw[i].back();
        const std::size_t before = replay.size();
        const Step step = addStep(n_step, i, state++, e, rng, replay);
        if (step.terminated || step.truncated) {
          EXPECT_EQ(n_step.queues()[i].size, 0);
          raw[i].push_back({{state++}, {}, {}});
        } else {
          EXPECT_EQ(n_step.queues()[i].size,
                    std::min<int>(n - 1, static_cast<int>(e.rewards.size())));
          EXPECT_LE(replay.size(), before + 1);
        }
      }
    }

    std::vector<Expected> expected;
    for (const auto& episodes : raw) {
      for (const RawEpisode& e : episodes) {
        for (const Expected& x : transitionsOf(e, n, gamma, bootstrap)) expected.push_back(x);
      }
    }
    ASSERT_EQ(replay.size(), expected.size());
    std::vector<Transition> found;
    for (std::size_t k = 0; k < replay.size(); ++k) found.push_back(replay.buffer()[k]);
    // environments take turns; within one the order is that of time
    std::sort(found.begin(), found.end(), [](const Transition& a, const Transition& b) {
      return a.observation[0] < b.observation[0];
    });
    std::sort(expected.begin(), expected.end(),
              [](const Expected& a, const Expected& b) { return a.state < b.state; });
    for (std::size_t k = 0; k < found.size(); ++k) {
      ASSERT_EQ(found[k].observation[0], expected[k].state);
      ASSERT_EQ(found[k].action[0], expected[k].action);
      ASSERT_NEAR(found[k].reward, expected[k].n_step_return, 1e-6);
      ASSERT_NEAR(found[k].discount, expected[k].discount, 1e-7);
      ASSERT_EQ(found[k].discount == 0, expected[k].discount == 0);
      ASSERT_EQ(found[k].next_observation[0], expected[k].next);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Limit, NStep, ::testing::Bool(),
                         [](const auto& info) { return info.param ? "Bootstraps" : "IsTerminal"; });

TEST(NStepAccumulator, AWorkedExample) {
  // r = 1, 2, 4 with gamma 1/2 and n = 2, terminal after the third
  PrioritisedReplay replay(10, 1, 1, 0.6, 0.4);
  NStepAccumulator n_step(1, 2, 0.5, 1, 1, true);
  const float s[] = {10, 11, 12, 13}, a = 0;
  n_step.add(0, &s[0], &a, {1, false, false}, &s[1], replay);
  EXPECT_EQ(replay.size(), 0u);
  n_step.add(0, &s[1], &a, {2, false, false}, &s[2], replay);
  n_step.add(0, &s[2], &a, {4, true, false}, &s[3], replay);
  ASSERT_EQ(replay.size(), 3u);
  const float rewards[] = {2, 4, 4}, discounts[] = {0.25f, 0, 0}, next[] = {12, 13, 13};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(replay.buffer()[k].observation[0], s[k]);
    EXPECT_EQ(replay.buffer()[k].reward, rewards[k]);
    EXPECT_EQ(replay.buffer()[k].discount, discounts[k]);
    EXPECT_EQ(replay.buffer()[k].next_observation[0], next[k]);
  }
}

}  // namespace
}  // namespace pmeta
