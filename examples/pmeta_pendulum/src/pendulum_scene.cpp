// What rviz shows: a card for each task, on which the pendulum of each policy swings.
#include "pendulum.h"
#include "pmeta_nodes/card.h"

namespace pmeta_pendulum {
namespace {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

constexpr std::size_t kObservation = 3;  // cosine, sine, speed
constexpr double kLayer = 0.2;
constexpr double kWidth = 0.08;  // of a rod, m
constexpr double kRoom = 2.3;    // height and width of a lane, in lengths of the longest rod

class PendulumScene : public pmeta_nodes::LaneScene {
 public:
  PendulumScene(const PendulumFamily& family, int num_tasks)
      : LaneScene(pmeta_nodes::layoutCards(num_tasks, family.numTasks(), 2,
                                           kRoom * family.longest(), kRoom * family.longest())),
        family_(family) {}

  std::vector<geometry_msgs::TransformStamped> frames() const override {
    std::vector<geometry_msgs::TransformStamped> frames = cardFrames(cards_);
    for (int task = 0; task < cards_.num_tasks; ++task) {
      for (const int policy : policiesOf(cards_, task)) {
        pmeta_nodes::Point pivot = cards_.laneBottom(task, policy);
        pivot.y += kRoom / 2 * family_.longest() * scale();
        frames.push_back(pmeta_nodes::shiftedFrame(pmeta_nodes::taskFrame(task),
                                                   pmeta_nodes::policyFrame(task, policy), pivot));
      }
    }
    return frames;
  }

  std::string problem(const Trajectory& trajectory) const override {
    return pmeta_nodes::formProblem(trajectory, kObservation);
  }

  double stepSeconds() const override { return kTimeStep; }

  MarkerArray still(const pmeta_nodes::SceneContent& content) const override {
    MarkerArray scene;
    drawTitle(content, scene);
    drawCards(cards_, family_, content, scene);
    pmeta_nodes::drawLegend({}, scene);
    return scene;
  }

 private:
  void drawMoving(const pmeta_nodes::PolicyView& view, int task, int policy, double seconds,
                  MarkerArray& scene) const override {
    const auto draw = [&](pmeta_nodes::Figure& figure) {
      const std::size_t step = pmeta_nodes::stepAt(*view.episode, seconds, kTimeStep);
      const double* at = &view.episode->observations[step * kObservation];
      const double length = family_.length(task) * scale();
      const double width = kWidth * scale();
      // an angle of 0 is up, and grows to the left
      figure.segment({0, 0}, {-at[1] * length, at[0] * length}, width,
                     pmeta_nodes::policyColor(policy));
      figure.disc({0, 0}, width, pmeta_nodes::kInk);
    };
    scene.markers.push_back(pmeta_nodes::policyMarker(pmeta_nodes::policyFrame(task, policy),
                                                      "pendulums", task, policy, kLayer,
                                                      view.episode != nullptr, draw));
  }

  const PendulumFamily& family_;
};

const pmeta_nodes::RegisteredScene<PendulumScene, PendulumFamily> kScene(kName);

}  // namespace
}  // namespace pmeta_pendulum
