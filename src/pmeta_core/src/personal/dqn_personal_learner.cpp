#include "pmeta_core/personal/dqn_personal_learner.h"

#include <algorithm>

#include "pmeta_core/nn/held_signals.h"

namespace pmeta {

DqnPersonalLearner::DqnPersonalLearner(
    const std::function<std::unique_ptr<Env>()>& make_env, const DqnSettings& settings,
    const ProximalAdamSettings& optimizer, std::int64_t total_updates,
    const std::function<std::unique_ptr<Env>(int k)>& make_training_env)
    : learner_(makeEnvs(
                   make_training_env ? make_training_env : [&](int) { return make_env(); },
                   settings.num_envs),
               settings, total_updates),
      layout_(Precision::kFloat32, learner_.network().blocks()),
      personal_(layout_),
      auxiliary_(layout_),
      optimizer_(personal_.floats().data(), auxiliary_.floats().data(), layout_.size(), optimizer),
      evaluation_(std::make_unique<Evaluation>(
          makeEnvs([&](int) { return make_env(); }, settings.evaluation_episodes))),
      evaluation_workspace_(std::make_unique<MlpWorkspace>(
          learner_.network(), static_cast<std::size_t>(settings.evaluation_episodes))) {}

Model DqnPersonalLearner::initialModel(std::uint64_t seed) const {
  // one start for all tasks
  Rng rng(seed, 0, Stream::kInitialise);
  Model model(layout_);
  learner_.network().initialise(model.floats().data(), rng);
  return model;
}

void DqnPersonalLearner::beginRound(const Model& meta, bool keep_personal) {
  // copy in place: the optimiser holds the addresses
  const std::vector<float>& values = meta.floats();
  std::copy(values.begin(), values.end(), auxiliary_.floats().begin());
  if (!keep_personal || !has_personal_) {
    std::copy(values.begin(), values.end(), personal_.floats().begin());
  }
  if (!has_personal_) learner_.resetTargets(values.data());
  has_personal_ = true;
}

UpdateStats DqnPersonalLearner::update(Rng& rng) {
  // once for all products of the update
  const HeldSignals held_signals;
  const float* parameters = personal_.floats().data();
  UpdateStats stats;
  stats.env_steps = learner_.collect(parameters, rng);
  optimizer_.beginUpdate();
  stats.loss = learner_.update(parameters, optimizer_, rng);
  stats.updates = 1;
  return stats;
}

BatchPolicy DqnPersonalLearner::greedy(const Model& policy) const {
  return [this, &policy](const float* observations, int batch, double* actions) {
    learner_.greedyActions(policy.floats().data(), observations, batch, *evaluation_workspace_,
                           actions);
  };
}

ReturnStats DqnPersonalLearner::evaluate(const Model& policy, Rng& rng) const {
  return evaluation_->run(greedy(policy), rng);
}

Episode DqnPersonalLearner::record(const Model& policy, Rng& rng) const {
  return evaluation_->record(greedy(policy), rng);
}

void DqnPersonalLearner::saveState(StateWriter& writer) const {
  writer.flag("has_personal", has_personal_);
  writer.part("personal", personal_);
  writer.part("auxiliary", auxiliary_);
  writer.part("learner", learner_);
  writer.part("optimizer", optimizer_);
}

void DqnPersonalLearner::loadState(StateReader& reader) {
  has_personal_ = reader.flag("has_personal");
  reader.part("personal", personal_);
  reader.part("auxiliary", auxiliary_);
  reader.part("learner", learner_);
  reader.part("optimizer", optimizer_);
}

}  // namespace pmeta
