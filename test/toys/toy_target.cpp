// An environment in a file of its own, and its scene: find the action that the task likes.
#include "pmeta_core/env/env.h"
#include "pmeta_nodes/figure.h"
#include "pmeta_nodes/scene.h"

namespace {

constexpr char kName[] = "toy_target";

/// One action in [-1, 1], whose reward is minus its squared distance from the task's target. The
/// observation is 1, the state the count of steps.
class ToyTarget : public pmeta::Env {
 public:
  explicit ToyTarget(double target)
      : target_(target),
        spec_(pmeta::describedSpec(kName, 5, {{"one", "", 1, 1}}, {{"guess", "", -1, 1}})) {
    spec_.restorable = true;
  }

  const pmeta::EnvSpec& spec() const override { return spec_; }

  void reset(pmeta::Rng&, double* observation) override {
    steps_ = 0;
    observation[0] = 1;
  }

  pmeta::Step step(const double* action, pmeta::Rng&, double* observation) override {
    observation[0] = 1;
    const double error = action[0] - target_;
    return {-error * error, false, ++steps_ >= spec_.horizon};
  }

  std::vector<double> state() const override { return {static_cast<double>(steps_)}; }
  void setState(const std::vector<double>& state) override {
    pmeta::requireState(spec_, state, 1);
    steps_ = static_cast<int>(state[0]);
  }

 private:
  double target_;
  pmeta::EnvSpec spec_;
  int steps_ = 0;
};

class ToyTargetFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings& settings) override {
    settings.bind("environment.targets", targets_, "the action that each task likes",
                  pmeta::Range::between(-1, 1));
  }
  void build(std::uint64_t) override {}
  int numTasks() const override { return static_cast<int>(targets_.size()); }
  std::string taskName(int task) const override { return "target_" + std::to_string(task); }
  std::string taskDescription(int task) const override {
    return "target " + pmeta::formatNumber(targets_.at(task));
  }
  std::unique_ptr<pmeta::Env> create(int task) const override {
    return std::make_unique<ToyTarget>(targets_.at(task));
  }

 private:
  std::vector<double> targets_ = {-0.5, 0.5};
};

const pmeta::RegisteredFamily<ToyTargetFamily> kFamily(kName);

/// A disc for each task.
class ToyTargetScene : public pmeta_nodes::Scene {
 public:
  ToyTargetScene(const ToyTargetFamily&, int num_tasks) : num_tasks_(num_tasks) {}

  std::vector<geometry_msgs::TransformStamped> frames() const override { return {}; }
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override {
    return pmeta_nodes::formProblem(trajectory, 1);
  }
  visualization_msgs::MarkerArray still(const pmeta_nodes::SceneContent&) const override {
    visualization_msgs::MarkerArray scene;
    for (int task = 0; task < num_tasks_; ++task) {
      pmeta_nodes::Figure figure(pmeta_nodes::kWorldFrame, "toy_discs", task, 0);
      figure.disc({2.0 * task, 0}, 0.5, pmeta_nodes::rgb(0x3366cc));
      scene.markers.push_back(figure.take());
    }
    return scene;
  }

 private:
  int num_tasks_;
};

const pmeta_nodes::RegisteredScene<ToyTargetScene, ToyTargetFamily> kScene(kName);

}  // namespace
