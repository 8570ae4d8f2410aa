#include "pmeta_core/env/ant.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/env/task_split.h"

namespace pmeta {
namespace {

const RegisteredFamily<AntFwdBackFamily> kAntFwdBack("ant_fwd_back");

constexpr char kName[] = "ant_fwd_back";
constexpr int kFrameSkip = 5;
constexpr double kControlCost = 0.5;
constexpr double kContactCost = 0.0005;
constexpr double kSurvive = 1;
constexpr double kLowest = 0.2;
constexpr double kHighest = 1;
constexpr double kStartSpread = 0.1;
constexpr double kStartSpeed = 0.1;
constexpr double kPi = 3.141592653589793;

}  // namespace

const MujocoLayout& Ant::layout() {
  static const MujocoLayout kLayout = {
      "ant",
      15,
      14,
      {"torso", "leg_1", "aux_1", "foot_1", "leg_2", "aux_2", "foot_2", "leg_3", "aux_3", "foot_3",
       "leg_4", "aux_4", "foot_4"},
      {"root", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3", "hip_4", "ankle_4"},
      {"hip_4", "ankle_4", "hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3"}};
  return kLayout;
}

double Ant::reward(double direction, const AntStep& step) {
  return step.velocity_x * std::cos(direction) + step.velocity_y * std::sin(direction) -
         step.control_cost - step.contact_cost + step.survive;
}

std::vector<Quantity> Ant::observed() {
  const auto vectorOf = [](const std::string& name, const std::string& unit) {
    return std::vector<Quantity>{{name + "_x", unit}, {name + "_y", unit}, {name + "_z", unit}};
  };
  return joined({{{"root_z", "m", kLowest, kHighest},
                  {"root_quaternion_w", "", -1, 1},
                  {"root_quaternion_x", "", -1, 1},
                  {"root_quaternion_y", "", -1, 1},
                  {"root_quaternion_z", "", -1, 1}},
                 jointAngles(layout(), 1),
                 vectorOf("root_velocity", "m/s"),
                 vectorOf("root_angular_velocity", "rad/s"),
                 jointVelocities(layout(), 1)});
}

Ant::Ant(double direction, std::shared_ptr<const MujocoModel> model, int horizon)
    : MujocoEnv(kName, layout(), observed(), horizon, std::move(model), kFrameSkip),
      direction_(direction),
      contact_numbers_(6 * simulation_.numBodies()) {}

void Ant::drawStart(Rng& rng, double* qpos, double* qvel) {
  for (int i = 0; i < simulation_.nq(); ++i) qpos[i] += kStartSpread * (2 * rng.uniform() - 1);
  for (int i = 0; i < simulation_.nv(); ++i) qvel[i] += kStartSpeed * rng.normal();
}

void Ant::beforeStep() { before_ = {torso_[0], torso_[1]}; }

Step Ant::afterStep() {
  simulation_.computeContactForces();
  last_.velocity_x = (torso_[0] - before_[0]) / simulation_.dt();
  last_.velocity_y = (torso_[1] - before_[1]) / simulation_.dt();
  last_.control_cost = kControlCost * squaredControl();
  last_.contact_cost = contactCost();
  last_.survive = kSurvive;
  const double height = simulation_.qpos()[2];
  return {reward(direction_, last_), height < kLowest || height > kHighest};
}

double Ant::contactCost() const {
  const double* forces = simulation_.contactForces();
  double sum = 0;
  for (int i = 0; i < contact_numbers_; ++i) {
    const double force = std::clamp(forces[i], -1.0, 1.0);
    sum += force * force;
  }
  return kContactCost * sum;
}

void Ant::observe(double* observation) const {
  observation = std::copy(simulation_.qpos() + 2, simulation_.qpos() + 15, observation);
  std::copy(simulation_.qvel(), simulation_.qvel() + 14, observation);
}

void AntFwdBackFamily::bind(Settings& settings) {
  const Range range = Range::between(-2 * kPi, 2 * kPi);
  settings.bind("environment.angles", angles_,
                "direction of each training task in rad, 0 along x (forward)", range);
  settings.bind("environment.test_angles", test_angles_, "the same for each test task", range,
                Empty::kAllowed);
  mujoco_.bind(settings);
}

void AntFwdBackFamily::build(std::uint64_t) {
  model_ = mujoco_.open(Ant::layout());
  tasks_ = angles_;
  tasks_.insert(tasks_.end(), test_angles_.begin(), test_angles_.end());
}

std::string AntFwdBackFamily::taskName(int task) const {
  return splitTaskName(kName, task, numTasks());
}

std::string AntFwdBackFamily::taskDescription(int task) const {
  const double angle = tasks_.at(task);
  if (angle == 0) return "run forward";
  if (angle == kPi) return "run backward";
  return "run at an angle of " + formatNumber(angle) + " rad";
}

std::unique_ptr<Env> AntFwdBackFamily::create(int task) const {
  return std::make_unique<Ant>(tasks_.at(task), model_, mujoco_.horizon);
}

}  // namespace pmeta
