#include "pmeta_core/run/protocol.h"

namespace pmeta {

const char* name(Policy policy) { return policy == Policy::kPersonal ? "personal" : "meta"; }
const char* name(Split split) { return split == Split::kTrain ? "train" : "test"; }

}  // namespace pmeta
