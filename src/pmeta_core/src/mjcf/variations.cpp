// In what tasks may differ: numbers of the model, and of other terms' settings.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/mjcf/terms.h"

namespace pmeta {

Registry<TermRow<VariationTerm>>& VariationTerm::registry() {
  static Registry<TermRow<VariationTerm>> rows("variation term");
  return rows;
}

namespace {

constexpr double kAny = -std::numeric_limits<double>::infinity();

Figure figureAt(double* number, double least) {
  return {*number, [number](double value) { *number = value; }, least};
}

/// A number of another term: its weight, its target, a limit.
class SettingVariation : public VariationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("setting", setting_,
                  "which of the environment's, e.g. rewards.forward.weight or forward.weight");
    settings.bind("component", component_, "of a list, which of its numbers, from 0",
                  Range::atLeast(0));
  }
  void find(const Elements&) override {}
  std::vector<Figure> figures(TaskDraft& draft) const override {
    const std::string source = "named by environment.variations";
    const std::string key = draft.settings->resolve(setting_, source);
    const YAML::Node value = YAML::Load(draft.settings->text(key, source));
    const auto component = static_cast<std::size_t>(component_);
    const bool is_list = value.IsSequence();
    const YAML::Node number = is_list && component < value.size() ? value[component] : value;
    double before = 0;
    if (key.rfind("environment.", 0) != 0 || !YAML::convert<double>::decode(number, before)) {
      throw Error("environment.variations: " + key + " is " + shown(YAML::Dump(value)) +
                  " but must be a number of the environment's, or a list and a component of it.");
    }
    return {{before, [&draft, key, value, is_list, component](double changed) {
               YAML::Node whole = YAML::Clone(value);
               if (is_list) whole[component] = formatNumber(changed);
               std::string text = is_list ? YAML::Dump(whole) : formatNumber(changed);
               draft.assignments.push_back(key + ":=" + text);
             }}};
  }
  bool changesModel() const override { return false; }

 private:
  std::string setting_;
  int component_ = 0;
};
const RegisteredTerm<VariationTerm, SettingVariation> kSetting(
    "setting", "a number of the settings of the environment's terms, in its unit");

class Gravity : public VariationTerm {
 public:
  void bind(TermSettings& settings) override {
    settings.bind("axis", axis_, "of the world; z points up", {"x", "y", "z"});
  }
  void find(const Elements&) override {}
  std::vector<Figure> figures(TaskDraft& draft) const override {
    return {figureAt(draft.model->opt.gravity + (axis_[0] - 'x'), kAny)};
  }

 private:
  std::string axis_ = "z";
};
const RegisteredTerm<VariationTerm, Gravity> kGravity("gravity",
                                                      "along an axis, m/s^2; usually z, -9.81");

/// Numbers of several elements of one kind.
class OfElements : public VariationTerm {
 public:
  OfElements(Element kind, const char* setting) : kind_(kind), setting_(setting) {}
  void bind(TermSettings& settings) override { settings.bind(setting_, names_, "whose, by name"); }
  void find(const Elements& elements) override { indices_ = elements.all(kind_, setting_, names_); }
  std::vector<Figure> figures(TaskDraft& draft) const override {
    std::vector<Figure> figures;
    for (const int index : indices_) append(draft.model, index, figures);
    return figures;
  }

 private:
  virtual void append(mjModel* model, int index, std::vector<Figure>& figures) const = 0;

  Element kind_;
  const char* setting_;
  std::vector<std::string> names_ = {"all"};
  std::vector<int> indices_;
};

class BodyMass : public OfElements {
 public:
  BodyMass() : OfElements(Element::kBody, "bodies") {}
  void bind(TermSettings& settings) override {
    OfElements::bind(settings);
    settings.bind("inertia", inertia_, "scale inertias by as much; false: they stay as they are");
  }

 private:
  void append(mjModel* m, int body, std::vector<Figure>& figures) const override {
    const double before = m->body_mass[body];
    figures.push_back({before,
                       [m, body, before, scales = inertia_](double mass) {
                         m->body_mass[body] = mass;
                         if (!scales || before == 0) return;
                         mju_scl3(m->body_inertia + 3 * body, m->body_inertia + 3 * body,
                                  mass / before);
                       },
                       0});
  }

  bool inertia_ = true;
};
const RegisteredTerm<VariationTerm, BodyMass> kBodyMass("body_mass", "of bodies, kg");

class BodyInertia : public OfElements {
 public:
  BodyInertia() : OfElements(Element::kBody, "bodies") {}
  void bind(TermSettings& settings) override {
    OfElements::bind(settings);
    settings.bind("axes", axes_, "principal axes of the body, which", {"x", "y", "z"});
  }

 private:
  void append(mjModel* m, int body, std::vector<Figure>& figures) const override {
    for (const std::string& axis : axes_) {
      figures.push_back(figureAt(m->body_inertia + 3 * body + (axis[0] - 'x'), 0));
    }
  }

  std::vector<std::string> axes_ = {"x", "y", "z"};
};
const RegisteredTerm<VariationTerm, BodyInertia> kBodyInertia(
    "body_inertia", "of bodies about their principal axes, kg m^2");

class JointDamping : public OfElements {
 public:
  JointDamping() : OfElements(Element::kJoint, "joints") {}

