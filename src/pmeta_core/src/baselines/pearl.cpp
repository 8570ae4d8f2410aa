#include "pmeta_core/baselines/pearl.h"

#include <algorithm>
#include <string>

#include "pmeta_core/adapt/latent_adaptation.h"
#include "pmeta_core/baselines/for_each_task.h"
#include "pmeta_core/baselines/plain_adam.h"
#include "pmeta_core/baselines/replay_size.h"

namespace pmeta {
Pearl::Pearl(const MetaTasks& tasks, const PearlSettings& settings)
    : settings_(settings),
      update_settings_(updateSettings(settings, tasks.family->make(0)->spec().horizon)),
      threads_(tasks.threads),
      policies_(tasks.family->make(0)->spec(), update_settings_, 1),
      model_(policies_.layout()),
      optimizer_(model_.floats().data(), nullptr, model_.size(), plainAdam(settings.learning_rate)),
      update_(networks(), update_settings_, {}),
      losses_{{"critic", 0}, {"actor", 0}, {"entropy", 0}, {"temperature", 0}, {"kl", 0}} {
  if (networks().hasValue()) losses_.push_back({"value", 0});
  const std::size_t buffer_size = replaySize(tasks, settings.buffer_size, "pearl.");
  for (int i = 0; i < tasks.count(); ++i) {
    tasks_.push_back(std::make_unique<PearlCollector>(tasks.family->make(i), networks(),
                                                      update_settings_, buffer_size));
  }
}

void Pearl::setModel(const Model& model) {
  std::copy(model.floats().begin(), model.floats().end(), model_.floats().begin());
  if (!started_) update_.resetTargets(model_.floats().data());
}

IterationStats Pearl::iterate(std::uint64_t seed, std::uint64_t iteration) {
  IterationStats stats;
  const std::int64_t broken_before = brokenEpisodes();
  Rng rng(seed, 0, Stream::kSample, iteration);
  collect(seed, iteration, rng, stats);
  started_ = true;
  stats.broken_episodes = brokenEpisodes() - broken_before;

  for (Loss& loss : losses_) loss.value = 0;
  const double share = 1.0 / settings_.updates_per_iteration;
  for (int u = 0; u < settings_.updates_per_iteration; ++u) {
    const SacLosses now = update(rng);
    const double all[] = {now.critic, now.actor, now.entropy, now.temperature, now.kl, now.value};
    for (std::size_t i = 0; i < losses_.size(); ++i) losses_[i].value += share * all[i];
  }
  stats.updates = settings_.updates_per_iteration;
  return stats;
}

// tasks know nothing of each other here, so that those that are visited may act side by side
void Pearl::collect(std::uint64_t seed, std::uint64_t iteration, Rng& rng, IterationStats& stats) {
  std::vector<int> visits(tasks_.size());
  for (int n = 0; n < settings_.tasks_per_iteration; ++n) ++visits[rng.below(tasks_.size())];
  stats.env_steps.assign(tasks_.size(), 0);
  const float* parameters = model_.floats().data();
  forEachTask(tasks_.size(), threads_, [&](std::size_t i) {
    Rng acting(seed, i, Stream::kCollect, iteration);
    PearlCollector& task = *tasks_[i];
    std::int64_t& steps = stats.env_steps[i];
    if (!started_) steps += task.explore(parameters, settings_.warm_up_steps, acting);
    for (int n = 0; n < visits[i]; ++n) {
      steps += task.visit(parameters, settings_.prior_steps, settings_.posterior_steps, acting);
    }
  });
}

SacLosses Pearl::update(Rng& rng) {
  const float* parameters = model_.floats().data();
  std::size_t row = 0;
  for (InferredTask& inferred : update_.tasks()) {
    const PearlCollector& task = *tasks_[rng.below(tasks_.size())];
    task.context().draw(parameters + networks().encoderOffset(), rng, inferred);
    for (int b = 0; b < settings_.task_batch; ++b) {
      update_.put(row++, task.replay()[rng.below(task.replay().size())]);
    }
  }
  optimizer_.beginUpdate();
  return update_.apply(parameters, optimizer_, rng);
}

std::int64_t Pearl::brokenEpisodes() const {
  std::int64_t count = 0;
  for (const auto& task : tasks_) count += task->brokenEpisodes();
  return count;
}

std::unique_ptr<Adaptation> Pearl::adapt(const Model& policy, int) const {
  return std::make_unique<LatentAdaptation>(networks(), settings_.sac.context,
                                            policy.floats().data());
}

void Pearl::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.part("adam", optimizer_);
  update_.saveState(writer);
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    writer.part("task_" + std::to_string(i), *tasks_[i]);
  }
}

void Pearl::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  reader.part("adam", optimizer_);
  update_.loadState(reader);
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    const std::string name = "task_" + std::to_string(i);
    reader.part(name, *tasks_[i]);
    if (started_ && (tasks_[i]->replay().size() == 0 || tasks_[i]->context().kept().size() == 0)) {
      reader.refuse(name, "has no transitions after the start");
    }
  }
}

std::unique_ptr<MetaLearner> PearlKind::make(const MetaTasks& tasks) const {
  return std::make_unique<Pearl>(tasks, settings_);
}

std::unique_ptr<PolicyFamily> PearlKind::policies(const Env& env, int) const {
  return std::make_unique<SacPolicies>(env.spec(), settings_.sac, 1);
}

std::unique_ptr<Adaptation> PearlKind::adaptation(const PolicyFamily& policies,
                                                  const Model& policy) const {
  return std::make_unique<LatentAdaptation>(dynamic_cast<const SacPolicies&>(policies).networks(),
                                            settings_.sac.context, policy.floats().data());
}

std::optional<std::vector<float>> PearlKind::metaInput(int, int) const {
  return std::vector<float>(static_cast<std::size_t>(settings_.sac.context.latent_size));
}

namespace {

const RegisteredMetaLearner<PearlKind> kPearl(
    "pearl", "PEARL", "infers each task from its context, off policy, on all trajectories",
    "actor_critic");

}  // namespace
}  // namespace pmeta
