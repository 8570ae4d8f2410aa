#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/number.h"
#include "pmeta_core/env/walker2d.h"

namespace pmeta {
namespace {

const RegisteredFamily<Walker2dParamsFamily> kWalker2dParams("walker_2d_params");

constexpr double kScale = 3;  ///< the logarithms of the factors reach from -3 to 3
constexpr double kDampingBase = 1.3;
constexpr double kBase = 1.5;

std::vector<double> drawFactors(double base, int count, Rng& rng) {
  std::vector<double> factors(static_cast<std::size_t>(count));
  for (double& factor : factors) factor = std::pow(base, kScale * (2 * rng.uniform() - 1));
  return factors;
}

void multiply(double* figures, int count, const std::vector<double>& factors, const char* name) {
  if (factors.size() != static_cast<std::size_t>(count)) {
    throw Error("a walker's task has " + std::to_string(factors.size()) + " factors of " + name +
                " but the model has " + std::to_string(count) + " figures.");
  }
  for (int i = 0; i < count; ++i) figures[i] *= factors[static_cast<std::size_t>(i)];
}

double totalMass(const mjModel* model) {
  double sum = 0;
  for (int i = 0; i < model->nbody; ++i) sum += model->body_mass[i];
  return sum;
}

}  // namespace

Walker2dTask drawWalker2dTask(const MujocoModel& base, Rng& rng) {
  const mjModel* m = base.get();
  Walker2dTask task;
  task.body_mass = drawFactors(kBase, m->nbody, rng);
  task.body_inertia = drawFactors(kBase, 3 * m->nbody, rng);
  task.dof_damping = drawFactors(kDampingBase, m->nv, rng);
  task.geom_friction = drawFactors(kBase, 3 * m->ngeom, rng);
  return task;
}

std::shared_ptr<const MujocoModel> applyWalker2dTask(const MujocoModel& base,
                                                     const Walker2dTask& task) {
  auto model = std::make_shared<MujocoModel>(base.copy());
  mjModel* m = model->get();
  multiply(m->body_mass, m->nbody, task.body_mass, "body_mass");
  multiply(m->body_inertia, 3 * m->nbody, task.body_inertia, "body_inertia");
  multiply(m->dof_damping, m->nv, task.dof_damping, "dof_damping");
  multiply(m->geom_friction, 3 * m->ngeom, task.geom_friction, "geom_friction");
  return model;
}

std::string describeWalker2dModel(const MujocoModel& model, const MujocoModel& base) {
  const mjModel* m = model.get();
  const auto friction = [m](const char* body) {
    // of a contact, the larger of floor (geom 0) and foot
    const int foot = std::max(0, m->body_geomadr[mj_name2id(m, mjOBJ_BODY, body)]);
    return std::max(m->geom_friction[0], m->geom_friction[3 * foot]);
  };
  const NumbersWithDots dots;
  char text[120];
  std::snprintf(text, sizeof text, "%.3g kg (base %.3g), friction of the feet %.2g and %.2g",
                totalMass(m), totalMass(base.get()), friction("foot"), friction("foot_left"));
  return text;
}

}  // namespace pmeta
