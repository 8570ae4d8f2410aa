#include "pmeta_core/env/mujoco_env.h"

#include <algorithm>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/hash.h"
#include "pmeta_core/env/model_files.h"

namespace pmeta {
namespace {

// shares of the motors' torques
std::vector<Quantity> motors(const MujocoLayout& layout) {
  std::vector<Quantity> quantities;
  for (const std::string& motor : layout.motors) quantities.push_back({motor, "", -1, 1});
  return quantities;
}

}  // namespace

MujocoEnv::MujocoEnv(const std::string& name, const MujocoLayout& layout,
                     std::vector<Quantity> observation, int horizon,
                     std::shared_ptr<const MujocoModel> model, int frame_skip)
    : simulation_(std::move(model), name, frame_skip),
      spec_(describedSpec(name, horizon, std::move(observation), motors(layout))),
      torso_body_(simulation_.model().body("torso")) {
  spec_.step_seconds = simulation_.dt();
  spec_.restorable = true;
  torso_ = simulation_.bodyPosition(torso_body_);
}

std::vector<Quantity> MujocoEnv::jointAngles(const MujocoLayout& layout, std::size_t first) {
  std::vector<Quantity> quantities;
  for (std::size_t i = first; i < layout.joints.size(); ++i) {
    quantities.push_back({layout.joints[i], "rad"});
  }
  return quantities;
}

std::vector<Quantity> MujocoEnv::jointVelocities(const MujocoLayout& layout, std::size_t first) {
  std::vector<Quantity> quantities;
  for (std::size_t i = first; i < layout.joints.size(); ++i) {
    quantities.push_back({layout.joints[i] + "_velocity", "rad/s"});
  }
  return quantities;
}

std::vector<Quantity> MujocoEnv::joined(const std::vector<std::vector<Quantity>>& parts) {
  std::vector<Quantity> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

void MujocoEnv::reset(Rng& rng, double* observation) {
  simulation_.clear();
  drawStart(rng, simulation_.qpos(), simulation_.qvel());
  simulation_.forward();
  steps_ = 0;
  observe(observation);
}

Step MujocoEnv::step(const double* action, Rng&, double* observation) {
  beforeStep();
  simulation_.step(action, steps_ + 1);
  ++steps_;
  Step step = afterStep();
  step.truncated = !step.terminated && steps_ >= spec_.horizon;
  observe(observation);
  return step;
}

std::vector<double> MujocoEnv::state() const {
  std::vector<double> state;
  simulation_.appendState(state);
  state.insert(state.end(), torso_, torso_ + 3);
  state.push_back(steps_);
  return state;
}

void MujocoEnv::setState(const std::vector<double>& state) {
  requireState(spec_, state, simulation_.stateSize() + 3 + 1);
  const double* torso = simulation_.setState(state.data());
  std::copy_n(torso, 3, simulation_.bodyPosition(torso_body_));
  steps_ = static_cast<int>(state.back());
}

std::vector<double> MujocoEnv::configuration() const {
  return {simulation_.qpos(), simulation_.qpos() + simulation_.nq()};
}

double MujocoEnv::squaredControl() const {
  double sum = 0;
  const double* control = simulation_.control();
  for (int i = 0; i < simulation_.nu(); ++i) sum += control[i] * control[i];
  return sum;
}

void MujocoSettings::bind(Settings& settings) {
  settings.bind("environment.model_file", model.file, "MJCF file; \"\" means the shipped model");
  settings.bind("environment.model_hash", model.hash,
                "no model but that of this hash is taken; \"\" takes any");
  settings.bind("environment.horizon", horizon, "steps after which an episode is truncated",
                Range::between(1, 1e6));
}

std::shared_ptr<const MujocoModel> MujocoSettings::open(const MujocoLayout& layout) {
  auto opened = MujocoModel::open(model.file, layout);
  const std::string found =
      model.file.empty() ? hashText(shippedModel(layout.model)) : ModelFiles::find(model.file).hash;
  model.take(found, opened->source());
  return opened;
}

}  // namespace pmeta
