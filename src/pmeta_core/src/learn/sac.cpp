#include "pmeta_core/learn/sac.h"

#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/action_values.h"

namespace pmeta {
namespace {

constexpr int kActionGrid = 21;  // fine enough for the eye, and 2 kB in an episode

const std::vector<float>& requireTaskInput(const std::vector<float>& task_input,
                                           const SacSettings& settings) {
  if ((settings.task_encoding == "one_hot") == task_input.empty()) {
    throw Error("soft actor-critic takes a task input of " + std::to_string(task_input.size()) +
                " numbers with task_encoding '" + settings.task_encoding +
                "': give the one-hot vector with one_hot, and nothing otherwise.");
  }
  return task_input;
}

std::optional<ContextStore> makeContext(const SacNetworks& networks,
                                        const ContextSettings& settings) {
  if (!networks.hasEncoder()) return std::nullopt;
  return ContextStore(networks.encoder(), settings, static_cast<int>(networks.observationSize()),
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
      policies_(env->spec(), settings, static_cast<int>(task_input.size())),
      context_(makeContext(networks(), settings.context)),
      collector_(std::move(env), networks(), settings,
                 actingInput(networks(), requireTaskInput(task_input, settings)),
                 context_ ? &*context_ : nullptr),
      update_(networks(), settings, task_input) {
  report({});
}

// allocates nothing after the first call
void SacLearner::report(const SacLosses& losses) {
  losses_.assign({{"critic", losses.critic},
                  {"actor", losses.actor},
                  {"entropy", losses.entropy},
                  {"temperature", losses.temperature}});
  if (context_) losses_.push_back({"kl", losses.kl});
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
  if (settings_.task_encoding != "one_hot" || !settings_.own_column) return model;
  model.present.assign(model.size(), 1);
  const auto removeColumns = [&](std::size_t offset, const Mlp& mlp) {
    // the first block is the first layer's weight, [outputs, inputs]
    for (std::size_t o = 0; o < mlp.blocks().front().shape[0]; ++o) {
      const std::size_t row = offset + o * mlp.inputs() + networks().observationSize();
      for (std::size_t i = 0; i < networks().taskInputSize(); ++i) {
        model.present[row + i] = taskInput()[i] != 0;
      }
    }
  };
  removeColumns(0, networks().actor());
  for (int k = 0; k < 2; ++k) removeColumns(networks().criticOffset(k), networks().critic(k));
  return model;
}

void SacLearner::beginRound(const Model& meta, bool first) {
  const std::vector<float>& values = meta.floats();
  if (first || settings_.targets_at_round == "meta") resetTargets(values.data());
  if (context_ && settings_.context.explorer == "meta") {
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
  const SacLosses losses = update(values, *std::get<Optimizer<float>*>(optimizer), rng);
  report(losses);
  stats.loss = losses.critic;
  stats.updates = 1;
  return stats;
}

std::vector<float> SacLearner::taskInput(const Model& policy) const {
  if (!context_) return taskInput();
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
}

void SacLearner::loadState(StateReader& reader) {
  update_.loadState(reader);
  collector_.loadState(reader);
  if (!context_) return;
  reader.part("context", *context_);
  if (reader.flag("started") && context_->kept().size() == 0) {
    reader.refuse("context", "is empty after the start");
  }
}

}  // namespace pmeta
