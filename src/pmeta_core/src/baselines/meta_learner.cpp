#include "pmeta_core/baselines/meta_learner.h"

namespace pmeta {

Registry<MetaLearnerRow>& metaLearners() {
  static Registry<MetaLearnerRow> rows("algorithm");
  return rows;
}

}  // namespace pmeta
