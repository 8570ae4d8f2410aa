#include "pmeta_core/run/robot_driver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

constexpr double kPeriodsToStale = 2;

std::vector<std::string> namesOf(const std::vector<Quantity>& quantities) {
  std::vector<std::string> names;
  for (const Quantity& one : quantities) names.push_back(one.name);
  return names;
}

bool has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// throws Error unless `name` is one of them
void require(const std::vector<std::string>& names, const std::string& name, const char* setting,
             const char* what) {
  if (has(names, name)) return;
  throw Error(std::string(setting) + " names " + shown(name) + ", but the policy has no such " +
              what + ": it has " + join(names, ", ") + ".");
}

void requireNotNegative(double value, const char* name) {
  if (std::isfinite(value) && value >= 0) return;
  throw Error(std::string(name) + " is " + formatNumber(value) + " but must be at least 0.");
}

}  // namespace

RobotDriver::RobotDriver(const std::string& policy_file, int task, DriverSettings settings)
    : policy_(policy_file, task),
      settings_(std::move(settings)),
      observations_(namesOf(observationsOf(policy_.spec()))),
      inputs_(observations_.size()),
      observation_(observations_.size()),
      action_(static_cast<std::size_t>(policy_.spec().action_size)) {
  checkSettings();
  const std::vector<Quantity> actions = actionsOf(policy_.spec());
  const std::vector<std::string> names = namesOf(actions);
  if (settings_.actuators.empty()) settings_.actuators = names;
  for (const std::string& name : settings_.actuators) {
    require(names, name, "actuators", "action");
    const auto place = std::find(names.begin(), names.end(), name) - names.begin();
    order_.push_back(static_cast<std::size_t>(place));
    bounds_.push_back(actions[order_.back()]);
    const auto safe = settings_.safe_action.find(name);
    safe_.push_back(safe == settings_.safe_action.end() ? 0 : safe->second);
    if (safe_.back() >= bounds_.back().low && safe_.back() <= bounds_.back().high) continue;
    throw Error("the safe action of " + shown(name) + " is " + formatNumber(safe_.back()) +
                " but must be from " + formatNumber(bounds_.back().low) + " to " +
                formatNumber(bounds_.back().high) + ".");
  }
  if (std::set<std::size_t>(order_.begin(), order_.end()).size() != names.size()) {
    throw Error("actuators must name each of the policy's actions once: " + join(names, ", ") +
                ".");
  }
  command_ = safe_;
}

void RobotDriver::checkSettings() {
  requireNotNegative(settings_.rate, "rate");
  requireNotNegative(settings_.input_timeout, "input_timeout");
  requireNotNegative(settings_.slew, "slew");
  const EnvSpec& spec = policy_.spec();
  if (settings_.rate == 0 && spec.step_seconds == 0) {
    throw Error("the policy's file does not say how long a step takes: set rate, in Hz.");
  }
  if (settings_.slew > 0 && spec.num_actions > 0) {
    throw Error("slew is for continuous actions: the policy's are discrete.");
  }
  period_ = settings_.rate > 0 ? 1 / settings_.rate : spec.step_seconds;
  if (settings_.input_timeout == 0) settings_.input_timeout = kPeriodsToStale * period_;
  for (const std::string& name : settings_.single_inputs) {
    require(observations_, name, "single_inputs", "observation");
  }
  const std::vector<std::string> actions = namesOf(actionsOf(spec));
  for (const auto& safe : settings_.safe_action) {
    require(actions, safe.first, "safe_action", "action");
  }
}

void RobotDriver::beginEpisode() {
  awaits_ = false;
  reward_.reset();
  policy_.beginEpisode();
}

std::size_t RobotDriver::indexOf(const std::string& observation) const {
  const auto place = std::find(observations_.begin(), observations_.end(), observation);
  return static_cast<std::size_t>(place - observations_.begin());
}

