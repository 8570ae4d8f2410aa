#pragma once

#include <memory>
#include <string>
#include <vector>

struct mjModel_;

namespace pmeta {

/// What an environment relies on in its model.
struct MujocoLayout {
  std::string model;                ///< name of the shipped model, e.g. "half_cheetah"
  int nq = 0;                       ///< numbers in a configuration
  int nv = 0;                       ///< numbers in a velocity
  std::vector<std::string> bodies;  ///< which must be there
  std::vector<std::string> joints;  ///< all of them, in the order of the configuration
  std::vector<std::string> motors;  ///< all of them, in the order of an action
};

/// A compiled model of MuJoCo, the engine of the physical tasks (Todorov, Erez and Tassa, 2012).
///
/// Whatever MuJoCo has against a model or a simulation ends in an Error with MuJoCo's own words; it
/// neither ends the process nor writes a log. A model is read only once it is shared.
class MujocoModel {
 public:
  /// Compiles MJCF text; `source` names it in errors. Throws Error with MuJoCo's own.
  static MujocoModel parse(const std::string& xml, const std::string& source);

  /// The same from a file, which may include others.
  static MujocoModel load(const std::string& path);

  /// The model of that file, or the shipped layout.model where `path` is ""; see require().
  static std::shared_ptr<const MujocoModel> open(const std::string& path,
                                                 const MujocoLayout& layout);

  /// A model of its own with the same figures.
  MujocoModel copy() const;

  /// Throws Error, naming what is missing or wrong, unless the model has the bodies, joints and
  /// motors of `layout`, motors that take controls from -1 to 1, and no other state.
  void require(const MujocoLayout& layout) const;

  /// MuJoCo's own structure, which lives as long as this.
  const mjModel_* get() const { return model_.get(); }
  /// The same, to be written to before the model is shared.
  mjModel_* get() { return model_.get(); }
  const std::string& source() const { return source_; }  ///< where it was read from, for errors

  /// The index of the body of that name; throws Error if there is none.
  int body(const std::string& name) const;

 private:
  struct Delete {
    void operator()(mjModel_* model) const;
  };
  MujocoModel(mjModel_* model, std::string source, const std::string& complaint);

  std::unique_ptr<mjModel_, Delete> model_;
  std::string source_;
};

/// The text of a shipped model (config/models/NAME.xml, part of the library); nullptr if there is
/// none of that name.
const char* shippedModel(const std::string& name);

}  // namespace pmeta
