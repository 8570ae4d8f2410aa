#include "pmeta_core/env/mountain_car.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/env/task_values.h"

namespace pmeta {
namespace {

const RegisteredFamily<MountainCarFamily> kMountainCar("mountain_car");

constexpr double kLowestPosition = -1.2;
constexpr double kHighestPosition = 0.6;
constexpr double kHighestSpeed = 0.07;
constexpr double kGoal = 0.5;
constexpr double kStartLow = -0.6;
constexpr double kStartHigh = -0.4;
constexpr int kHorizon = 200;

EnvSpec mountainCarSpec(double velocity_scale) {
  const double speed = velocity_scale * kHighestSpeed;
  const Quantity velocity = velocity_scale == 1 ? Quantity{"velocity", "1/step", -speed, speed}
                                                : Quantity{"scaled_velocity", "", -speed, speed};
  EnvSpec spec = describedSpec("mountain_car", kHorizon,
                               {{"position", "", kLowestPosition, kHighestPosition}, velocity},
                               {{"push", "", 0, 2}}, {"left", "none", "right"});
  spec.restorable = true;
  return spec;
}

}  // namespace

MountainCar::MountainCar(const MountainCarTask& task, double velocity_scale)
    : task_(task), velocity_scale_(velocity_scale), spec_(mountainCarSpec(velocity_scale)) {}

void MountainCar::reset(Rng& rng, double* observation) {
  position_ = kStartLow + (kStartHigh - kStartLow) * rng.uniform();
  velocity_ = 0;
  steps_ = 0;
  observe(observation);
}

Step MountainCar::step(const double* action, Rng&, double* observation) {
  velocity_ += (action[0] - 1) * task_.force + std::cos(task_.zeta * position_) * -task_.gravity;
  velocity_ = std::clamp(velocity_, -kHighestSpeed, kHighestSpeed);
  position_ = std::clamp(position_ + velocity_, kLowestPosition, kHighestPosition);
  // the wall on the left takes all speed
  if (position_ == kLowestPosition && velocity_ < 0) velocity_ = 0;

  ++steps_;
  observe(observation);
  const bool terminated = position_ >= kGoal && velocity_ >= 0;
  return {-1, terminated, !terminated && steps_ >= kHorizon};
}

std::vector<double> MountainCar::state() const {
  return {position_, velocity_, static_cast<double>(steps_)};
}

void MountainCar::setState(const std::vector<double>& state) {
  requireState(spec_, state, 3);
  position_ = state[0];
  velocity_ = state[1];
  steps_ = static_cast<int>(state[2]);
}

void MountainCar::observe(double* observation) const {
  observation[0] = position_;
  observation[1] = velocity_scale_ * velocity_;
}

void MountainCarFamily::bind(Settings& settings) {
  const Range change = Range{0, 1, true, false};
  settings.bind("environment.zeta", zeta_,
                "frequency of the hills; one number, or one for each task",
                Range{0, 100, true, false});
  settings.bind("environment.force", force_,
                "speed that a push adds; one number, or one for each task", change);
  settings.bind("environment.gravity", gravity_,
                "speed that the steepest slope adds; one number, or one for each task", change);
  settings.bind("environment.velocity_scale", velocity_scale_,
                "the observed velocity is multiplied by this; 15 suits a neural network",
                Range{0, 1000, true, false});
}

void MountainCarFamily::build(std::uint64_t) {
  const std::size_t count = countTasks({zeta_, force_, gravity_});
  requireTaskValues("environment.zeta", zeta_, count);
  requireTaskValues("environment.force", force_, count);
  requireTaskValues("environment.gravity", gravity_, count);
  tasks_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    tasks_.push_back({taskValue(zeta_, i), taskValue(force_, i), taskValue(gravity_, i)});
  }
}

std::string MountainCarFamily::taskName(int task) const {
  return "mountain_car_" + std::to_string(task);
}

std::string MountainCarFamily::taskDescription(int task) const {
  const MountainCarTask& t = tasks_.at(task);
  return "zeta " + formatNumber(t.zeta) + ", force " + formatNumber(t.force) + ", gravity " +
         formatNumber(t.gravity);
}

std::unique_ptr<Env> MountainCarFamily::create(int task) const {
  return std::make_unique<MountainCar>(tasks_.at(task), velocity_scale_);
}

}  // namespace pmeta
