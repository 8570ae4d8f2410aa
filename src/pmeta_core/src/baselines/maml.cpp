#include "pmeta_core/baselines/maml.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/baselines/for_each_task.h"

namespace pmeta {
namespace {

constexpr char kLogLikelihood[] = "log_likelihood";

Surrogate surrogate(const std::string& name) {
  return name == kLogLikelihood ? Surrogate::kLogLikelihood : Surrogate::kRatio;
}

}  // namespace

void bind(Settings& settings, const std::string& prefix, MamlSettings& maml) {
  const auto key = [&](const char* name) { return prefix + name; };
  settings.bind(key("hidden"), maml.hidden, "tanh units of each hidden layer of the policy",
                Range::between(1, 1e5), Empty::kAllowed);
  settings.bind(key("initial_log_std"), maml.initial_log_std, "log sigma of u at the start",
                Range::between(-10, 10));
  settings.bind(key("action_scale"), maml.action_scale,
                "an environment is given clip(u / action_scale, -1, 1)", Range::above(0));
  settings.bind(key("meta_batch"), maml.meta_batch,
                "adaptations of an iteration, a multiple of the training tasks; 0: one a task",
                Range::between(0, 1e4));
  settings.bind(key("episodes"), maml.episodes,
                "episodes of each adaptation before its inner step, and as many after it",
                Range::between(1, 1e5));
  settings.bind(key("inner_learning_rate"), maml.inner_learning_rate, "of the inner step",
                Range::above(0));
  settings.bind(
      key("inner_loss"), maml.inner_loss,
      "of the inner step: the likelihood ratio times the advantage, or the log-likelihood "
      "(whose second derivative is not that of the expected return)",
      {"ratio", kLogLikelihood});
  settings.bind(key("gamma"), maml.advantages.gamma, "discount", Range::halfOpen(0, 1));
  settings.bind(key("gae_lambda"), maml.advantages.lambda,
                "of generalised advantage estimation; 1: return minus baseline",
                Range::between(0, 1));
  settings.bind(key("bootstrap"), maml.advantages.bootstrap,
                "at the horizon the baseline's value goes on; false: nothing is worth anything "
                "there");
  settings.bind(key("exploration_episodes"), maml.exploration_episodes,
                "the meta-policy is evaluated before, and after the inner step on so many episodes",
                Range::between(1, 1000));
  settings.bind(key("evaluation_episodes"), maml.evaluation_episodes,
                "episodes of one evaluation, by the mean", Range::between(1, 1e5));
}

void check(const std::string& prefix, const MamlSettings& maml, int num_tasks) {
  const std::vector<int>& counts = maml.exploration_episodes;
  if (std::adjacent_find(counts.begin(), counts.end(), std::greater_equal<int>()) != counts.end()) {
    throw Error(prefix + "exploration_episodes must be ascending, e.g. [2, 20].");
  }
  if (maml.meta_batch % num_tasks != 0) {
    throw Error(prefix + "meta_batch is " + std::to_string(maml.meta_batch) +
                " but must be a multiple of the " + std::to_string(num_tasks) +
                " training tasks, or 0 for one adaptation of each.");
  }
}

GaussianMlpPolicies policiesOf(const EnvSpec& env, const MamlSettings& maml) {
  return {env, maml.hidden, maml.initial_log_std, maml.action_scale};
}

Maml::Maml(const MetaTasks& tasks, const MamlSettings& settings)
    : settings_(settings),
      num_tasks_(tasks.count()),
      threads_(tasks.threads),
      inner_(surrogate(settings.inner_loss)),
      policies_(policiesOf(tasks.family->make(0)->spec(), settings)),
      model_(policies_.layout()) {
  const int slots = settings.meta_batch == 0 ? num_tasks_ : settings.meta_batch;
  for (int slot = 0; slot < slots; ++slot) {
    samplers_.emplace_back(
        makeEnvs([&](int) { return tasks.family->make(taskOf(static_cast<std::size_t>(slot))); },
                 settings.episodes));
  }
}

IterationStats Maml::iterate(std::uint64_t seed, std::uint64_t iteration) {
  IterationStats stats;
  stats.env_steps.assign(static_cast<std::size_t>(num_tasks_), 0);
  std::vector<double>& theta = model_.doubles();
  std::vector<InnerStepData> data(samplers_.size());
  std::vector<double> before(samplers_.size()), after(samplers_.size());
  const auto broken = [&] {
    std::int64_t sum = 0;
    for (const OnPolicySampler& sampler : samplers_) sum += sampler.brokenEpisodes();
    return sum;
  };
  const std::int64_t broken_before = broken();
  forEachTask(samplers_.size(), threads_, [&](std::size_t slot) {
    OnPolicySampler& sampler = samplers_[slot];
    const auto sample = [&](const std::vector<double>& parameters, std::uint64_t phase) {
      Rng rng(seed, slot, Stream::kCollect, 2 * iteration + phase);
      return sampler.sample(policy(), settings_.action_scale, parameters, settings_.advantages,
                            rng);
    };
    data[slot].before = sample(theta, 0);
    before[slot] = sampler.meanReturn();
    std::vector<double> adapted(policy().size());
    innerStep(policy(), data[slot].before, inner_, settings_.inner_learning_rate, theta.data(),
              adapted.data());
    data[slot].after = sample(adapted, 1);
    after[slot] = sampler.meanReturn();
  });
  losses_ = {{"return_after_step", 0}, {"return_before_step", 0}};
  for (std::size_t slot = 0; slot < samplers_.size(); ++slot) {
    stats.env_steps[static_cast<std::size_t>(taskOf(slot))] +=
        static_cast<std::int64_t>(data[slot].before.rows + data[slot].after.rows);
    losses_[0].value += after[slot] / static_cast<double>(samplers_.size());
    losses_[1].value += before[slot] / static_cast<double>(samplers_.size());
  }
  stats.broken_episodes = broken() - broken_before;
  InnerStepObjective objective(policy(), data, inner_, settings_.inner_learning_rate);
  objective.at(theta.data());
  stats.updates = metaStep(objective, theta, losses_);
  return stats;
}

std::unique_ptr<Adaptation> Maml::adapt(const Model& policy, int) const {
  return std::make_unique<GradientAdaptation>(policies_, settings_, policy);
}

void Maml::saveState(StateWriter& writer) const {
  for (std::size_t k = 0; k < samplers_.size(); ++k) {
    writer.part("sampler_" + std::to_string(k), samplers_[k]);
  }
}

void Maml::loadState(StateReader& reader) {
  for (std::size_t k = 0; k < samplers_.size(); ++k) {
    reader.part("sampler_" + std::to_string(k), samplers_[k]);
  }
}

GradientAdaptation::GradientAdaptation(const GaussianMlpPolicies& policies,
                                       const MamlSettings& settings, const Model& parameters)
    : policies_(policies),
      settings_(settings),
      parameters_(parameters),
      explorer_(policies.network(), policies.scale(), parameters.doubles(), 1) {}

std::unique_ptr<Actor> GradientAdaptation::adapted(std::size_t max_batch) const {
  std::vector<double> adapted = parameters_.doubles();
  if (explorer_.steps() > 0) {
    innerStep(policies_.network(), explorer_.data(settings_.advantages),
              surrogate(settings_.inner_loss), settings_.inner_learning_rate,
              parameters_.doubles().data(), adapted.data());
  }
  return std::make_unique<GaussianMlpActor>(policies_.network(), policies_.scale(),
                                            std::move(adapted), max_batch);
}

}  // namespace pmeta
