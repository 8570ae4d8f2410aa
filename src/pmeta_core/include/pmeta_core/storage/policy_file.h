#pragma once

#include <map>
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

/// What a loader needs to rebuild and use a policy: "environment", "learner", "policy" (personal or
/// meta), "task" (of a personal policy), "round", "run_id", "observation_size", "num_actions",
/// "observation" and "action" (JSON: `[{"name": "angle", "unit": "rad", "low": -0.2, "high": 0.2},
/// ...]`, see Quantity; null is no bound), "choices" (JSON: names of the discrete actions),
/// "step_seconds" (how long a step takes, where there is such a time), "hidden_activation",
/// "output_squashing", "input_scaling" and "output_scaling" (see PolicyForm),
/// "task_input" (numbers with commas between, if there are any), "model_hash" and "model_file" (of
/// a physical model, and where it was; none if it is shipped) and "settings", the effective
/// settings as YAML, whose model_file is the run folder's copy.
std::map<std::string, std::string> policyMetadata(const Experiment& experiment, PolicyKind policy,
                                                  int task, int round,
                                                  const std::vector<float>& task_input = {});

/// Writes a policy into the run's folder, as policies/meta.safetensors or
/// policies/task_I.safetensors (`task` does not matter to a meta-policy). Throws Error.
void saveRunPolicy(const Experiment& experiment, PolicyKind policy, int task, int round,
                   const Model& model, const std::vector<float>& task_input = {});

}  // namespace pmeta
