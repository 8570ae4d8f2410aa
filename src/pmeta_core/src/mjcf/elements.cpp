#include "pmeta_core/mjcf/elements.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/names.h"

namespace pmeta {
namespace {

struct Kind {
  mjtObj type;
  const char* name;
  int mjModel::*count;
};

const Kind& kindOf(Element element) {
  // in the order of Element
  static const Kind kKinds[] = {
      {mjOBJ_BODY, "body", &mjModel::nbody},       {mjOBJ_JOINT, "joint", &mjModel::njnt},
      {mjOBJ_GEOM, "geom", &mjModel::ngeom},       {mjOBJ_SITE, "site", &mjModel::nsite},
      {mjOBJ_SENSOR, "sensor", &mjModel::nsensor}, {mjOBJ_ACTUATOR, "actuator", &mjModel::nu},
      {mjOBJ_KEY, "keyframe", &mjModel::nkey}};
  return kKinds[static_cast<int>(element)];
}

using Part = std::pair<const char*, const char*>;  // of a joint: its name and unit

// the numbers of a joint of several, or none of a hinge or slide
std::vector<Part> partsOf(int type, bool velocity) {
  std::vector<Part> parts;
  const auto append = [&](const std::vector<Part>& more) {
    parts.insert(parts.end(), more.begin(), more.end());
  };
  if (velocity) {
    if (type == mjJNT_FREE) append({{"vx", "m/s"}, {"vy", "m/s"}, {"vz", "m/s"}});
    if (type == mjJNT_FREE || type == mjJNT_BALL) {
      append({{"wx", "rad/s"}, {"wy", "rad/s"}, {"wz", "rad/s"}});
    }
  } else {
    if (type == mjJNT_FREE) append({{"x", "m"}, {"y", "m"}, {"z", "m"}});
    if (type == mjJNT_FREE || type == mjJNT_BALL) {
      append({{"qw", ""}, {"qx", ""}, {"qy", ""}, {"qz", ""}});
    }
  }
  return parts;
}

std::string unitOf(int type, bool velocity) {
  return std::string(type == mjJNT_SLIDE ? "m" : "rad") + (velocity ? "/s" : "");
}

}  // namespace

Elements::Elements(const MujocoModel& model, const OtherTerms& others, std::string prefix)
    : model_(model), others_(others), prefix_(std::move(prefix)) {}

int Elements::count(Element kind) const { return model_.get()->*kindOf(kind).count; }

std::string Elements::name(Element kind, int index) const {
  const char* name = mj_id2name(model_.get(), kindOf(kind).type, index);
  if (name != nullptr && std::strlen(name) > 0) return name;
  return std::string(kindOf(kind).name) + "_" + std::to_string(index);
}

std::vector<std::string> Elements::names(Element kind) const {
  std::vector<std::string> names;
  for (int i = 0; i < count(kind); ++i) {
    const char* name = mj_id2name(model_.get(), kindOf(kind).type, i);
    if (name != nullptr && std::strlen(name) > 0) names.emplace_back(name);
  }
  return names;
}

int Elements::one(Element kind, const std::string& setting, const std::string& name) const {
  const int index = mj_name2id(model_.get(), kindOf(kind).type, name.c_str());
  if (index < 0) refuseName(setting, kindOf(kind).name, name, names(kind));
  return index;
}

std::vector<int> Elements::all(Element kind, const std::string& setting,
                               const std::vector<std::string>& names) const {
  std::vector<int> indices;
  if (names == std::vector<std::string>{"all"}) {
    for (int i = 0; i < count(kind); ++i) indices.push_back(i);
    if (indices.empty()) {
      refuse(setting, std::string("is [all] but the model ") + model_.source() + " has no " +
                          kindOf(kind).name + ".");
    }
    return indices;
  }
  for (const std::string& name : names) indices.push_back(one(kind, setting, name));
  return indices;
}

int Elements::goal(const std::string& setting, const std::string& name) const {
  const std::vector<std::string>& goals = others_.goals;
  const auto found = std::find(goals.begin(), goals.end(), name);
  if (found == goals.end()) {
    if (goals.empty()) {
      refuse(setting, "is " + shown(name) +
                          " but there are no goals: write one below "
                          "environment.goals.");
    }
    refuse(setting, "is " + shown(name) + " but environment.goals has none of that name" +
                        didYouMean(name, goals) + " It has " + join(nearestFirst(name, goals)) +
                        ".");
  }
  return static_cast<int>(found - goals.begin());
}

std::vector<JointNumber> Elements::numbers(const std::string& setting,
                                           const std::vector<std::string>& names,
                                           bool velocity) const {
  const mjModel* m = model_.get();
  std::vector<JointNumber> numbers;
  const auto append = [&](int joint, const std::string& part) {
    const int address = (velocity ? m->jnt_dofadr : m->jnt_qposadr)[joint];
    const std::string name = this->name(Element::kJoint, joint);
    const std::vector<Part> parts = partsOf(m->jnt_type[joint], velocity);
    if (parts.empty() && part.empty()) {
      numbers.push_back({joint, address, name, unitOf(m->jnt_type[joint], velocity)});
      return true;
    }
    bool found = false;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!part.empty() && part != parts[i].first) continue;
      numbers.push_back(
          {joint, address + static_cast<int>(i), name + "." + parts[i].first, parts[i].second});
      found = true;
    }
    return found;
  };
  if (names == std::vector<std::string>{"all"}) {
    for (const int joint : all(Element::kJoint, setting, names)) append(joint, "");
    return numbers;
  }
  for (const std::string& name : names) {
    // a joint may have a dot in its name
    const bool whole = mj_name2id(m, mjOBJ_JOINT, name.c_str()) >= 0;
    const auto dot = whole ? std::string::npos : name.rfind('.');
    const int joint = one(Element::kJoint, setting, name.substr(0, dot));
    if (append(joint, dot == std::string::npos ? "" : name.substr(dot + 1))) continue;
    std::vector<std::string> known;
    for (const Part& part : partsOf(m->jnt_type[joint], velocity)) {
      known.push_back(name.substr(0, dot) + "." + part.first);
    }
    if (known.empty()) known.push_back(name.substr(0, dot));
    refuse(setting, "holds " + shown(name) + " but that joint's numbers are " + join(known) + ".");
  }
  return numbers;
}

