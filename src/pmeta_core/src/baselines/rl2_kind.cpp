#include "pmeta_core/baselines/rl2.h"
#include "pmeta_core/baselines/rl2_actor.h"

namespace pmeta {
namespace {

class Rl2Kind : public MetaLearnerKind {
 public:
  void bind(Settings& settings) override { pmeta::bind(settings, "rl2.", settings_); }
  void check(int) const override { pmeta::check(settings_); }
  void setPortable(bool portable) override { settings_.portable = portable; }
  std::vector<int> explorationEpisodes() const override { return settings_.exploration_episodes; }
  int evaluationEpisodes() const override { return settings_.evaluation_episodes; }

  std::unique_ptr<MetaLearner> make(const MetaTasks& tasks) const override {
    return std::make_unique<Rl2>(tasks, settings_);
  }
  std::unique_ptr<PolicyFamily> policies(const Env& env, int) const override {
    return std::make_unique<Rl2Policies>(env.spec(), settings_);
  }
  std::unique_ptr<Adaptation> adaptation(const PolicyFamily& policies,
                                         const Model& policy) const override {
    return std::make_unique<Rl2Adaptation>(dynamic_cast<const Rl2Policies&>(policies).networks(),
                                           policy.floats().data());
  }

 private:
  Rl2Settings settings_;
};

const RegisteredMetaLearner<Rl2Kind> kRl2("rl2", "RL²",
                                          "a recurrent policy that remembers its trial, by PPO",
                                          "recurrent_policy");

}  // namespace
}  // namespace pmeta
