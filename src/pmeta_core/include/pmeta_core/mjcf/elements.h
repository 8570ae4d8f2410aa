#pragma once

#include <string>
#include <vector>

#include "pmeta_core/env/mujoco_model.h"

namespace pmeta {

/// What of a model a term may name.
enum class Element { kBody, kJoint, kGeom, kSite, kSensor, kActuator, kKeyframe };

/// One number of a joint's position or velocity.
struct JointNumber {
  int joint = 0;     ///< of the model
  int index = 0;     ///< in the configuration, or in the velocity
  std::string name;  ///< "hip", or of a joint of several numbers "root.z"
  std::string unit;  ///< "rad", "m", "" of a quaternion; of a velocity "rad/s", "m/s"
};

/// What terms may say of one another.
struct OtherTerms {
  std::vector<std::string> goals;    ///< names of the environment's goals
  std::vector<std::string> actions;  ///< of the numbers of its action, once they are known
};

/// Where a term finds what its settings name: names become indices, and one that is not there is
/// refused in a sentence that names the setting and, nearest first, what there is.
class Elements {
 public:
  /// Of one term, whose settings begin with `prefix`. Both other arguments must outlive this.
  Elements(const MujocoModel& model, const OtherTerms& others, std::string prefix);

  const MujocoModel& model() const { return model_; }  ///< that is searched

  /// The index of an element. `setting` is the name of the term's setting that holds `name`.
  int one(Element kind, const std::string& setting, const std::string& name) const;
  /// Indices of all that are named, or of all that there are where `names` is ["all"].
  std::vector<int> all(Element kind, const std::string& setting,
                       const std::vector<std::string>& names) const;
  /// The name of an element, or one with its number where it has none.
  std::string name(Element kind, int index) const;
  /// How many of a kind there are.
  int count(Element kind) const;

  /// The index of a goal of the environment.
  int goal(const std::string& setting, const std::string& name) const;

  /// Names of the numbers of an action; none while they are being found.
  const std::vector<std::string>& actions() const { return others_.actions; }

  /// Numbers of joints in the configuration: all those of "hip", "root.z" alone, or all of ["all"].
  std::vector<JointNumber> positions(const std::string& setting,
                                     const std::vector<std::string>& names) const;
  /// The same in the velocity; of a free joint "root.vx" and "root.wx" and their like.
  std::vector<JointNumber> velocities(const std::string& setting,
                                      const std::vector<std::string>& names) const;
  /// A single number of a joint's position; throws Error where the joint has several.
  JointNumber position(const std::string& setting, const std::string& name) const;
  /// A single number of a joint's velocity, as position().
  JointNumber velocity(const std::string& setting, const std::string& name) const;

  /// Throws Error: that setting's value `is` ..., e.g. "is 'base', which does not move: ...".
  [[noreturn]] void refuse(const std::string& setting, const std::string& is) const;

 private:
  [[noreturn]] void refuseName(const std::string& setting, const std::string& what,
                               const std::string& name,
                               const std::vector<std::string>& known) const;
  std::vector<std::string> names(Element kind) const;
  std::vector<JointNumber> numbers(const std::string& setting,
                                   const std::vector<std::string>& names, bool velocity) const;
  JointNumber single(const std::string& setting, const std::string& name, bool velocity) const;

  const MujocoModel& model_;
  const OtherTerms& others_;
  std::string prefix_;
};

}  // namespace pmeta
