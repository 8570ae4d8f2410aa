#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// What sets one cart-pole apart.
struct CartPoleTask {
  double force_mag = 10;  ///< N, the push of either action
  double masspole = 0.1;  ///< kg
  double length = 0.5;    ///< m, half the pole's length
};

/// CartPole-v0 of Gym: balance a pole on a cart by pushing the cart left (0) or right (1).
///
/// State and observation: cart position (m), cart velocity (m/s), pole angle (rad, 0 upright), pole
/// angular velocity (rad/s). Explicit Euler steps of 0.02 s, in the order of operations of Gym
/// 0.21, in double precision. A step that ends beyond 2.4 m or 12 degrees terminates. The reward is
/// 1 each step, also for that one; whoever steps on gets, as in Gym, 0 for being beyond the limits.
/// Truncated after 200 steps. Episodes start with all four numbers uniform in [-0.05, 0.05].
class CartPole : public Env {
 public:
  /// A cart-pole of that force, mass and length, all positive.
  explicit CartPole(const CartPoleTask& task);

  /// The four numbers with their units and limits, and the two pushes.
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;
  std::vector<double> state() const override;  ///< the four numbers, fallen (0 or 1), steps
  void setState(const std::vector<double>& state) override;

  const CartPoleTask& task() const { return task_; }  ///< as given to the constructor

 private:
  CartPoleTask task_;
  EnvSpec spec_;
  double total_mass_;       ///< cart and pole
  double polemass_length_;  ///< pole mass times half length
  std::array<double, 4> state_{};
  bool fallen_ = false;  ///< since the reset, the limits have been left
  int steps_ = 0;
};

/// Cart-poles that differ in force, pole mass and pole length; by default the paper's five.
class CartPoleFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(tasks_.size()); }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Throws std::out_of_range if there is no such task.
  const CartPoleTask& task(int task) const { return tasks_.at(task); }

 private:
  std::vector<double> force_mag_ = {20, 1, 10, 10, 10};
  std::vector<double> masspole_ = {0.1, 0.1, 1, 0.01, 0.1};
  std::vector<double> length_ = {0.5, 0.5, 0.5, 0.5, 0.05};
  std::vector<CartPoleTask> tasks_;
};

}  // namespace pmeta
