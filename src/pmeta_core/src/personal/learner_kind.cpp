#include "pmeta_core/personal/learner_kind.h"

namespace pmeta {

Registry<LearnerRow>& learners() {
  static Registry<LearnerRow> learners("learner");
  return learners;
}

void LearnerTask::evaluateOver(int episodes, PersonalParts& parts) const {
  parts.evaluation_envs = makeEnvs([&](int) { return makeEnv(); }, body ? 1 : episodes);
  parts.evaluation_episodes = episodes;
}

void bindAdam(Settings& settings, PersonalSettings& personal) {
  settings.bind("personal.learning_rate", personal.learning_rate, "Adam's learning rate",
                Range::above(0));
  settings.bind("personal.proximal", personal.proximal,
                "the pull after Adam's step, or in the gradient that Adam gets",
                {"decoupled", "coupled"});
}

}  // namespace pmeta
