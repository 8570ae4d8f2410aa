#include "pmeta_core/env/mujoco_model.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstring>
#include <mutex>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

constexpr int kErrorSize = 1000;

// MuJoCo's text on one line, without a full stop
std::string oneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    if (c == '\n') {
      line += ", ";
    } else {
      line += c;
    }
  }
  while (!line.empty() && std::strchr(", .", line.back()) != nullptr) line.pop_back();
  return line;
}

// an error must not return to MuJoCo, which could not go on; its own handler ends the process
void onError(const char* text) { throw Error("MuJoCo: " + oneLine(text) + "."); }

// mjData counts warnings, and MujocoSimulation looks there
void onWarning(const char*) {}

void installHandlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_error == nullptr) mju_user_error = onError;
    if (mju_user_warning == nullptr) mju_user_warning = onWarning;
  });
}

// the names of all objects of that type, in the order of their indices
std::vector<std::string> namesOf(const mjModel* model, mjtObj type, int count) {
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) {
    const char* name = mj_id2name(model, type, i);
    names.emplace_back(name == nullptr ? "" : name);
  }
  return names;
}

}  // namespace

void MujocoModel::Delete::operator()(mjModel_* model) const { mj_deleteModel(model); }

MujocoModel::MujocoModel(mjModel_* model, std::string source, const std::string& complaint)
    : model_(model), source_(std::move(source)) {
  if (model_ == nullptr || !complaint.empty()) {
    throw Error("MuJoCo refuses the model " + source_ + ": " + oneLine(complaint) + ".");
  }
}

MujocoModel MujocoModel::parse(const std::string& xml, const std::string& source) {
  if (xml.empty()) throw Error("the model " + source + " is empty.");
  installHandlers();
  struct DeleteVfs {
    void operator()(mjVFS* vfs) const {
      mj_deleteVFS(vfs);
      delete vfs;
    }
  };
  const std::unique_ptr<mjVFS, DeleteVfs> vfs(new mjVFS);
  mj_defaultVFS(vfs.get());
  constexpr char kName[] = "model.xml";
  if (mj_makeEmptyFileVFS(vfs.get(), kName, static_cast<int>(xml.size())) != 0) {
    throw Error("the model " + source + " does not fit into memory.");
  }
  std::copy(xml.begin(), xml.end(), static_cast<char*>(vfs->filedata[0]));
  char complaint[kErrorSize] = "";
  mjModel* model = mj_loadXML(kName, vfs.get(), complaint, kErrorSize);
  return MujocoModel(model, source, complaint);
}

MujocoModel MujocoModel::load(const std::string& path) {
  requireRegularFile(path, "the model file");
  installHandlers();
  char complaint[kErrorSize] = "";
  mjModel* model = mj_loadXML(path.c_str(), nullptr, complaint, kErrorSize);
  return MujocoModel(model, path, complaint);
}

std::shared_ptr<const MujocoModel> MujocoModel::open(const std::string& path,
                                                     const MujocoLayout& layout) {
  const char* shipped = path.empty() ? shippedModel(layout.model) : nullptr;
  if (path.empty() && shipped == nullptr) {
    throw Error("no model '" + layout.model + "' is shipped: give environment.model_file.");
  }
  auto model =
      std::make_shared<const MujocoModel>(path.empty() ? parse(shipped, layout.model) : load(path));
  model->require(layout);
  return model;
}

MujocoModel MujocoModel::copy() const {
  return MujocoModel(mj_copyModel(nullptr, model_.get()), source_, "");
}

void MujocoModel::require(const MujocoLayout& layout) const {
  const mjModel* m = model_.get();
  const std::string advice = ": see config/models/" + layout.model + ".xml.";
  const auto requireNames = [&](const std::string& what, mjtObj type, int count,
                                const std::vector<std::string>& expected, bool all) {
    const std::vector<std::string> names = namesOf(m, type, count);
    for (const std::string& name : expected) {
      if (std::find(names.begin(), names.end(), name) == names.end()) {
        throw Error("the model " + source_ + " has no " + what + " '" + name + "'" + advice);
      }
    }
    if (all && names != expected) {
      throw Error("the model " + source_ + " has the " + what + "s " + join(names) +
                  " but must have " + join(expected) + ", in this order" + advice);
    }
  };
  requireNames("body", mjOBJ_BODY, m->nbody, layout.bodies, false);
  requireNames("joint", mjOBJ_JOINT, m->njnt, layout.joints, true);
  requireNames("motor", mjOBJ_ACTUATOR, m->nu, layout.motors, true);

  const auto requireSize = [&](const char* what, int size, int expected) {
    if (size == expected) return;
    throw Error("the model " + source_ + " has " + what + " = " + std::to_string(size) +
                " but must have " + std::to_string(expected) + advice);
  };
  requireSize("nq", m->nq, layout.nq);
  requireSize("nv", m->nv, layout.nv);
  // whatever else holds state would be lost in a checkpoint
  requireSize("na", m->na, 0);
  requireSize("nmocap", m->nmocap, 0);
  for (int i = 0; i < m->nu; ++i) {
    const double* range = m->actuator_ctrlrange + 2 * i;
    if (m->actuator_ctrllimited[i] != 0 && range[0] == -1 && range[1] == 1) continue;
    throw Error("the motor '" + layout.motors[i] + "' of the model " + source_ +
                " must be limited to controls from -1 to 1: scale its gear instead" + advice);
  }
}

int MujocoModel::body(const std::string& name) const {
  const int index = mj_name2id(model_.get(), mjOBJ_BODY, name.c_str());
  if (index < 0) throw Error("the model " + source_ + " has no body '" + name + "'.");
  return index;
}

}  // namespace pmeta