// what of them the policy observes; throws Error if a joint is missing, unknown or there twice
std::vector<RobotDriver::Reading> RobotDriver::readingsOf(
    const std::vector<std::string>& joints) const {
  const std::pair<const char*, Measure> kSuffixes[] = {
      {"", Measure::kPosition}, {"_velocity", Measure::kVelocity}, {"_effort", Measure::kEffort}};
  std::vector<Reading> readings;
  std::set<std::size_t> found;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (settings_.ignored_joints.count(joints[j]) != 0) continue;
    const std::size_t before = readings.size();
    for (const auto& [suffix, measure] : kSuffixes) {
      const std::string name = joints[j] + suffix;
      if (!has(observations_, name) || settings_.single_inputs.count(name) != 0) continue;
      readings.push_back({j, measure, indexOf(name)});
      if (!found.insert(readings.back().input).second) {
        throw Error("joint " + shown(joints[j]) + " is measured twice.");
      }
    }
    if (readings.size() == before) {
      throw Error("joint " + shown(joints[j]) +
                  " is unknown: the policy observes nothing of it; leave it out, or name it in "
                  "ignored_joints.");
    }
  }
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    if (found.count(i) != 0 || settings_.single_inputs.count(observations_[i]) != 0) continue;
    throw Error("no joint measures " + shown(observations_[i]) +
                ", which the policy observes; if it comes on its own, name it in single_inputs.");
  }
  return readings;
}

void RobotDriver::take(const JointReadings& joints, double now) {
  try {
    if (joints.names != joints_) {
      readings_ = readingsOf(joints.names);
      joints_ = joints.names;
    }
    std::vector<double> values;
    for (const Reading& one : readings_) {
      const std::vector<double>& measured = one.measure == Measure::kPosition   ? joints.positions
                                            : one.measure == Measure::kVelocity ? joints.velocities
                                                                                : joints.efforts;
      if (one.joint >= measured.size() || !std::isfinite(measured[one.joint])) {
        throw Error("the input of " + shown(observations_[one.input]) +
                    " is missing or not finite.");
      }
      values.push_back(measured[one.joint]);
    }
    for (std::size_t k = 0; k < readings_.size(); ++k) {
      inputs_[readings_[k].input] = {values[k], now};
    }
    refused_.clear();
  } catch (const Error& error) {
    refused_ = error.what();
    throw;
  }
}

void RobotDriver::take(const std::string& name, double value, double now) {
  if (std::isfinite(value)) {
    inputs_.at(indexOf(name)) = {value, now};
    return;
  }
  inputs_.at(indexOf(name)).time = -std::numeric_limits<double>::infinity();
  throw Error("the input of " + shown(name) + " is not finite.");
}

// why the policy cannot act at `now`; empty if it can
std::string RobotDriver::obstacle(double now) const {
  if (!armed_) return "disarmed";
  if (!refused_.empty()) return refused_;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const double age = now - inputs_[i].time;
    if (age <= settings_.input_timeout) continue;
    if (!std::isfinite(age)) return "there is no input of " + shown(observations_[i]) + ".";
    return "the input of " + shown(observations_[i]) + " is " + significant(age, 2) +
           " s old, more than " + significant(settings_.input_timeout, 2) + ".";
  }
  if (awaits_ && !(reward_ && std::isfinite(*reward_)))
    return "there is no reward of the last action.";
  return "";
}

const std::vector<double>& RobotDriver::command(double now) {
  reason_ = obstacle(now);
  if (reason_.empty() && !act()) reason_ = "the policy has no action for what is observed.";
  if (!reason_.empty()) {
    awaits_ = false;  // what comes now is of the safe action
    command_ = safe_;
  } else {
    limitChange(commanded_at_ < 0 ? period_ : now - commanded_at_);
  }
  reward_.reset();
  commanded_at_ = now;
  return command_;
}

bool RobotDriver::act() {
  for (std::size_t i = 0; i < inputs_.size(); ++i) observation_[i] = inputs_[i].value;
  if (awaits_ && !policy_.observe(*reward_, observation_.data())) return false;
  if (!policy_.act(observation_.data(), action_.data())) return false;
  awaits_ = policy_.observes();
  return true;
}

// the policy's action, or what can be reached on the way to it from the last command
void RobotDriver::limitChange(double seconds) {
  const double most = settings_.slew > 0 ? settings_.slew * std::max(seconds, 0.0)
                                         : std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < command_.size(); ++k) {
    const double target = std::clamp(action_[order_[k]], bounds_[k].low, bounds_[k].high);
    command_[k] += std::clamp(target - command_[k], -most, most);
  }
}

}  // namespace pmeta
