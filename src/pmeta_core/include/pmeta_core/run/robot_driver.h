#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pmeta_core/run/loaded_policy.h"

namespace pmeta {

/// How a robot is driven.
struct DriverSettings {
  double rate = 0;           ///< commands a second; 0: as the policy was trained
  double input_timeout = 0;  ///< age at which an input is stale, s; 0: two periods
  double slew = 0;           ///< most that a number of the command changes in a second; 0: any
  /// By name what is commanded while the policy does not act; 0 where there is none.
  std::map<std::string, double> safe_action;
  /// The order of a command's numbers, by name; empty: the policy's.
  std::vector<std::string> actuators;
  /// Observations that come one by one; all others are measured at joints.
  std::set<std::string> single_inputs;
  std::set<std::string> ignored_joints;  ///< that may be measured, too
};

/// What joints measure at a time, as sensor_msgs/JointState has it: in any order, and each list but
/// the names may be empty.
struct JointReadings {
  std::vector<std::string> names;  ///< of the joints
  std::vector<double> positions;   ///< rad or m
  std::vector<double> velocities;  ///< rad/s or m/s
  std::vector<double> efforts;     ///< N m or N
};

/// Decides period by period what a robot is commanded: a policy's greedy action while the driver is
/// armed and every input is fresh, a safe action else. Numbers go by their names in the policy
/// file. Time is an argument, in seconds of any steady clock.
///
/// At joints are measured "NAME", the position of joint NAME, "NAME_velocity" and "NAME_effort".
class RobotDriver {
 public:
  /// Of the policy in a file; `task` as in LoadedPolicy. Throws Error on names that the policy does
  /// not have, numbers that cannot be, or where nothing says the rate.
  RobotDriver(const std::string& policy_file, int task, DriverSettings settings);

  const LoadedPolicy& policy() const { return policy_; }  ///< that drives
  double period() const { return period_; }               ///< from a command to the next, s
  double inputTimeout() const { return settings_.input_timeout; }  ///< as it applies, s
  /// Names of a command's numbers, in their order.
  const std::vector<std::string>& outputs() const { return settings_.actuators; }

  /// As LoadedPolicy::explore().
  bool explore(std::uint64_t seed) { return policy_.explore(seed); }
  /// An episode begins; the one before is over.
  void beginEpisode();

  /// What the joints measure at `now`. Throws Error, and takes nothing, if a joint is missing,
  /// unknown or measured twice, or a number is not finite; the safe action is commanded from then
  /// on until others are taken.
  void take(const JointReadings& readings, double now);
  /// One of settings.single_inputs. Throws, and takes nothing, as above.
  void take(const std::string& name, double value, double now);
  /// What the last action earned; for a policy that observes that.
  void takeReward(double reward) { reward_ = reward; }

  void arm() { armed_ = true; }          ///< from now on the policy may act
  void disarm() { armed_ = false; }      ///< until arm() the safe action is commanded, as at first
  bool armed() const { return armed_; }  ///< may the policy act?

  /// What to command at `now`: numbers in the order of outputs(), within the policy file's bounds.
  const std::vector<double>& command(double now);
  /// Why the last command was the safe action; empty if the policy acted.
  const std::string& reason() const { return reason_; }

 private:
  struct Input {
    double value = 0;
    double time = -std::numeric_limits<double>::infinity();
  };
  // where a number of the observation is measured
  enum class Measure { kPosition, kVelocity, kEffort };
  struct Reading {
    std::size_t joint;
    Measure measure;
    std::size_t input;
  };

  void checkSettings();
  std::vector<Reading> readingsOf(const std::vector<std::string>& joints) const;
  std::string obstacle(double now) const;
  bool act();
  void limitChange(double seconds);
  std::size_t indexOf(const std::string& observation) const;

  LoadedPolicy policy_;
  DriverSettings settings_;
  double period_ = 0;
  std::vector<std::string> observations_;
  std::vector<Input> inputs_;        // of each of them
  std::vector<std::string> joints_;  // of the last readings, and what of them goes where
  std::vector<Reading> readings_;
  std::vector<Quantity> bounds_;              // of outputs()
  std::vector<std::size_t> order_;            // place in the policy's action of each output
  std::vector<double> safe_, command_;        // as outputs()
  std::vector<double> observation_, action_;  // as the policy has them
  std::optional<double> reward_;
  bool armed_ = false;
  bool awaits_ = false;  // the policy is to be told what came of its last action
  double commanded_at_ = -1;
  std::string refused_;  // why the newest input was
  std::string reason_;
};

}  // namespace pmeta
