#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/messages/protocol.h"

namespace pmeta {

/// A trained policy as a file: its parameters, and text about them.
///
/// The file is of the safetensors format: 8 bytes that give the header's length (little-endian), a
/// JSON header `{"NAME": {"dtype": "F32", "shape": [2, 3], "data_offsets": [BEGIN, END]}, ...,
/// "__metadata__": {"KEY": "VALUE", ...}}` padded with blanks to a multiple of 8 bytes, then the
/// values, row-major and little-endian, with offsets counted from the header's end. The tensors are
/// the blocks of the layout (F32 or F64); a model with a presence mask has a tensor "NAME.present"
/// (U8, the same shape) for each of them.
struct PolicyFile {
  Model model;                                  ///< the parameters
  std::map<std::string, std::string> metadata;  ///< see policyMetadata()
};

/// Writes the file, never half of it. The key "layout" is added to the metadata. Throws Error if
/// the file cannot be written or the model's sizes contradict its layout.
void savePolicy(const std::string& path, const Model& model,
                std::map<std::string, std::string> metadata);

/// Reads what savePolicy() wrote, also after other programs have reordered it. Throws Error on
/// anything else; what a file claims is held against its size before memory is taken.
PolicyFile loadPolicy(const std::string& path);

/// Where in a run a policy comes from.
struct PolicyOrigin {
  PolicyKind policy = PolicyKind::kMeta;  ///< whose
  int task = -1;                          ///< of a personal policy
  int round = 0;                          ///< after which
  /// In the evaluation that this round's schedule had: a personal policy's on its own task, of a
  /// meta-policy MP. None if there was no such evaluation.
  std::optional<double> mean_return = std::nullopt;
  std::vector<float> task_input = {};  ///< what tells it its task beside the observations
};

/// What a loader needs to rebuild and use a policy: "environment", "learner", "policy" (personal or
/// meta), "task" (of a personal policy), "round", "return" (PolicyOrigin::mean_return, where there
/// is one), "run_id", "observation_size", "num_actions",
/// "observation" and "action" (JSON: `[{"name": "angle", "unit": "rad", "low": -0.2, "high": 0.2},
/// ...]`, see Quantity; null is no bound), "choices" (JSON: names of the discrete actions),
/// "step_seconds" (how long a step takes, where there is such a time), "hidden_activation",
/// "output_squashing", "input_scaling" and "output_scaling" (see PolicyForm),
/// "task_input" (numbers with commas between, if there are any), "model_hash" and "model_file" (of
/// a physical model, and where it was; none if it is shipped) and "settings", the effective
/// settings as YAML, whose model_file is the run folder's copy.
std::map<std::string, std::string> policyMetadata(const Experiment& experiment,
                                                  const PolicyOrigin& origin);

/// Which of a run's policies are meant: those it ended with, or the best it had.
enum class Kept { kLast, kBest };

/// "policies" or "policies/best", below the run's folder.
std::string policiesFolder(Kept kept);

/// Where a run keeps them: meta.safetensors or task_I.safetensors in policiesFolder().
std::string policyPath(const std::string& run_dir, Kept kept, PolicyKind policy, int task);

/// Writes a policy to its policyPath(). Throws Error.
void saveRunPolicy(const Experiment& experiment, Kept kept, const PolicyOrigin& origin,
                   const Model& model);

}  // namespace pmeta
