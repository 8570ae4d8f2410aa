#include "pmeta_core/learn/sac.h"

#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/action_values.h"

namespace pmeta {
namespace {

constexpr int kActionGrid = 21;  // fine enough for the eye, and 2 kB in an episode

const std::vector<float>& requireTaskInput(const std::vector<float>& task_input,
                                           const SacSettings& settings) {
  if (settings.isTold() == task_input.empty()) {
    throw Error("soft actor-critic takes a task input of " + std::to_string(task_input.size()) +
                " numbers with task_encoding '" + settings.task_encoding +
                "': give the one-hot vector with one_hot and model, and nothing otherwise.");
  }
  return task_input;
}

std::optional<ContextStore> makeContext(const SacNetworks& networks,
                                        const ContextSettings& settings) {
  if (!networks.hasEncoder()) return std::nullopt;
  return ContextStore(networks.encoder(), settings, static_cast<int>(networks.observationSize()),
                      static_cast<int>(networks.actionSize()));
}

std::optional<ReplayBuffer> makeModelled(const SacNetworks& networks,
                                         const TaskModelSettings& settings) {
  if (!networks.hasTaskModel()) return std::nullopt;
  return ReplayBuffer(static_cast<std::size_t>(settings.buffer_size),
                      static_cast<int>(networks.observationSize()),
                      static_cast<int>(networks.actionSize()));
}

// of the actor while it acts: without an encoder the same for good
std::vector<float> actingInput(const SacNetworks& networks, const std::vector<float>& task_input) {
  return networks.hasEncoder() ? std::vector<float>(networks.taskInputSize()) : task_input;
}

}  // namespace

SacLearner::SacLearner(std::unique_ptr<Env> env, const SacSettings& settings,
                       std::vector<float> task_input)
    : settings_(settings),
      own_input_(task_input),
      policies_(env->spec(), settings, static_cast<int>(task_input.size())),
      context_(makeContext(networks(), settings.context)),
      modelled_(makeModelled(networks(), settings.task_model)),
      source_(makeSource(task_input)),
      collector_(std::move(env), networks(), settings,
                 actingInput(networks(), requireTaskInput(task_input, settings)), source_.get()),
      update_(networks(), settings, task_input) {
  if (modelled_) model_update_.emplace(networks().taskModel(), update_.batch(), task_input);
  report({}, 0);
}

std::unique_ptr<TaskSource> SacLearner::makeSource(const std::vector<float>& task_input) {
  if (context_) return std::make_unique<InferredTasks>(networks(), settings_.context, *context_);
  if (!modelled_) return nullptr;
  return std::make_unique<OwnOrDrawnTask>(task_input, settings_.task_model, *modelled_);
}

// allocates nothing after the first call
void SacLearner::report(const SacLosses& losses, double model_loss) {
  losses_.assign({{"critic", losses.critic},
                  {"actor", losses.actor},
                  {"entropy", losses.entropy},
                  {"temperature", losses.temperature}});
  if (context_) losses_.push_back({"kl", losses.kl});
  if (modelled_) losses_.push_back({"task_model", model_loss});
}

SacLosses SacLearner::update(const float* parameters, Optimizer<float>& optimizer, Rng& rng) {
  const ReplayBuffer& replay = collector_.replay();
  if (replay.size() == 0) throw Error("call collect() before soft actor-critic's update().");
  for (InferredTask& task : update_.tasks()) {
    context_->draw(parameters + networks().encoderOffset(), rng, task);
  }
  for (std::size_t b = 0; b < update_.batch(); ++b) {
    update_.put(b, replay[rng.below(replay.size())]);
  }
  return update_.apply(parameters, optimizer, rng);
}

Model SacLearner::blank() const {
  Model model(policies_.layout());
  if (!settings_.isTold() || !settings_.own_column) return model;
  model.present.assign(model.size(), 1);
  for (const std::size_t weights : networks().taskWeights()) {
    for (std::size_t i = 0; i < own_input_.size(); ++i) {
      model.present[weights + i] = own_input_[i] != 0;
    }
  }
  return model;
}

void SacLearner::beginRound(const Model& meta, bool first) {
  const std::vector<float>& values = meta.floats();
  if (first || settings_.targets_at_round == "meta") resetTargets(values.data());
  if (source_ && settings_.context.explorer == "meta") {
    explorer_.assign(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(networks().actor().size()));
  }
}

UpdateStats SacLearner::learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) {
  const float* values = parameters.floats().data();
  UpdateStats stats;
  const std::int64_t broken_before = brokenEpisodes();
  stats.env_steps = collect(values, rng, explorer_.empty() ? nullptr : explorer_.data());
  stats.broken_episodes = brokenEpisodes() - broken_before;
  Optimizer<float>& steps = *std::get<Optimizer<float>*>(optimizer);
  const SacLosses losses = update(values, steps, rng);
  report(losses, updateModel(values, steps, rng));
  stats.loss = losses.critic;
  stats.updates = 1;
  return stats;
}

double SacLearner::updateModel(const float* parameters, Optimizer<float>& optimizer,
                               const Rng& rng) {
  if (!modelled_) return 0;
  Rng rows = rng.branch(Stream::kTaskModel);
  const std::size_t offset = networks().taskModelOffset();
  return model_update_->apply(parameters + offset, *modelled_, offset, optimizer, rows);
}

std::vector<float> SacLearner::taskInput(const Model& policy) const {
  if (!context_) return own_input_;
  const LatentPosterior posterior =
      context_->posterior(policy.floats().data() + networks().encoderOffset());
  return {posterior.mean.begin(), posterior.mean.end()};
}

void SacLearner::addValues(const Model& policy, const std::vector<float>& task_input,
                           Episode& episode) const {
  if (networks().actionSize() != 2) return;
  const std::vector<float> start(
      episode.observations.begin(),
      episode.observations.begin() + static_cast<std::ptrdiff_t>(networks().observationSize()));
  episode.action_grid = kActionGrid;
  episode.action_values = actionValues(networks(), policy.floats().data(), start.data(),
                                       task_input.data(), kActionGrid);
}

void SacLearner::saveState(StateWriter& writer) const {
  update_.saveState(writer);
  collector_.saveState(writer);
  if (context_) writer.part("context", *context_);
  if (modelled_) writer.part("modelled", *modelled_);
}

void SacLearner::loadState(StateReader& reader) {
  update_.loadState(reader);
  collector_.loadState(reader);
  const auto require = [&](const char* name, const ReplayBuffer& kept) {
    if (reader.flag("started") && kept.size() == 0) reader.refuse(name, "is empty after the start");
  };
  if (context_) {
    reader.part("context", *context_);
    require("context", context_->kept());
  }
  if (modelled_) {
    reader.part("modelled", *modelled_);
    require("modelled", *modelled_);
  }
}

}  // namespace pmeta
