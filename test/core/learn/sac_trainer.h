#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/learn/sac.h"

namespace pmeta::test {

// a point on a line, pushed by the first action in its task's direction; obs = (x, x^2, time)
class PushedPoint : public Env {
 public:
  explicit PushedPoint(double direction = 1) : direction_(direction) {
    spec_.name = "pushed_point";
    spec_.observation_size = 3;
    spec_.action_size = 2;
    spec_.horizon = 12;
    spec_.restorable = true;
  }
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    x_ = rng.normal();
    t_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    EXPECT_LE(std::abs(action[0]), 1);
    EXPECT_LE(std::abs(action[1]), 1);
    x_ += 0.5 * direction_ * action[0] + 0.3 * rng.normal();
    ++t_;
    observe(observation);
    Step step{-x_ * x_ - 0.1 * action[1] * action[1], std::abs(x_) > 2.5, t_ == spec_.horizon};
    step.sparse_reward = direction_ * action[0];
    return step;
  }
  std::vector<double> state() const override { return {x_, static_cast<double>(t_)}; }
  void setState(const std::vector<double>& state) override {
    x_ = state[0];
    t_ = static_cast<int>(state[1]);
  }

 private:
  void observe(double* observation) const {
    observation[0] = x_;
    observation[1] = x_ * x_;
    observation[2] = 0.1 * t_;
  }
  EnvSpec spec_;
  double direction_;
  double x_ = 0;
  int t_ = 0;
};

inline SacSettings smallSettings(const std::string& task_encoding = "none") {
  SacSettings settings;
  settings.hidden = {8, 6};
  settings.batch_size = 16;
  settings.buffer_size = 1000;
  settings.warm_up_steps = 40;
  settings.gamma = 0.9;
  settings.tau = 0.05;
  settings.reward_scale = 1.5;
  settings.task_encoding = task_encoding;
  settings.context.hidden = {7, 5};
  settings.context.latent_size = 3;
  settings.context.batch_size = 10;
  settings.context.buffer_size = 60;
  settings.task_model.hidden = {7, 5};
  settings.task_model.buffer_size = 500;
  settings.task_model.exploring_interval = 2;
  return settings;
}

// plain descent that keeps the last gradient and what was asked of it
class Descent : public Optimizer<float> {
 public:
  Descent(AlignedFloats& parameters, float rate) : parameters_(parameters), rate_(rate) {
    gradient.resize(parameters.size());
  }
  std::vector<float> gradient;
  std::vector<std::size_t> offsets;

 private:
  void move(std::size_t offset, const float* g, std::size_t n, float* target, double tau) override {
    offsets.push_back(offset);
    for (std::size_t k = 0; k < n; ++k) {
      gradient[offset + k] = g[k];
      parameters_[offset + k] -= rate_ * g[k];
      if (target != nullptr) {
        target[k] += static_cast<float>(tau) * (parameters_[offset + k] - target[k]);
      }
    }
  }
  AlignedFloats& parameters_;
  float rate_;
};

// tanh(mean) of the actor
inline std::vector<double> greedyAction(const SacNetworks& networks, const float* parameters,
                                        const std::vector<float>& observation,
                                        const std::vector<float>& task_input) {
  GaussianActor actor(networks.actor(), task_input, 1, GaussianActor::By::kMean, parameters);
  Rng none(0, 0, Stream::kEvaluate);
  std::vector<double> action(networks.actionSize());
  actor.look(observation.data(), {0});
  EXPECT_TRUE(actor.act(0, none, action.data()));
  return action;
}

inline std::vector<float> taskInput(const SacSettings& settings) {
  return settings.isTold() ? oneHot(1, 3) : std::vector<float>();
}

struct Trainer {
  explicit Trainer(const SacSettings& settings, std::uint64_t seed = 0, float rate = 0.02f)
      : learner(std::make_unique<PushedPoint>(), settings, taskInput(settings)),
        parameters(learner.networks().size()),
        optimizer(parameters, rate),
        rng(seed, 0, Stream::kSample) {
    Rng initial(seed, 0, Stream::kInitialise);
    learner.networks().initialise(parameters.data(), initial);
    learner.resetTargets(parameters.data());
  }
  SacLosses update() {
    learner.collect(parameters.data(), rng);
    return learner.update(parameters.data(), optimizer, rng);
  }
  SacLearner learner;
  AlignedFloats parameters;
  Descent optimizer;
  Rng rng;
};

using Vector = std::vector<double>;

// outputs of a network in double, its parameters at `p`
template <class Scalar>
Vector outputs(const Mlp& mlp, const Scalar* p, Vector x) {
  const std::vector<Block>& blocks = mlp.blocks();
  for (std::size_t l = 0; l < blocks.size(); l += 2) {
    const std::size_t out = blocks[l].shape[0], in = blocks[l].shape[1];
    Vector y(out);
    for (std::size_t j = 0; j < out; ++j) {
      y[j] = p[out * in + j];
      for (std::size_t i = 0; i < in; ++i) y[j] += p[j * in + i] * x[i];
      if (l + 2 < blocks.size()) y[j] = std::max(y[j], 0.0);
    }
    p += out * (in + 1);
    x = y;
  }
  return x;
}

}  // namespace pmeta::test
