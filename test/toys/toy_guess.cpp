// A learner in a file of its own: one number, moved by the difference of two tries.
#include <algorithm>

#include "pmeta_core/base/error.h"
#include "pmeta_core/personal/learner_kind.h"

namespace {

using namespace pmeta;

constexpr char kName[] = "toy_guess";

/// Acts by the parameter, whatever is observed.
class GuessActor : public Actor {
 public:
  explicit GuessActor(const float* guess) : guess_(guess) {}
  void look(const float*, const std::vector<std::size_t>&) override {}
  bool act(std::size_t, Rng&, double* action) override {
    action[0] = std::clamp<double>(*guess_, -1, 1);
    return true;
  }

 private:
  const float* guess_;
};

class Guesses : public PolicyFamily {
 public:
  Guesses() : PolicyFamily(ModelLayout(Precision::kFloat32, {Block{"guess", {1}}})) {}
  std::size_t taskInputSize() const override { return 0; }
  PolicyForm form() const override { return {"none", "none", "none", "none"}; }
  void initialise(Model& parameters, Rng& rng) const override {
    std::get<std::vector<float>>(parameters.values)[0] = static_cast<float>(0.1 * rng.normal());
  }
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float>,
                               std::size_t) const override {
    return std::make_unique<GuessActor>(std::get<std::vector<float>>(parameters.values).data());
  }
};

class GuessLearner : public Learner {
 public:
  GuessLearner(std::unique_ptr<Env> env, double reach) : env_(std::move(env)), reach_(reach) {}

  const PolicyFamily& policies() const override { return guesses_; }
  Model blank() const override {
    Model model;
    model.layout = guesses_.layout();
    model.values = std::vector<float>(1, 0);
    return model;
  }
  void beginRound(const Model&, bool) override {}

  UpdateStats learn(const Model& parameters, const AnyOptimizer& optimizer, Rng& rng) override {
    const double guess = std::get<std::vector<float>>(parameters.values)[0];
    const double more = attempt(guess + reach_, rng);
    const double less = attempt(guess - reach_, rng);
    const float gradient = static_cast<float>((less - more) / (2 * reach_));
    std::get<Optimizer<float>*>(optimizer)->apply(0, &gradient, 1);
    losses_[0].value = -(more + less) / 2;
    return {2, 1, 0, losses_[0].value};
  }

  const std::vector<Loss>& losses() const override { return losses_; }
  std::vector<float> taskInput(const Model&) const override { return {}; }
  std::optional<ReturnStats> exactReturn(const Model&) const override { return std::nullopt; }
  void addValues(const Model&, const std::vector<float>&, Episode&) const override {}
  void saveState(StateWriter&) const override {}
  void loadState(StateReader&) override {}

 private:
  double attempt(double guess, Rng& rng) {
    double observation = 0;
    env_->reset(rng, &observation);
    return env_->step(&guess, rng, &observation).reward;
  }

  Guesses guesses_;
  std::unique_ptr<Env> env_;
  double reach_;
  std::vector<Loss> losses_ = {{"cost", 0}};
};

class GuessKind : public LearnerKind {
 public:
  void bind(Settings& settings, PersonalSettings& personal) override {
    bindAdam(settings, personal);
    settings.bind(std::string(kName) + ".reach", reach_, "half the distance between two tries",
                  Range::above(0));
  }
  void check() const override {}
  bool hasNetworks() const override { return false; }
  void setPortable(bool) override {}
  std::optional<double> linearDiscount() const override { return std::nullopt; }
  int trainingEnvs() const override { return 0; }
  std::vector<int> explorationEpisodes() const override { return {}; }
  bool servesTestTasks() const override { return true; }

  PersonalParts make(const LearnerTask& task) const override {
    std::unique_ptr<Env> env = task.makeEnv();
    if (env->spec().observation_size != 1 || env->spec().num_actions > 0) {
      throw Error("environment '" + env->spec().name + "' is not for " + kName + ".");
    }
    PersonalParts parts;
    parts.learner = std::make_unique<GuessLearner>(std::move(env), reach_);
    parts.evaluation_envs.push_back(task.makeEnv());
    return parts;
  }
  std::unique_ptr<PolicyFamily> policies(const Env&, int) const override {
    return std::make_unique<Guesses>();
  }
  std::optional<std::vector<float>> metaInput(int, int) const override {
    return std::vector<float>();
  }

 private:
  double reach_ = 0.1;
};

const RegisteredLearner<GuessKind> kGuess(kName, "for one number", "one_number");

}  // namespace
