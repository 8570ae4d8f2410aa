#include "policy/policy_params.h"

#include "common/private_param.h"
#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

constexpr int kMostTasks = 1000000;  // whose policy it is decides how many there are
constexpr int kMostSeeds = 2147483647;

}  // namespace

PolicyParams policyParams() {
  PolicyParams params;
  params.file = privateText("policy", "");
  if (params.file.empty()) {
    throw pmeta::Error(
        "which policy? Give the private parameter policy, e.g. "
        "_policy:=RUN_FOLDER/policies/task_0.safetensors.");
  }
  params.task = privateIndex("task", -1, kMostTasks);
  params.explores = privateFlag("explore", true);
  params.seed = static_cast<std::uint64_t>(privateIndex("seed", 0, kMostSeeds));
  return params;
}

}  // namespace pmeta_nodes
