#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/dqn.h"
#include "pmeta_core/personal/learner_kind.h"

namespace pmeta {
namespace {

class DqnKind : public LearnerKind {
 public:
  void bind(Settings& settings, PersonalSettings& personal) override {
    bindAdam(settings, personal);
    pmeta::bind(settings, "dqn.", settings_);
  }

  void check() const override { requireSamples(settings_); }
  bool hasNetworks() const override { return true; }
  void setPortable(bool portable) override { settings_.portable = portable; }
  std::optional<double> linearDiscount() const override { return std::nullopt; }
  int trainingEnvs() const override { return settings_.num_envs; }
  std::vector<int> explorationEpisodes() const override { return {}; }
  bool servesTestTasks() const override { return true; }

  PersonalParts make(const LearnerTask& task) const override {
    const EnvFamily& family = *task.family;
    const auto training_env = [&](int k) {
      return task.pools ? family.make(k % family.numTasks()) : task.makeEnv();
    };
    PersonalParts parts;
    parts.learner = std::make_unique<DqnLearner>(makeEnvs(training_env, settings_.num_envs),
                                                 settings_, task.total_updates);
    task.evaluateOver(settings_.evaluation_episodes, parts);
    return parts;
  }

  std::unique_ptr<PolicyFamily> policies(const Env& env, int) const override {
    return std::make_unique<QPolicies>(dqnNetwork(env.spec(), settings_));
  }

  std::optional<std::vector<float>> metaInput(int, int) const override {
    return std::vector<float>();
  }

 private:
  DqnSettings settings_;
};

const RegisteredLearner<DqnKind> kDqn("dqn", "for networks", "q_network");

}  // namespace
}  // namespace pmeta
