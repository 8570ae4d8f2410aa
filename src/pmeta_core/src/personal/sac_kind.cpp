#include <utility>

#include "pmeta_core/adapt/latent_adaptation.h"
#include "pmeta_core/adapt/model_adaptation.h"
#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/learner_kind.h"

namespace pmeta {
namespace {

class SacKind : public LearnerKind {
 public:
  void bind(Settings& settings, PersonalSettings& personal) override {
    bindAdam(settings, personal);
    NetworkLambdas& own = personal.lambdas;
    settings.bind("personal.lambda_actor", own.actor,
                  "the actor's own strength; -1: lambda; 0: the actor is neither reset nor shared",
                  Range::atLeast(0));
    settings.bind("personal.lambda_critic", own.critic, "the same for both critics",
                  Range::atLeast(0));
    settings.bind("personal.lambda_encoder", own.encoder,
                  "the same for the inference network, or the task model", Range::atLeast(0));
    pmeta::bind(settings, "sac.", settings_);
  }

  void check() const override { pmeta::check(settings_.context, "sac."); }

  bool hasNetworks() const override { return true; }
  void setPortable(bool portable) override {
    settings_.portable = settings_.context.portable = portable;
  }
  std::optional<double> linearDiscount() const override { return std::nullopt; }
  int trainingEnvs() const override { return 0; }
  std::vector<int> explorationEpisodes() const override {
    return explores() ? settings_.context.exploration_episodes : std::vector<int>();
  }
  // a one-hot input has no place for a task that was not trained on
  bool servesTestTasks() const override { return explores() || !settings_.isTold(); }

  PersonalParts make(const LearnerTask& task) const override {
    SacSettings settings = settings_;
    // nothing is learnt on a test task: no replay
    if (!task.trains) settings.buffer_size = settings.task_model.buffer_size = settings.batch_size;
    // where nothing comes back the first meta-policy would explore for ever
    if (!task.shares) settings.context.explorer = "personal";
    auto learner = std::make_unique<SacLearner>(task.makeEnv(), settings, taskInput(task));
    PersonalParts parts;
    if (explores()) {
      parts.exploration_episodes = explorationEpisodes();
      parts.adapt = [&networks = learner->networks(), settings](const Model& policy) {
        return makeAdaptation(networks, settings, policy);
      };
    }
    parts.learner = std::move(learner);
    task.evaluateOver(settings.evaluation_episodes, parts);
    parts.reset_moments = settings.reset_moments;
    return parts;
  }

  std::unique_ptr<PolicyFamily> policies(const Env& env, int num_tasks) const override {
    return std::make_unique<SacPolicies>(env.spec(), settings_, num_tasks);
  }

  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                         const Model& policy) const override {
    if (!explores()) return nullptr;
    return makeAdaptation(dynamic_cast<const SacPolicies&>(policies).networks(), settings_, policy);
  }

  // of z the prior's mean
  std::optional<std::vector<float>> metaInput(int task, int num_tasks) const override {
    if (settings_.infers()) return std::vector<float>(settings_.context.latent_size);
    if (!settings_.isTold()) return std::vector<float>();
    if (task >= 0 && task < num_tasks) return oneHot(task, num_tasks);
    return settings_.models() ? std::optional(anyTask(num_tasks)) : std::nullopt;
  }

 private:
  // gets to know the task by exploring it
  bool explores() const { return settings_.infers() || settings_.models(); }

  static std::unique_ptr<Adaptation> makeAdaptation(const SacNetworks& networks,
                                                    const SacSettings& settings,
                                                    const Model& policy) {
    const float* parameters = policy.floats().data();
    if (settings.models()) return std::make_unique<ModelAdaptation>(networks, settings, parameters);
    return std::make_unique<LatentAdaptation>(networks, settings.context, parameters);
  }

  // the mean of all that are trained on
  static std::vector<float> anyTask(int num_tasks) {
    return std::vector<float>(static_cast<std::size_t>(num_tasks),
                              1 / static_cast<float>(num_tasks));
  }

  std::vector<float> taskInput(const LearnerTask& task) const {
    if (!settings_.isTold()) return {};
    const int num_tasks = task.family->numTasks();
    return task.trains ? oneHot(task.task, num_tasks) : anyTask(num_tasks);
  }

  SacSettings settings_;
};

const RegisteredLearner<SacKind> kSac("sac", "for networks with continuous actions",
                                      "actor_critic");

}  // namespace
}  // namespace pmeta
