#include "pmeta_core/env/cart_pole.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/task_values.h"

namespace pmeta {
namespace {

const RegisteredFamily<CartPoleFamily> kCartPole("cart_pole");

constexpr double kGravity = 9.8;
constexpr double kCartMass = 1.0;
constexpr double kTimeStep = 0.02;
constexpr double kPositionLimit = 2.4;
constexpr double kAngleLimit = 12 * 2 * 3.141592653589793 / 360;
constexpr double kStartSpread = 0.05;
constexpr int kHorizon = 200;

EnvSpec cartPoleSpec() {
  EnvSpec spec = describedSpec("cart_pole", kHorizon,
                               {{"position", "m", -kPositionLimit, kPositionLimit},
                                {"velocity", "m/s"},
                                {"angle", "rad", -kAngleLimit, kAngleLimit},
                                {"angular_velocity", "rad/s"}},
                               {{"push", "", 0, 1}}, {"left", "right"});
  spec.step_seconds = kTimeStep;
  spec.restorable = true;
  return spec;
}

}  // namespace

CartPole::CartPole(const CartPoleTask& task)
    : task_(task),
      spec_(cartPoleSpec()),
      total_mass_(task.masspole + kCartMass),
      polemass_length_(task.masspole * task.length) {}

void CartPole::reset(Rng& rng, double* observation) {
  for (double& x : state_) x = kStartSpread * (2 * rng.uniform() - 1);
  fallen_ = false;
  steps_ = 0;
  std::copy(state_.begin(), state_.end(), observation);
}

Step CartPole::step(const double* action, Rng&, double* observation) {
  auto& [x, x_dot, theta, theta_dot] = state_;
  const double force = action[0] == 1 ? task_.force_mag : -task_.force_mag;
  const double cosine = std::cos(theta);
  const double sine = std::sin(theta);
  // Gym's order of operations: the upright pole amplifies the last bit
  const double temp = (force + polemass_length_ * (theta_dot * theta_dot) * sine) / total_mass_;
  const double theta_acc =
      (kGravity * sine - cosine * temp) /
      (task_.length * (4.0 / 3.0 - task_.masspole * (cosine * cosine) / total_mass_));
  const double x_acc = temp - polemass_length_ * theta_acc * cosine / total_mass_;

  // positions move with the old velocities
  x += kTimeStep * x_dot;
  x_dot += kTimeStep * x_acc;
  theta += kTimeStep * theta_dot;
  theta_dot += kTimeStep * theta_acc;

  ++steps_;
  std::copy(state_.begin(), state_.end(), observation);
  const bool terminated = std::abs(x) > kPositionLimit || std::abs(theta) > kAngleLimit;
  const double reward = terminated && fallen_ ? 0 : 1;
  fallen_ = fallen_ || terminated;
  return {reward, terminated, !terminated && steps_ >= kHorizon};
}

std::vector<double> CartPole::state() const {
  return {state_[0], state_[1],           state_[2],
          state_[3], fallen_ ? 1.0 : 0.0, static_cast<double>(steps_)};
}

void CartPole::setState(const std::vector<double>& state) {
  requireState(spec_, state, state_.size() + 2);
  if (state[4] != 0 && state[4] != 1) {
    throw Error("a state of cart_pole has fallen = " + formatNumber(state[4]) +
                ", which must be 0 or 1.");
  }
  std::copy_n(state.begin(), state_.size(), state_.begin());
  fallen_ = state[4] == 1;
  steps_ = static_cast<int>(state[5]);
}

void CartPoleFamily::bind(Settings& settings) {
  // wide enough for any study, and nothing in it overflows within an episode
  const Range range = Range::between(0.001, 1000);
  settings.bind("environment.force_mag", force_mag_,
                "push on the cart in N; one number, or one for each task", range);
  settings.bind("environment.masspole", masspole_,
                "mass of the pole in kg; one number, or one for each task", range);
  settings.bind("environment.length", length_,
                "half the pole's length in m; one number, or one for each task", range);
}

void CartPoleFamily::build(std::uint64_t) {
  const std::size_t count = countTasks({force_mag_, masspole_, length_});
  requireTaskValues("environment.force_mag", force_mag_, count);
  requireTaskValues("environment.masspole", masspole_, count);
  requireTaskValues("environment.length", length_, count);
  tasks_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    tasks_.push_back({taskValue(force_mag_, i), taskValue(masspole_, i), taskValue(length_, i)});
  }
}

std::string CartPoleFamily::taskName(int task) const { return "cart_pole_" + std::to_string(task); }

std::string CartPoleFamily::taskDescription(int task) const {
  const CartPoleTask& t = tasks_.at(task);
  return "force " + formatNumber(t.force_mag) + " N, pole of " + formatNumber(t.masspole) +
         " kg, half length " + formatNumber(t.length) + " m";
}

std::unique_ptr<Env> CartPoleFamily::create(int task) const {
  return std::make_unique<CartPole>(tasks_.at(task));
}

}  // namespace pmeta