std::vector<JointNumber> Elements::positions(const std::string& setting,
                                             const std::vector<std::string>& names) const {
  return numbers(setting, names, false);
}

std::vector<JointNumber> Elements::velocities(const std::string& setting,
                                              const std::vector<std::string>& names) const {
  return numbers(setting, names, true);
}

JointNumber Elements::single(const std::string& setting, const std::string& name,
                             bool velocity) const {
  const std::vector<JointNumber> found = numbers(setting, {name}, velocity);
  if (found.size() == 1) return found.front();
  std::vector<std::string> known;
  for (const JointNumber& one : found) known.push_back(one.name);
  refuse(setting,
         "is " + shown(name) + ", which has several numbers: name one of " + join(known) + ".");
}

JointNumber Elements::position(const std::string& setting, const std::string& name) const {
  return single(setting, name, false);
}

JointNumber Elements::velocity(const std::string& setting, const std::string& name) const {
  return single(setting, name, true);
}

void Elements::refuse(const std::string& setting, const std::string& is) const {
  throw Error(prefix_ + "." + setting + " " + is);
}

void Elements::refuseName(const std::string& setting, const std::string& what,
                          const std::string& name, const std::vector<std::string>& known) const {
  const std::string problem = (name.empty() ? "names no " + what : "is " + shown(name)) +
                              " but the model " + model_.source() + " has ";
  if (known.empty()) refuse(setting, problem + "no " + what + " with a name.");
  refuse(setting, problem +
                      (name.empty() ? ""
                                    : "no " + what + " of that name" + didYouMean(name, known) +
                                          " It has ") +
                      join(nearestFirst(name, known)) + ".");
}

}  // namespace pmeta
