#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/learn/tabular_learner.h"
#include "pmeta_core/personal/learner_kind.h"

namespace pmeta {
namespace {

constexpr char kName[] = "q_learning";

class QLearningKind : public LearnerKind {
 public:
  void bind(Settings& settings, PersonalSettings&) override {
    pmeta::bind(settings, std::string(kName) + ".", settings_);
  }
  void check() const override {}
  bool hasNetworks() const override { return false; }
  void setPortable(bool) override {}
  std::optional<double> linearDiscount() const override { return settings_.gamma; }
  int trainingEnvs() const override { return 0; }
  std::vector<int> explorationEpisodes() const override { return {}; }
  bool servesTestTasks() const override { return true; }

  PersonalParts make(const LearnerTask& task) const override {
    std::unique_ptr<Env> env = task.makeEnv();
    requireTabular(*env);
    std::unique_ptr<TabularEnv> tabular(dynamic_cast<TabularEnv*>(env.release()));
    PersonalParts parts;
    parts.learner = std::make_unique<TabularLearner>(std::move(tabular), settings_);
    parts.evaluation_envs.push_back(task.makeEnv());
    return parts;
  }

  std::unique_ptr<PolicyFamily> policies(const Env& env, int) const override {
    return std::make_unique<TablePolicies>(requireTabular(env), settings_.initial_value);
  }

  std::optional<std::vector<float>> metaInput(int, int) const override {
    return std::vector<float>();
  }

 private:
  static const TabularEnv& requireTabular(const Env& env) {
    const auto* tabular = dynamic_cast<const TabularEnv*>(&env);
    if (tabular != nullptr) return *tabular;
    throw Error("environment '" + env.spec().name + "' is not tabular, so " + kName +
                " cannot learn it: choose another learner.");
  }

  QLearningSettings settings_;
};

const RegisteredLearner<QLearningKind> kQLearning(kName, "for tables", "table");

}  // namespace
}  // namespace pmeta
