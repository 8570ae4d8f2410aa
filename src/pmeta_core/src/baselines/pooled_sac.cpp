#include "pmeta_core/baselines/pooled_sac.h"

#include <algorithm>

#include "pmeta_core/adapt/told.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/baselines/for_each_task.h"
#include "pmeta_core/baselines/plain_adam.h"

namespace pmeta {
namespace {

std::vector<float> inputOf(int task, int num_tasks, const SacSettings& settings) {
  return settings.isTold() ? oneHot(task, num_tasks) : std::vector<float>();
}

// a batch's rows tell their tasks themselves
SacSettings updateSettings(const PooledSacSettings& pooled, int num_tasks) {
  SacSettings settings = pooled.sac;
  if (pooled.gradient_surgery) settings.surgery_tasks = num_tasks;
  if (settings.batch_size < num_tasks) {
    throw Error("pooled_sac.batch_size is " + std::to_string(settings.batch_size) +
                " but must have a row for each of the " + std::to_string(num_tasks) + " tasks.");
  }
  return settings;
}

}  // namespace

PooledSacSettings::PooledSacSettings() {
  sac.hidden = {128, 128};
  sac.env_steps_per_update = 100;
}

void bind(Settings& s, const std::string& prefix, PooledSacSettings& p) {
  const Range positive = Range::between(1, 1e9);
  s.bind(prefix + "task_encoding", p.sac.task_encoding,
         "what tells the networks the task: one_hot; multi_head, by which each task has a last "
         "layer of its own, too; or none: one policy for all",
         {"one_hot", "multi_head", "none"});
  s.bind(prefix + "hidden", p.sac.hidden, "units of each hidden layer of actor and critics",
         Range::between(1, 65536));
  s.bind(prefix + "batch_size", p.sac.batch_size,
         "transitions of one update, of which each task gives an equal part",
         Range::between(1, 1e6));
  s.bind(prefix + "buffer_size", p.sac.buffer_size, "transitions that each task's replay holds",
         positive);
  s.bind(prefix + "learning_rate", p.learning_rate, "Adam's, of all networks", Range::above(0));
  s.bind(prefix + "gamma", p.sac.gamma, "discount", Range::between(0, 1));
  s.bind(prefix + "tau", p.sac.tau, "Polyak step of the target critics", Range{0, 1, true, false});
  s.bind(prefix + "reward_scale", p.sac.reward_scale, "factor on rewards in the critics' target",
         Range::above(0));
  bind(s, prefix, p.sac.temperature);
  s.bind(prefix + "warm_up_steps", p.sac.warm_up_steps,
         "uniformly random steps on each task before the first update", positive);
  s.bind(prefix + "steps_per_iteration", p.sac.env_steps_per_update,
         "steps on each task of an iteration", Range::between(1, 1e6));
  s.bind(prefix + "updates_per_iteration", p.updates_per_iteration,
         "updates after an iteration's steps", positive);
  s.bind(prefix + "gradient_surgery", p.gradient_surgery,
         "PCGrad: where two tasks' gradients conflict, each is projected onto the other's normal "
         "plane");
  s.bind(prefix + "evaluation_episodes", p.sac.evaluation_episodes, "episodes of one evaluation",
         Range::between(1, 100000));
}

PooledSac::PooledSac(const MetaTasks& tasks, const PooledSacSettings& settings)
    : updates_per_iteration_(settings.updates_per_iteration),
      threads_(tasks.threads),
      policies_(tasks.family->make(0)->spec(), settings.sac, tasks.count()),
      model_(policies_.layout()),
      optimizer_(model_.floats().data(), nullptr, model_.size(), plainAdam(settings.learning_rate)),
      update_(policies_.networks(), updateSettings(settings, tasks.count()), {}),
      losses_{{"critic", 0}, {"actor", 0}, {"entropy", 0}, {"temperature", 0}} {
  for (int i = 0; i < tasks.count(); ++i) {
    task_inputs_.push_back(inputOf(i, tasks.count(), settings.sac));
    collectors_.push_back(std::make_unique<SacCollector>(
        tasks.family->make(i), policies_.networks(), settings.sac, task_inputs_.back(), nullptr));
  }
}

void PooledSac::setModel(const Model& model) {
  std::copy(model.floats().begin(), model.floats().end(), model_.floats().begin());
  if (!started_) update_.resetTargets(model_.floats().data());
}

IterationStats PooledSac::iterate(std::uint64_t seed, std::uint64_t iteration) {
  IterationStats stats;
  stats.env_steps.assign(collectors_.size(), 0);
  const std::int64_t broken_before = brokenEpisodes();
  forEachTask(collectors_.size(), threads_, [&](std::size_t i) {
    Rng rng(seed, i, Stream::kCollect, iteration);
    stats.env_steps[i] = collectors_[i]->collect(model_.floats().data(), rng, nullptr);
  });
  started_ = true;
  stats.broken_episodes = brokenEpisodes() - broken_before;

  Rng rng(seed, 0, Stream::kSample, iteration);
  for (Loss& loss : losses_) loss.value = 0;
  for (int u = 0; u < updates_per_iteration_; ++u) {
    const SacLosses now = updateOnce(rng);
    const double all[] = {now.critic, now.actor, now.entropy, now.temperature};
    for (std::size_t i = 0; i < losses_.size(); ++i) {
      losses_[i].value += all[i] / updates_per_iteration_;
    }
  }
  stats.updates = updates_per_iteration_;
  return stats;
}

SacLosses PooledSac::updateOnce(Rng& rng) {
  for (std::size_t row = 0; row < update_.batch(); ++row) {
    const std::size_t task = row * collectors_.size() / update_.batch();
    const ReplayBuffer& replay = collectors_[task]->replay();
    const float* x = task_inputs_[task].data();
    update_.put(row, replay[rng.below(replay.size())], x, x);
  }
  optimizer_.beginUpdate();
  return update_.apply(model_.floats().data(), optimizer_, rng);
}

std::int64_t PooledSac::brokenEpisodes() const {
  std::int64_t count = 0;
  for (const auto& collector : collectors_) count += collector->brokenEpisodes();
  return count;
}

std::unique_ptr<Adaptation> PooledSac::adapt(const Model& policy, int task) const {
  const auto k = static_cast<std::size_t>(task);
  return std::make_unique<Told>(policies_, policy,
                                k < task_inputs_.size() ? task_inputs_[k] : std::vector<float>());
}

void PooledSac::saveState(StateWriter& writer) const {
  writer.flag("started", started_);
  writer.part("adam", optimizer_);
  update_.saveState(writer);
  for (std::size_t i = 0; i < collectors_.size(); ++i) {
    writer.part("task_" + std::to_string(i), *collectors_[i]);
  }
}

void PooledSac::loadState(StateReader& reader) {
  started_ = reader.flag("started");
  reader.part("adam", optimizer_);
  update_.loadState(reader);
  for (std::size_t i = 0; i < collectors_.size(); ++i) {
    const std::string name = "task_" + std::to_string(i);
    reader.part(name, *collectors_[i]);
    if (started_ && collectors_[i]->replay().size() == 0) {
      reader.refuse(name, "has no transitions after the start");
    }
  }
}

namespace {

class PooledSacKind : public MetaLearnerKind {
 public:
  void bind(Settings& settings) override { pmeta::bind(settings, "pooled_sac.", settings_); }
  void check(int) const override {}
  void setPortable(bool portable) override { settings_.sac.portable = portable; }
  std::vector<int> explorationEpisodes() const override { return {}; }
  int evaluationEpisodes() const override { return settings_.sac.evaluation_episodes; }
  bool servesTestTasks() const override { return !settings_.sac.isTold(); }
  std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const override {
    return std::make_unique<PooledSac>(tasks, settings_);
  }
  std::unique_ptr<PolicyFamily> policies(const Env& env, int num_tasks) const override {
    return std::make_unique<SacPolicies>(env.spec(), settings_.sac, num_tasks);
  }
  std::optional<std::vector<float>> metaInput(int task, int num_tasks) const override {
    if (settings_.sac.isTold() && (task < 0 || task >= num_tasks)) return std::nullopt;
    return inputOf(task, num_tasks, settings_.sac);
  }

 private:
  PooledSacSettings settings_;
};

const RegisteredMetaLearner<PooledSacKind> kPooledSac(
    "pooled_sac", "pooled SAC", "one soft actor-critic on the trajectories of all tasks",
    "actor_critic");

}  // namespace
}  // namespace pmeta
