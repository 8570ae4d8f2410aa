#include "pmeta_core/env/mujoco_simulation.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/env.h"

namespace pmeta {
namespace {

static_assert(sizeof(mjtNum) == sizeof(double), "MuJoCo must compute in double precision");

bool allFinite(const double* values, int n) {
  return std::all_of(values, values + n, [](double x) { return std::isfinite(x); });
}

int firstNotFinite(const double* values, int n) {
  return static_cast<int>(
      std::find_if(values, values + n, [](double x) { return !std::isfinite(x); }) - values);
}

}  // namespace

void MujocoSimulation::Delete::operator()(mjData_* data) const { mj_deleteData(data); }

MujocoSimulation::MujocoSimulation(std::shared_ptr<const MujocoModel> model,
                                   std::string environment, int frame_skip)
    : model_(std::move(model)),
      data_(mj_makeData(model_->get())),
      environment_(std::move(environment)),
      frame_skip_(frame_skip),
      nq_(model_->get()->nq),
      nv_(model_->get()->nv),
      nu_(model_->get()->nu),
      dt_(model_->get()->opt.timestep * frame_skip) {
  if (data_ == nullptr) throw Error("MuJoCo cannot simulate the model " + model_->source() + ".");
  qpos_ = data_->qpos;
  qvel_ = data_->qvel;
  control_ = data_->ctrl;
}

int MujocoSimulation::numBodies() const { return model_->get()->nbody; }

const double* MujocoSimulation::bodyPosition(int body) const { return data_->xpos + 3 * body; }

double* MujocoSimulation::bodyPosition(int body) { return data_->xpos + 3 * body; }

void MujocoSimulation::clear() { mj_resetData(model_->get(), data_.get()); }

void MujocoSimulation::forward(int step) {
  mj_forward(model_->get(), data_.get());
  check(step);
}

void MujocoSimulation::step(const double* action, int step) {
  for (int i = 0; i < nu_; ++i) {
    if (!std::isfinite(action[i])) {
      refuseAction(step, static_cast<std::size_t>(i), mj_id2name(model_->get(), mjOBJ_ACTUATOR, i));
    }
    control_[i] = std::clamp(action[i], -1.0, 1.0);
  }
  advance(step);
}

void MujocoSimulation::advance(int step) {
  for (int i = 0; i < frame_skip_; ++i) mj_step(model_->get(), data_.get());
  check(step);
}

void MujocoSimulation::refuseAction(int step, std::size_t index, const std::string& name) const {
  throw Error(at(step) + "action[" + std::to_string(index) + "] (" + name +
              ") is not finite; the episode cannot go on, reset it.");
}

void MujocoSimulation::computeContactForces() { mj_rnePostConstraint(model_->get(), data_.get()); }

const double* MujocoSimulation::contactForces() const { return data_->cfrc_ext; }

std::size_t MujocoSimulation::stateSize() const {
  return static_cast<std::size_t>(nq_ + 2 * nv_ + model_->get()->na);
}

void MujocoSimulation::appendState(std::vector<double>& state) const {
  const auto append = [&](const double* values, int n) {
    state.insert(state.end(), values, values + n);
  };
  append(qpos_, nq_);
  append(qvel_, nv_);
  append(data_->act, model_->get()->na);
  append(data_->qacc_warmstart, nv_);
}

const double* MujocoSimulation::setState(const double* state) {
  clear();
  const auto take = [&](double* values, int n) {
    std::copy_n(state, n, values);
    state += n;
  };
  take(qpos_, nq_);
  take(qvel_, nv_);
  take(data_->act, model_->get()->na);
  take(data_->qacc_warmstart, nv_);
  return state;
}

// MuJoCo counts what it would warn of and then goes on from the rest configuration
void MujocoSimulation::check(int step) const {
  for (int warning = 0; warning < mjNWARNING; ++warning) {
    if (data_->warning[warning].number == 0) continue;
    const int index = data_->warning[warning].lastinfo;
    const std::string place = "[" + std::to_string(index) + "]";
    if (warning == mjWARN_BADQPOS) {
      broke(step, "qpos" + place + jointOf(index, model_->get()->jnt_qposadr) +
                      " is not finite or beyond 1e10");
    }
    if (warning == mjWARN_BADQVEL || warning == mjWARN_BADQACC) {
      broke(step, (warning == mjWARN_BADQVEL ? "qvel" : "qacc") + place +
                      jointOf(index, model_->get()->jnt_dofadr) + " is not finite or beyond 1e10");
    }
    broke(step, std::string("MuJoCo says: ") + mju_warningText(warning, index));
  }
  if (!allFinite(qpos_, nq_)) {
    const int index = firstNotFinite(qpos_, nq_);
    broke(step, "qpos[" + std::to_string(index) + "]" + jointOf(index, model_->get()->jnt_qposadr) +
                    " is not finite");
  }
  if (!allFinite(qvel_, nv_)) {
    const int index = firstNotFinite(qvel_, nv_);
    broke(step, "qvel[" + std::to_string(index) + "]" + jointOf(index, model_->get()->jnt_dofadr) +
                    " is not finite");
  }
}

void MujocoSimulation::broke(int step, const std::string& what) const {
  throw BrokenEpisode(at(step) + what);
}

std::string MujocoSimulation::at(int step) const {
  return environment_ + ", step " + std::to_string(step) + ": ";
}

// the joint that owns a number of the configuration or velocity
std::string MujocoSimulation::jointOf(int index, const int* addresses) const {
  const int* end = addresses + model_->get()->njnt;
  const int* after = std::upper_bound(addresses, end, index);
  if (after == addresses) return "";
  const char* name =
      mj_id2name(model_->get(), mjOBJ_JOINT, static_cast<int>(after - addresses) - 1);
  return name == nullptr ? "" : std::string(" (") + name + ")";
}

}  // namespace pmeta
