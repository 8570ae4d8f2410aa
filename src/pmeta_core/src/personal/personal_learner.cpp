#include "pmeta_core/personal/personal_learner.h"

#include <algorithm>

#include "pmeta_core/nn/held_signals.h"

namespace pmeta {
namespace {

// parameters [begin, end) of a network with a strength of its own
struct NetworkRange {
  std::size_t begin, end;
  double lambda;
};

std::vector<NetworkRange> ownRanges(const ModelLayout& layout, const NetworkLambdas& lambdas) {
  std::vector<NetworkRange> ranges;
  std::string last;
  std::size_t offset = 0;
  for (const Block& block : layout.blocks()) {
    const std::string network = block.name.substr(0, block.name.find('.'));
    const std::optional<double> lambda = lambdas.of(network);
    if (lambda && network != last) ranges.push_back({offset, offset, *lambda});
    offset += block.size();
    if (lambda) ranges.back().end = offset;
    last = network;
  }
  return ranges;
}

}  // namespace

PersonalLearner::PersonalLearner(PersonalParts parts, const PersonalSettings& settings)
    : parts_(std::move(parts)),
      evaluation_(std::make_unique<Evaluation>(std::move(parts_.evaluation_envs),
                                               parts_.evaluation_episodes)),
      personal_(parts_.learner->blank()),
      auxiliary_(personal_),
      optimizer_(makePull(personal_, auxiliary_, settings)) {
  for (const NetworkRange& range : ownRanges(layout(), settings.lambdas)) {
    std::get<ProximalAdam>(optimizer_)
        .setLambda(range.begin, range.end - range.begin, range.lambda);
    if (range.lambda == 0) own_.emplace_back(range.begin, range.end);
  }
}

PersonalLearner::Pull PersonalLearner::makePull(Model& personal, Model& auxiliary,
                                                const PersonalSettings& settings) {
  const std::size_t size = personal.size();
  if (personal.layout.precision() == Precision::kFloat64) {
    return ProximalSgd<double>(personal.doubles().data(), auxiliary.doubles().data(), size,
                               settings.alpha, settings.lambda, settings.eta);
  }
  ProximalAdamSettings adam;
  adam.learning_rate = settings.learning_rate;
  adam.alpha = settings.alpha;
  adam.lambda = settings.lambda;
  adam.eta = settings.eta;
  adam.coupled = settings.proximal == "coupled";
  return ProximalAdam(personal.floats().data(), auxiliary.floats().data(), size, adam);
}

Model PersonalLearner::initialModel(std::uint64_t seed) const {
  // one start for all tasks
  Rng rng(seed, 0, Stream::kInitialise);
  Model model(layout());
  parts_.learner->policies().initialise(model, rng);
  return model;
}

void PersonalLearner::beginRound(const Model& meta, bool keep_personal) {
  // copied in place: the optimiser holds the addresses
  const auto take = [&](auto& omega) {
    using Values = std::decay_t<decltype(omega)>;
    const Values& values = std::get<Values>(meta.values);
    Values& phi = std::get<Values>(personal_.values);
    std::copy(values.begin(), values.end(), omega.begin());
    if (has_personal_ && keep_personal) return;
    std::size_t begin = 0;
    if (has_personal_) {
      for (const auto& [own_begin, own_end] : own_) {
        std::copy(values.begin() + begin, values.begin() + own_begin, phi.begin() + begin);
        begin = own_end;
      }
    }
    std::copy(values.begin() + begin, values.end(), phi.begin() + begin);
  };
  std::visit(take, auxiliary_.values);
  parts_.learner->beginRound(meta, !has_personal_);
  if (parts_.reset_moments) std::get<ProximalAdam>(optimizer_).reset();
  has_personal_ = true;
}

UpdateStats PersonalLearner::update(Rng& rng) {
  // once for all products of the update: there are 70 with the inference network
  const HeldSignals held_signals;
  if (auto* adam = std::get_if<ProximalAdam>(&optimizer_)) {
    adam->beginUpdate();
    return parts_.learner->learn(personal_, adam, rng);
  }
  auto& sgd = std::get<ProximalSgd<double>>(optimizer_);
  const UpdateStats stats = parts_.learner->learn(personal_, &sgd, rng);
  sgd.moveAuxiliary();
  return stats;
}

ReturnStats PersonalLearner::evaluate(const Model& policy, const std::vector<float>& task_input,
                                      Rng& rng) const {
  if (const std::optional<ReturnStats> exact = parts_.learner->exactReturn(policy)) return *exact;
  const std::unique_ptr<Actor> actor =
      parts_.learner->policies().actor(policy, task_input, evaluation_->width());
  return evaluation_->run(*actor, rng);
}

std::vector<AdaptedReturn> PersonalLearner::evaluateAdapted(const Model& policy, Rng& rng) const {
  if (!parts_.adapt) return {{0, evaluate(policy, rng), taskInput(policy)}};
  const std::unique_ptr<Adaptation> adaptation = parts_.adapt(policy);
  return pmeta::evaluateAdapted(*evaluation_, *adaptation, parts_.exploration_episodes, rng);
}

Episode PersonalLearner::record(const Model& policy, Rng& rng) const {
  return recordWith(policy, taskInput(policy), rng);
}

Episode PersonalLearner::recordWith(const Model& policy, const std::vector<float>& task_input,
                                    Rng& rng) const {
  const std::unique_ptr<Actor> actor = parts_.learner->policies().actor(policy, task_input, 1);
  Episode episode = evaluation_->record(*actor, rng);
  parts_.learner->addValues(policy, task_input, episode);
  return episode;
}

void PersonalLearner::saveState(StateWriter& writer) const {
  writer.flag("has_personal", has_personal_);
  writer.part("personal", personal_);
  writer.part("auxiliary", auxiliary_);
  writer.part("learner", learner());
  if (std::holds_alternative<ProximalAdam>(optimizer_)) writer.part("optimizer", adam());
}

void PersonalLearner::loadState(StateReader& reader) {
  has_personal_ = reader.flag("has_personal");
  reader.part("personal", personal_);
  reader.part("auxiliary", auxiliary_);
  reader.part("learner", *parts_.learner);
  if (auto* adam = std::get_if<ProximalAdam>(&optimizer_)) reader.part("optimizer", *adam);
}

}  // namespace pmeta
