#include "pmeta_core/run/party.h"

#include <string>

#include "pmeta_core/base/error.h"

namespace pmeta {

void Party::savePersonal(const Experiment&, int) const {}

void refuseUnevaluated(const MetaPolicy& meta) {
  throw Error("the meta-policy of round " + std::to_string(meta.round) +
              " has not been evaluated: do that before recording an episode of it.");
}

void RoundResult::saveState(StateWriter& writer) const {
  writer.count("env_steps", env_steps);
  writer.count("updates", updates);
  writer.count("broken_episodes", broken_episodes);
  writer.value("loss", loss);
  writer.value("distance", distance);
  writer.flag("evaluated", personal.has_value());
  if (personal) writer.part("personal", *personal);
}

void RoundResult::loadState(StateReader& reader) {
  env_steps = reader.count("env_steps");
  updates = reader.count("updates");
  broken_episodes = reader.count("broken_episodes");
  loss = reader.value<double>("loss");
  distance = reader.value<double>("distance");
  personal.reset();
  if (reader.flag("evaluated")) reader.part("personal", personal.emplace());
}

}  // namespace pmeta
