#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/baselines/inner_step.h"
#include "pmeta_core/baselines/meta_learner.h"
#include "pmeta_core/baselines/on_policy_sampler.h"

namespace pmeta {

/// Settings of a learner of parameters that one gradient step adapts to a task. Defaults are those
/// of the authors' code (Rothfuss et al., 2019) but for the batch, which is for small budgets.
struct MamlSettings {
  std::vector<int> hidden = {64, 64};  ///< tanh units of each hidden layer
  double initial_log_std = 0;          ///< of u
  double action_scale = 10;            ///< an environment is given clip(u / action_scale, -1, 1)
  int meta_batch = 0;  ///< adaptations of an iteration, a multiple of the tasks; 0: one each
  int episodes = 10;   ///< of each of them, before its inner step and again after it
  double inner_learning_rate = 0.1;                 ///< alpha of the inner step
  std::string inner_loss = "ratio";                 ///< or "log_likelihood"
  AdvantageSettings advantages;                     ///< of both batches
  std::vector<int> exploration_episodes = {2, 20};  ///< evaluated after the step on so many
  int evaluation_episodes = 5;                      ///< episodes of one evaluation, by the mean
};

/// Binds all of them below `prefix`, e.g. "promp.".
void bind(Settings& settings, const std::string& prefix, MamlSettings& maml);

/// Throws Error unless they go together, and with so many training tasks.
void check(const std::string& prefix, const MamlSettings& maml, int num_tasks);

/// The policies of such a learner.
GaussianMlpPolicies policiesOf(const EnvSpec& env, const MamlSettings& maml);

/// Model-agnostic meta-learning of a policy (Finn et al., 2017): each iteration samples episodes of
/// each task, adapts the parameters by one gradient step on them, samples episodes by the adapted
/// ones, and moves the parameters so that adapting them pays; how, the derived methods say.
class Maml : public MetaLearner {
 public:
  /// Throws Error if actions are discrete.
  Maml(const MetaTasks& tasks, const MamlSettings& settings);

  const PolicyFamily& policies() const override { return policies_; }
  const Model& model() const override { return model_; }
  void setModel(const Model& model) override { model_ = model; }
  IterationStats iterate(std::uint64_t seed, std::uint64_t iteration) override;
  const std::vector<Loss>& losses() const override { return losses_; }
  std::unique_ptr<Adaptation> adapt(const Model& policy, int task) const override;
  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

 protected:
  /// Moves `theta` by what `objective`, which is at theta, says of it. Returns the number of
  /// updates, and writes what is to be told of them into `losses` behind what is there.
  virtual std::int64_t metaStep(InnerStepObjective& objective, std::vector<double>& theta,
                                std::vector<Loss>& losses) = 0;
  /// What theta is of.
  const GaussianMlp& policy() const { return policies_.network(); }

 private:
  int taskOf(std::size_t slot) const { return static_cast<int>(slot) % num_tasks_; }

  MamlSettings settings_;
  int num_tasks_;
  int threads_;
  Surrogate inner_;
  GaussianMlpPolicies policies_;
  Model model_;
  std::vector<OnPolicySampler> samplers_;  // one for each adaptation of an iteration
  std::vector<Loss> losses_;
};

/// Adapts by the inner step on all episodes explored so far, which act by samples: the gradient
/// needs them.
class GradientAdaptation : public Adaptation {
 public:
  /// All must outlive it.
  GradientAdaptation(const GaussianMlpPolicies& policies, const MamlSettings& settings,
                     const Model& parameters);

  void beginEpisode(Rng&) override {}
  void begin(std::size_t env, Rng& rng) override { explorer_.begin(env, rng); }
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    explorer_.look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return explorer_.act(row, rng, action);
  }
  void observe(const Experience& experience) override { explorer_.observe(experience); }
  void episodeOver() override {}
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override;

 private:
  const GaussianMlpPolicies& policies_;
  const MamlSettings& settings_;
  const Model& parameters_;
  RecordingActor explorer_;
};

/// The kind of a derived method, whose settings hold MamlSettings as `maml`.
template <class Method, class MethodSettings>
class MamlKind : public MetaLearnerKind {
 public:
  /// `prefix` of its settings, e.g. "promp.".
  explicit MamlKind(const char* prefix) : prefix_(prefix) {}

  void bind(Settings& settings) override {
    using pmeta::bind;  // the method's own
    bind(settings, prefix_, settings_);
  }
  void check(int num_tasks) const override { pmeta::check(prefix_, settings_.maml, num_tasks); }
  void setPortable(bool) override {}  // its products are the same wherever it runs
  std::vector<int> explorationEpisodes() const override {
    return settings_.maml.exploration_episodes;
  }
  int evaluationEpisodes() const override { return settings_.maml.evaluation_episodes; }
  std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const override {
    return std::make_unique<Method>(tasks, settings_);
  }
  std::unique_ptr<PolicyFamily> policies(const Env& env, int) const override {
    return std::make_unique<GaussianMlpPolicies>(policiesOf(env.spec(), settings_.maml));
  }
  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                         const Model& policy) const override {
    return std::make_unique<GradientAdaptation>(dynamic_cast<const GaussianMlpPolicies&>(policies),
                                                settings_.maml, policy);
  }

 private:
  const char* prefix_;
  MethodSettings settings_;
};

}  // namespace pmeta