 private:
  void append(mjModel* m, int joint, std::vector<Figure>& figures) const override {
    const int first = m->jnt_dofadr[joint];
    const int end = joint + 1 < m->njnt ? m->jnt_dofadr[joint + 1] : m->nv;
    for (int dof = first; dof < end; ++dof) figures.push_back(figureAt(m->dof_damping + dof, 0));
  }
};
const RegisteredTerm<VariationTerm, JointDamping> kJointDamping("joint_damping",
                                                                "of joints, N m s/rad or N s/m");

class JointStiffness : public OfElements {
 public:
  JointStiffness() : OfElements(Element::kJoint, "joints") {}

 private:
  void append(mjModel* m, int joint, std::vector<Figure>& figures) const override {
    figures.push_back(figureAt(m->jnt_stiffness + joint, 0));
  }
};
const RegisteredTerm<VariationTerm, JointStiffness> kJointStiffness(
    "joint_stiffness", "of joints' springs, N m/rad or N/m");

class GeomFriction : public OfElements {
 public:
  GeomFriction() : OfElements(Element::kGeom, "geoms") {}
  void bind(TermSettings& settings) override {
    OfElements::bind(settings);
    settings.bind("kinds", kinds_, "of friction, which: MuJoCo has three", allKinds());
  }

 private:
  static const std::vector<std::string>& allKinds() {
    static const std::vector<std::string> kKinds = {"sliding", "torsional", "rolling"};
    return kKinds;
  }
  void append(mjModel* m, int geom, std::vector<Figure>& figures) const override {
    for (const std::string& kind : kinds_) {
      const auto at = std::find(allKinds().begin(), allKinds().end(), kind) - allKinds().begin();
      figures.push_back(figureAt(m->geom_friction + 3 * geom + at, 0));
    }
  }

  std::vector<std::string> kinds_ = {"sliding"};
};
const RegisteredTerm<VariationTerm, GeomFriction> kGeomFriction(
    "geom_friction",
    "of geoms: sliding has no unit, torsional and rolling have m; of two that touch, the larger");

class ActuatorGain : public OfElements {
 public:
  ActuatorGain() : OfElements(Element::kActuator, "actuators") {}

 private:
  void append(mjModel* m, int actuator, std::vector<Figure>& figures) const override {
    figures.push_back(figureAt(m->actuator_gainprm + mjNGAIN * actuator, kAny));
  }
};
const RegisteredTerm<VariationTerm, ActuatorGain> kActuatorGain(
    "actuator_gain", "first number of gainprm: force by control, before the gear");

/// A body's length: by how much its shapes, sites and children lie further from its origin.
class LinkLength : public OfElements {
 public:
  LinkLength() : OfElements(Element::kBody, "bodies") {}

 private:
  void append(mjModel* m, int body, std::vector<Figure>& figures) const override {
    for (int geom = 0; geom < m->ngeom; ++geom) {
      const int type = m->geom_type[geom];
      if (m->geom_bodyid[geom] != body || (type != mjGEOM_MESH && type != mjGEOM_HFIELD)) continue;
      throw Error("environment.variations: the body '" +
                  std::string(mj_id2name(m, mjOBJ_BODY, body)) +
                  "' has a mesh, whose length cannot be varied: give it capsules, cylinders or "
                  "boxes.");
    }
    figures.push_back({1, [m, body](double factor) { stretch(m, body, factor); }, 0.01});
  }

  static void stretch(mjModel* m, int body, double factor) {
    for (int i = 0; i < m->ngeom; ++i) {
      if (m->geom_bodyid[i] == body) stretchGeom(m, i, factor);
    }
    for (int i = 0; i < m->nsite; ++i) {
      if (m->site_bodyid[i] == body) mju_scl3(m->site_pos + 3 * i, m->site_pos + 3 * i, factor);
    }
    for (int i = 1; i < m->nbody; ++i) {
      if (m->body_parentid[i] == body) mju_scl3(m->body_pos + 3 * i, m->body_pos + 3 * i, factor);
    }
    // as of a rod, whose least inertia is that about its length
    double* inertia = m->body_inertia + 3 * body;
    const auto along = std::min_element(inertia, inertia + 3) - inertia;
    for (int i = 0; i < 3; ++i) inertia[i] *= i == along ? factor : factor * factor * factor;
    m->body_mass[body] *= factor;
    mju_scl3(m->body_ipos + 3 * body, m->body_ipos + 3 * body, factor);
  }

  static void stretchGeom(mjModel* m, int geom, double factor) {
    mju_scl3(m->geom_pos + 3 * geom, m->geom_pos + 3 * geom, factor);
    double* size = m->geom_size + 3 * geom;
    const int type = m->geom_type[geom];
    if (type == mjGEOM_CAPSULE || type == mjGEOM_CYLINDER) {
      size[1] *= factor;
      m->geom_rbound[geom] =
          type == mjGEOM_CAPSULE ? size[0] + size[1] : std::hypot(size[0], size[1]);
    } else if (type == mjGEOM_BOX) {
      *std::max_element(size, size + 3) *= factor;
      m->geom_rbound[geom] = mju_norm3(size);
    }
  }
};
const RegisteredTerm<VariationTerm, LinkLength> kLinkLength(
    "link_length",
    "of bodies, as a factor on what the model has; mass and inertia follow as those of a rod");

}  // namespace
}  // namespace pmeta
