#include "pmeta_core/personal/sac_personal_learner.h"

#include <algorithm>

#include "pmeta_core/learn/action_values.h"
#include "pmeta_core/learn/context_adaptation.h"
#include "pmeta_core/nn/held_signals.h"

namespace pmeta {
namespace {

constexpr int kActionGrid = 21;  // fine enough for the eye, and 2 kB in an episode

std::vector<float> taskInputOf(const SacSettings& settings, int task, int num_tasks) {
  return settings.task_encoding == "one_hot" ? oneHot(task, num_tasks) : std::vector<float>();
}

// zero parameters, of which the other tasks' one-hot columns are absent
Model ownedModel(const ModelLayout& layout, const SacLearner& learner) {
  Model model(layout);
  const SacSettings& settings = learner.settings();
  if (settings.task_encoding != "one_hot" || !settings.own_column) return model;
  model.present.assign(layout.size(), 1);
  const SacNetworks& networks = learner.networks();
  const auto removeColumns = [&](std::size_t offset, const Mlp& mlp) {
    // the first block is the first layer's weight, [outputs, inputs]
    for (std::size_t o = 0; o < mlp.blocks().front().shape[0]; ++o) {
      const std::size_t row = offset + o * mlp.inputs() + networks.observationSize();
      for (std::size_t i = 0; i < networks.taskInputSize(); ++i) {
        model.present[row + i] = learner.taskInput()[i] != 0;
      }
    }
  };
  removeColumns(0, networks.actor());
  for (int k = 0; k < 2; ++k) removeColumns(networks.criticOffset(k), networks.critic(k));
  return model;
}

}  // namespace

SacPersonalLearner::SacPersonalLearner(const std::function<std::unique_ptr<Env>()>& make_env,
                                       const SacSettings& settings,
                                       const ProximalAdamSettings& optimizer, int task,
                                       int num_tasks, const SacLambdas& lambdas)
    : learner_(make_env(), settings, taskInputOf(settings, task, num_tasks)),
      layout_(Precision::kFloat32, learner_.networks().blocks()),
      personal_(ownedModel(layout_, learner_)),
      auxiliary_(personal_),
      optimizer_(personal_.floats().data(), auxiliary_.floats().data(), layout_.size(), optimizer),
      evaluation_(std::make_unique<Evaluation>(
          makeEnvs([&](int) { return make_env(); }, settings.evaluation_episodes))),
      evaluation_workspace_(std::make_unique<SacNetworks::ActorWorkspace>(
          learner_.networks(), static_cast<std::size_t>(settings.evaluation_episodes))),
      exploration_env_(learner_.networks().hasEncoder() ? make_env() : nullptr) {
  const SacNetworks& networks = learner_.networks();
  setLambda(0, networks.actor(), lambdas.actor);
  for (int k = 0; k < 2; ++k) {
    setLambda(networks.criticOffset(k), networks.critic(k), lambdas.critic);
  }
  if (networks.hasEncoder()) {
    setLambda(networks.encoderOffset(), networks.encoder().network(), lambdas.encoder);
  }
}

void SacPersonalLearner::setLambda(std::size_t offset, const Mlp& network, double lambda) {
  if (lambda < 0) return;
  optimizer_.setLambda(offset, network.size(), lambda);
  if (lambda == 0) own_.emplace_back(offset, offset + network.size());
}

Model SacPersonalLearner::initialModel(std::uint64_t seed) const {
  // one start for all tasks
  Rng rng(seed, 0, Stream::kInitialise);
  Model model(layout_);
  learner_.networks().initialise(model.floats().data(), rng);
  return model;
}

void SacPersonalLearner::beginRound(const Model& meta, bool keep_personal) {
  // copy in place: the optimiser holds the addresses
  const std::vector<float>& values = meta.floats();
  std::copy(values.begin(), values.end(), auxiliary_.floats().begin());
  std::vector<float>& personal = personal_.floats();
  if (!has_personal_) {
    std::copy(values.begin(), values.end(), personal.begin());
  } else if (!keep_personal) {
    std::size_t begin = 0;
    for (const auto& [own_begin, own_end] : own_) {
      std::copy(values.begin() + begin, values.begin() + own_begin, personal.begin() + begin);
      begin = own_end;
    }
    std::copy(values.begin() + begin, values.end(), personal.begin() + begin);
  }
  const SacSettings& settings = learner_.settings();
  if (!has_personal_ || settings.targets_at_round == "meta") learner_.resetTargets(values.data());
  if (settings.reset_moments) optimizer_.reset();
  const SacNetworks& networks = learner_.networks();
  if (networks.hasEncoder() && settings.context.explorer == "meta") {
    explorer_.assign(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(networks.actor().size()));
  }
  has_personal_ = true;
}

UpdateStats SacPersonalLearner::update(Rng& rng) {
  // once for all products of the update: there are 70 with the inference network
  const HeldSignals held_signals;
  const float* parameters = personal_.floats().data();
  UpdateStats stats;
  const std::int64_t broken_before = learner_.brokenEpisodes();
  stats.env_steps =
      learner_.collect(parameters, rng, explorer_.empty() ? nullptr : explorer_.data());
  stats.broken_episodes = learner_.brokenEpisodes() - broken_before;
  optimizer_.beginUpdate();
  stats.loss = learner_.update(parameters, optimizer_, rng).critic;
  stats.updates = 1;
  return stats;
}

std::vector<float> SacPersonalLearner::taskInput(const Model& policy) const {
  if (!learner_.networks().hasEncoder()) return learner_.taskInput();
  const LatentPosterior posterior = learner_.contextPosterior(policy.floats().data());
  return {posterior.mean.begin(), posterior.mean.end()};
}

BatchPolicy SacPersonalLearner::greedy(const Model& policy,
                                       const std::vector<float>& task_input) const {
  return [this, &policy, &task_input](const float* observations, int batch, double* actions) {
    learner_.networks().greedyActions(policy.floats().data(), observations,
                                      static_cast<std::size_t>(batch), task_input.data(),
                                      *evaluation_workspace_, actions);
  };
}

ReturnStats SacPersonalLearner::evaluate(const Model& policy, Rng& rng) const {
  const std::vector<float> task_input = taskInput(policy);
  return evaluation_->run(greedy(policy, task_input), rng);
}

Episode SacPersonalLearner::record(const Model& policy, Rng& rng) const {
  return recordWith(policy, taskInput(policy), rng);
}

Episode SacPersonalLearner::recordAdapted(const Model& policy, const AdaptedReturn& adapted,
                                          Rng& rng) const {
  if (!learner_.networks().hasEncoder()) return record(policy, rng);
  return recordWith(policy, adapted.task_input, rng);
}

Episode SacPersonalLearner::recordWith(const Model& policy, const std::vector<float>& task_input,
                                       Rng& rng) const {
  Episode episode = evaluation_->record(greedy(policy, task_input), rng);
  const SacNetworks& networks = learner_.networks();
  if (networks.actionSize() == 2) {
    const std::vector<float> start(
        episode.observations.begin(),
        episode.observations.begin() + static_cast<std::ptrdiff_t>(networks.observationSize()));
    episode.action_grid = kActionGrid;
    episode.action_values = actionValues(networks, policy.floats().data(), start.data(),
                                         task_input.data(), kActionGrid);
  }
  return episode;
}

std::vector<AdaptedReturn> SacPersonalLearner::evaluateAdapted(const Model& policy,
                                                               Rng& rng) const {
  if (!learner_.networks().hasEncoder()) return {{0, evaluate(policy, rng)}};
  const Rng starts = rng;
  // before exploring there is the prior's mean; `rng` moves on, away from the starts
  const std::vector<float> unknown(learner_.networks().encoder().latentSize());
  std::vector<AdaptedReturn> returns = {
      {0, evaluation_->run(greedy(policy, unknown), rng), unknown}};
  for (const Adaptation& adaptation : adapt(learner_.networks(), learner_.settings().context,
                                            policy.floats().data(), *exploration_env_, rng)) {
    Rng same_starts = starts;
    returns.push_back({adaptation.episodes,
                       evaluation_->run(greedy(policy, adaptation.latent), same_starts),
                       adaptation.latent});
    returns.back().stats.broken_episodes += adaptation.broken_episodes;
  }
  return returns;
}

void SacPersonalLearner::saveState(StateWriter& writer) const {
  writer.flag("has_personal", has_personal_);
  writer.part("personal", personal_);
  writer.part("auxiliary", auxiliary_);
  writer.part("learner", learner_);
  writer.part("optimizer", optimizer_);
}

void SacPersonalLearner::loadState(StateReader& reader) {
  has_personal_ = reader.flag("has_personal");
  reader.part("personal", personal_);
  reader.part("auxiliary", auxiliary_);
  reader.part("learner", learner_);
  reader.part("optimizer", optimizer_);
}

}  // namespace pmeta
