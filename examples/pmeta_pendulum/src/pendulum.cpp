#include "pendulum.h"

#include <algorithm>
#include <cmath>

namespace pmeta_pendulum {
namespace {

// the row by which pMeta knows the family
const pmeta::RegisteredFamily<PendulumFamily> kPendulum(kName);

constexpr double kPi = 3.14159265358979323846;
constexpr double kGravity = 9.81;     // m/s^2
constexpr double kMass = 1;           // kg
constexpr double kMostTorque = 2;     // N m
constexpr double kMostSpeed = 8;      // rad/s
constexpr int kHorizon = 100;         // steps
constexpr double kSpeedCost = 0.1;    // of (rad/s)^2, where an angle's is 1 of rad^2
constexpr double kTorqueCost = 1e-3;  // of (N m)^2

// from -pi to pi
double wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

}  // namespace

Pendulum::Pendulum(double length)
    : length_(length),
      spec_(pmeta::describedSpec(
          kName, kHorizon,
          {{"cosine", "", -1, 1}, {"sine", "", -1, 1}, {"speed", "rad/s", -kMostSpeed, kMostSpeed}},
          {{"torque", "", -1, 1}})) {
  spec_.step_seconds = kTimeStep;
  spec_.restorable = true;
}

void Pendulum::observe(double* observation) const {
  observation[0] = std::cos(angle_);
  observation[1] = std::sin(angle_);
  observation[2] = speed_;
}

void Pendulum::reset(pmeta::Rng& rng, double* observation) {
  angle_ = kPi * (2 * rng.uniform() - 1);
  speed_ = 2 * rng.uniform() - 1;
  steps_ = 0;
  observe(observation);
}

pmeta::Step Pendulum::step(const double* action, pmeta::Rng&, double* observation) {
  // actions come in [-1, 1]; what they mean is the environment's to say
  const double torque = kMostTorque * std::clamp(action[0], -1.0, 1.0);
  const double cost =
      angle_ * angle_ + kSpeedCost * speed_ * speed_ + kTorqueCost * torque * torque;
  const double inertia = kMass * length_ * length_ / 3;
  const double acceleration =
      (kMass * kGravity * length_ / 2 * std::sin(angle_) + torque) / inertia;
  speed_ = std::clamp(speed_ + acceleration * kTimeStep, -kMostSpeed, kMostSpeed);
  angle_ = wrapped(angle_ + speed_ * kTimeStep);
  observe(observation);
  return {-cost, false, ++steps_ >= kHorizon};
}

std::vector<double> Pendulum::state() const {
  return {angle_, speed_, static_cast<double>(steps_)};
}

void Pendulum::setState(const std::vector<double>& state) {
  pmeta::requireState(spec_, state, 3);
  angle_ = state[0];
  speed_ = state[1];
  steps_ = static_cast<int>(state[2]);
}

void PendulumFamily::bind(pmeta::Settings& settings) {
  const pmeta::Range metres = pmeta::Range::between(0.1, 10);
  settings.bind("environment.lengths", lengths_, "of each training task's rod, m", metres);
  settings.bind("environment.test_lengths", test_lengths_, "of each test task's rod, m", metres,
                pmeta::Empty::kAllowed);
}

// nothing is drawn from the seed: the settings say all
void PendulumFamily::build(std::uint64_t) {}

double PendulumFamily::length(int task) const {
  return task < numTasks() ? lengths_.at(static_cast<std::size_t>(task))
                           : test_lengths_.at(static_cast<std::size_t>(task - numTasks()));
}

double PendulumFamily::longest() const {
  double longest = 0;
  for (int task = 0; task < numTasks() + numTestTasks(); ++task) {
    longest = std::max(longest, length(task));
  }
  return longest;
}

std::string PendulumFamily::taskName(int task) const { return "pendulum_" + std::to_string(task); }

std::string PendulumFamily::taskDescription(int task) const {
  return "rod of " + pmeta::formatNumber(length(task)) + " m";
}

std::unique_ptr<pmeta::Env> PendulumFamily::create(int task) const {
  return std::make_unique<Pendulum>(length(task));
}

}  // namespace pmeta_pendulum
