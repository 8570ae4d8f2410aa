#include "pmeta_core/baselines/metacure.h"

namespace pmeta {
namespace {

class MetaCureKind : public MetaLearnerKind {
 public:
  void bind(Settings& settings) override { pmeta::bind(settings, "metacure.", settings_); }
  void check(int num_tasks) const override { pmeta::check(settings_, num_tasks); }
  void setPortable(bool portable) override { settings_.sac.portable = portable; }
  std::vector<int> explorationEpisodes() const override { return settings_.exploration_episodes; }
  int evaluationEpisodes() const override { return settings_.sac.evaluation_episodes; }

  std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const override {
    return std::make_unique<MetaCure>(tasks, settings_);
  }
  std::unique_ptr<PolicyFamily> policies(const Env& env, int) const override {
    return std::make_unique<MetaCurePolicies>(env.spec(), settings_);
  }
  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                         const Model& policy) const override {
    return std::make_unique<MetaCureAdaptation>(
        dynamic_cast<const MetaCurePolicies&>(policies).networks(), policy.floats().data());
  }
  // the prior's mean
  std::optional<std::vector<float>> metaInput(int, int) const override {
    return std::vector<float>(static_cast<std::size_t>(settings_.latent_size));
  }

 private:
  MetaCureSettings settings_;
};

const RegisteredMetaLearner<MetaCureKind> kMetaCure(
    "metacure", "MetaCURE",
    "an explorer that seeks what tells of the task, and an exploiter, off policy", "actor_critic");

}  // namespace
}  // namespace pmeta
