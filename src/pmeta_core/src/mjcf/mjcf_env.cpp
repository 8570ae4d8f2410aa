#include "pmeta_core/mjcf/mjcf_env.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

namespace pmeta {

MjcfEnv::MjcfEnv(std::shared_ptr<const MjcfDesign> design, std::shared_ptr<const MujocoModel> model)
    : design_(std::move(design)),
      simulation_(std::move(model), kMjcf, design_->frame_skip),
      spec_(describedSpec(kMjcf, design_->horizon, observed(), acted())),
      goals_(3 * design_->goals.entries().size()),
      action_(spec_.action.size()) {
  // refuses names that two numbers have
  observationsOf(spec_);
  actionsOf(spec_);
  spec_.step_seconds = simulation_.dt();
  spec_.restorable = true;
  std::size_t memory = 0;
  for (const auto& reward : design_->rewards.entries()) {
    memory += static_cast<std::size_t>(reward.term->memory());
    needs_contact_forces_ |= reward.term->needsContactForces();
    is_judged_apart_ |= reward.common.counts != "both";
  }
  for (const auto& observation : design_->observations.entries()) {
    needs_contact_forces_ |= observation.term->needsContactForces();
  }
  memory_.resize(memory);
}

std::vector<Quantity> MjcfEnv::observed() {
  std::vector<Quantity> all;
  for (const auto& one : design_->observations.entries()) {
    std::vector<Quantity> quantities = one.term->quantities();
    observed_sizes_.push_back(quantities.size());
    const double clip = one.common.clip;
    for (Quantity& quantity : quantities) {
      if (clip > 0) {
        quantity.low = std::max(quantity.low, -clip);
        quantity.high = std::min(quantity.high, clip);
      }
      all.push_back(quantity);
    }
  }
  for (const auto& termination : design_->terminations.entries()) {
    for (const Quantity& bound : termination.term->bounds()) {
      for (Quantity& quantity : all) {
        if (quantity.name != bound.name) continue;
        quantity.low = std::max(quantity.low, bound.low);
        quantity.high = std::min(quantity.high, bound.high);
      }
    }
  }
  return all;
}

std::vector<Quantity> MjcfEnv::acted() {
  std::vector<Quantity> all;
  for (const auto& one : design_->actions.entries()) {
    const std::vector<Quantity> quantities = one.term->quantities();
    acted_sizes_.push_back(quantities.size());
    all.insert(all.end(), quantities.begin(), quantities.end());
  }
  return all;
}

Robot MjcfEnv::robot() const {
  Robot robot;
  robot.model = simulation_.model().get();
  robot.data = simulation_.data();
  robot.dt = simulation_.dt();
  robot.action = action_.data();
  robot.action_size = action_.size();
  robot.goals = goals_.data();
  robot.last_step = steps_ >= spec_.horizon;
  return robot;
}

void MjcfEnv::reset(Rng& rng, double* observation) {
  simulation_.clear();
  for (const auto& start : design_->starts.entries()) {
    start.term->start(simulation_.model().get(), simulation_.data(), rng);
  }
  double* goal = goals_.data();
  for (const auto& entry : design_->goals.entries()) {
    entry.term->draw(rng, goal);
    if (entry.term->mocap() >= 0) {
      mju_copy3(simulation_.data()->mocap_pos + 3 * entry.term->mocap(), goal);
    }
    goal += 3;
  }
  std::fill(action_.begin(), action_.end(), 0);
  steps_ = 0;
  refresh();
  remember(robot());
  observe(robot(), observation);
}

Step MjcfEnv::step(const double* action, Rng&, double* observation) {
  act(action);
  simulation_.advance(steps_ + 1);
  ++steps_;
  if (design_->refresh) {
    refresh();
  } else if (needs_contact_forces_) {
    simulation_.computeContactForces();
  }
  const Robot now = robot();
  Step step = judge(now);
  step.truncated = !step.terminated && steps_ >= spec_.horizon;
  remember(now);
  observe(now, observation);
  return step;
}

void MjcfEnv::act(const double* action) {
  for (std::size_t i = 0; i < action_.size(); ++i) {
    if (!std::isfinite(action[i])) simulation_.refuseAction(steps_ + 1, i, spec_.action[i].name);
    action_[i] = std::clamp(action[i], -1.0, 1.0);
  }
  const double* next = action_.data();
  std::size_t term = 0;
  for (const auto& one : design_->actions.entries()) {
    one.term->act(next, simulation_.dt(), simulation_.data());
    next += acted_sizes_[term++];
  }
}

// all that follows from configuration and velocity
void MjcfEnv::refresh() {
  simulation_.forward(steps_);
  if (needs_contact_forces_) simulation_.computeContactForces();
}

void MjcfEnv::remember(const Robot& robot) {
  double* memory = memory_.data();
  for (const auto& reward : design_->rewards.entries()) {
    reward.term->remember(robot, memory);
    memory += reward.term->memory();
  }
}

Step MjcfEnv::judge(const Robot& robot) const {
  Step step;
  double judged = 0;
  const double* memory = memory_.data();
  for (const auto& reward : design_->rewards.entries()) {
    const double value = reward.common.weight * reward.term->value(robot, memory);
    memory += reward.term->memory();
    if (reward.common.counts != "evaluation") step.reward += value;
    if (reward.common.counts != "training") judged += value;
  }
  if (is_judged_apart_) step.sparse_reward = judged;
  for (const auto& termination : design_->terminations.entries()) {
    step.terminated |= termination.term->isOver(robot);
  }
  return step;
}

void MjcfEnv::observe(const Robot& robot, double* observation) const {
  std::size_t term = 0;
  for (const auto& one : design_->observations.entries()) {
    one.term->observe(robot, observation);
    double* end = observation + observed_sizes_[term++];
    const double clip = one.common.clip;
    for (; observation < end; ++observation) {
      if (clip > 0) *observation = std::clamp(*observation, -clip, clip);
      if (design_->single_precision) *observation = static_cast<float>(*observation);
    }
  }
}

std::vector<double> MjcfEnv::state() const {
  const mjModel* m = simulation_.model().get();
  const mjData* data = simulation_.data();
  std::vector<double> state;
  simulation_.appendState(state);
  const auto append = [&state](const double* values, std::size_t n) {
    state.insert(state.end(), values, values + n);
  };
  append(data->ctrl, static_cast<std::size_t>(m->nu));
  append(data->mocap_pos, 3 * static_cast<std::size_t>(m->nmocap));
  append(&data->time, 1);
  append(goals_.data(), goals_.size());
  append(action_.data(), action_.size());
  append(memory_.data(), memory_.size());
  state.push_back(steps_);
  return state;
}

void MjcfEnv::setState(const std::vector<double>& state) {
  const mjModel* m = simulation_.model().get();
  const auto own = static_cast<std::size_t>(m->nu + 3 * m->nmocap + 1);
  requireState(spec_, state,
               simulation_.stateSize() + own + goals_.size() + action_.size() + memory_.size() + 1);
  const double* next = simulation_.setState(state.data());
  mjData* data = simulation_.data();
  const auto take = [&next](double* values, std::size_t n) {
    std::copy_n(next, n, values);
    next += n;
  };
  take(data->ctrl, static_cast<std::size_t>(m->nu));
  take(data->mocap_pos, 3 * static_cast<std::size_t>(m->nmocap));
  take(&data->time, 1);
  take(goals_.data(), goals_.size());
  take(action_.data(), action_.size());
  take(memory_.data(), memory_.size());
  steps_ = static_cast<int>(state.back());
}

std::vector<double> MjcfEnv::configuration() const {
  const mjModel* m = simulation_.model().get();
  std::vector<double> configuration(simulation_.qpos(), simulation_.qpos() + m->nq);
  const double* mocap = simulation_.data()->mocap_pos;
  configuration.insert(configuration.end(), mocap, mocap + 3 * m->nmocap);
  return configuration;
}

}  // namespace pmeta
