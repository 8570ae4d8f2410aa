#pragma once

#include <optional>
#include <string>
#include <vector>

namespace pmeta {

/// What checkModel found in one array of the model.
struct ModelArrayErrors {
  std::string array;   ///< a field of mjModel, or e.g. "opt.timestep"
  long figures = 0;    ///< how many of them the file has
  double largest = 0;  ///< relative error
  long line = 0;       ///< of the file, where the largest is
};

/// One figure that lies beyond its tolerance.
struct ModelDeviation {
  long line = 0;        ///< of the file, counted from 1
  std::string array;    ///< the field that it is in
  int row = 0;          ///< in that array, from 0
  int col = 0;          ///< in that row, from 0
  std::string name;     ///< of the object, as the file has it
  double recorded = 0;  ///< what the file says
  double compiled = 0;  ///< what MuJoCo made of the shipped model
};

/// What checkModel found.
struct ModelReport {
  std::string kind;                      ///< as given to checkModel()
  std::string path;                      ///< of the file
  long figures = 0;                      ///< that were compared
  std::vector<ModelArrayErrors> arrays;  ///< in the order of the file
  long deviations = 0;                   ///< figures beyond their tolerance
  std::optional<ModelDeviation> first;   ///< of those, in the order of the file

  bool ok() const { return deviations == 0; }  ///< does every figure lie within its tolerance?
};

/// Compares a shipped model as MuJoCo compiles it with a file of its figures: columns array (a
/// field of mjModel; size.*, opt.*, stat.* for those of these parts), row, col, name, value. `kind`
/// is the model's name and "_model", e.g. "ant_model".
///
/// Tolerance: 1e-9 relative, for figures below 1e-3 1e-12 absolute; quaternions up to sign. Throws
/// Error if the file is none of a model, or names what a model does not have.
ModelReport checkModel(const std::string& kind, const std::string& path);

/// The report for people: arrays with an error, and whether all is well.
std::string modelTable(const ModelReport& report);

/// Kinds that checkModel knows.
std::vector<std::string> modelKinds();
bool isModelKind(const std::string& kind);  ///< is that one of modelKinds()?

}  // namespace pmeta
