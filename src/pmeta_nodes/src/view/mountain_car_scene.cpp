#include "view/mountain_car_scene.h"

#include <algorithm>

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

const RegisteredScene<MountainCarScene, pmeta::MountainCarFamily> kMountainCar("mountain_car");

constexpr std::size_t kObservation = 2;  // position, velocity
constexpr double kLeft = -1.2;
constexpr double kRight = 0.6;
constexpr double kGoal = 0.5;
constexpr double kHighestSpeed = 0.07;

// the content of a lane, in units of position: hill, gap, phase plot; ground to flag
constexpr double kTrackWidth = kRight - kLeft;
constexpr double kBetween = 0.14;
constexpr double kPhaseShare = 0.8;  // of positions, beside the hill's
constexpr double kWidth = kTrackWidth * (1 + kPhaseShare) + kBetween;
constexpr double kSteps = 0.14;  // the band below the hill, for text
constexpr double kHeight = 1.36;
constexpr double kPhaseHeight = 1.16;
constexpr int kHillPoints = 120;
constexpr std::size_t kMostPathPoints = 250;

constexpr double kGroundLayer = 0.05;
constexpr double kPathLayer = 0.1;
constexpr double kCarLayer = 0.2;
constexpr double kDotLayer = 0.25;

const Color kHill = rgb(0xc9d4c5);
const Color kCrest = rgb(0x5d6b57);
const Color kAxis = rgb(0xb4bac4);
const Color kFlag = rgb(0x1d9a6c);

std::string hillFrame(int task) { return taskFrame(task) + "/hill"; }
std::string phaseFrame(int task) { return taskFrame(task) + "/phase"; }

void drawFlag(Figure& figure, const Point& foot, double scale) {
  const double top = foot.y + 0.26 * scale;
  figure.rectangle(foot.x - 0.008 * scale, foot.y, foot.x + 0.008 * scale, top, kInk);
  figure.polygon(
      {foot.x + 0.04 * scale, top - 0.05 * scale},
      {{foot.x, top}, {foot.x, top - 0.1 * scale}, {foot.x + 0.13 * scale, top - 0.05 * scale}},
      kFlag);
}

void drawHill(Figure& figure, double zeta, double scale) {
  Point before;
  std::vector<Point> crest;
  for (int i = 0; i <= kHillPoints; ++i) {
    const double x = kLeft + kTrackWidth * i / kHillPoints;
    const Point at{x * scale, MountainCarScene::height(zeta, x) * scale};
    if (i > 0) {
      figure.polygon({before.x, 0}, {{at.x, 0}, at, before}, kHill);
    }
    crest.push_back(at);
    before = at;
  }
  figure.raise();
  figure.polyline(crest, 0.02 * scale, kCrest);
  figure.raise();
  drawFlag(figure, {kGoal * scale, MountainCarScene::height(zeta, kGoal) * scale}, scale);
}

/// The frame of the phase plot, with lines at speed 0 and at the goal.
void drawPlane(Figure& figure, double scale, double velocity_scale) {
  const double left = kLeft * kPhaseShare * scale;
  const double right = kRight * kPhaseShare * scale;
  const double top = kHighestSpeed * velocity_scale;
  const double line = 0.012 * scale;
  figure.rectangle(left - line, -top - line, right + line, top + line, kAxis);
  figure.raise();
  figure.rectangle(left, -top, right, top, kWhite);
  figure.raise();
  figure.rectangle(left, -line / 2, right, line / 2, kAxis);
  const double goal = kGoal * kPhaseShare * scale;
  figure.rectangle(goal - line / 2, -top, goal + line / 2, top, kFlag);
}

}  // namespace

double MountainCarScene::height(double zeta, double position) {
  return 0.45 * std::sin(zeta * position) + 0.55;
}

MountainCarScene::MountainCarScene(const pmeta::MountainCarFamily& family, int num_tasks)
    : LaneScene(layoutCards(num_tasks, family.numTasks(), 1, kWidth, kSteps + kHeight)),
      family_(family) {}

double MountainCarScene::velocityScale() const {
  return kPhaseHeight / 2 / kHighestSpeed * scale();
}

std::vector<geometry_msgs::TransformStamped> MountainCarScene::frames() const {
  std::vector<geometry_msgs::TransformStamped> frames = cardFrames(cards_);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    const Point bottom = cards_.laneBottom(task, Trajectory::PERSONAL);
    const double left = bottom.x - kWidth / 2 * scale();
    frames.push_back(shiftedFrame(taskFrame(task), hillFrame(task),
                                  {left - kLeft * scale(), bottom.y + kSteps * scale()}));
    frames.push_back(shiftedFrame(taskFrame(task), phaseFrame(task),
                                  {left + (kTrackWidth + kBetween - kLeft * kPhaseShare) * scale(),
                                   bottom.y + (kSteps + 0.04 + kPhaseHeight / 2) * scale()}));
  }
  return frames;
}

std::string MountainCarScene::problem(const Trajectory& trajectory) const {
  return formProblem(trajectory, kObservation);
}

/// What is outside the plot is drawn on its edge.
Point MountainCarScene::phasePoint(const Trajectory& episode, std::size_t step) const {
  const double* at = &episode.observations[step * kObservation];
  const double velocity = at[1] / family_.velocityScale();
  return {std::clamp(at[0], kLeft, kRight) * kPhaseShare * scale(),
          std::clamp(velocity, -kHighestSpeed, kHighestSpeed) * velocityScale()};
}

MarkerArray MountainCarScene::still(const SceneContent& content) const {
  MarkerArray scene;
  drawTitle(content, scene);
  drawCards(cards_, family_, content, scene);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    Figure hill(hillFrame(task), "hills", task, kGroundLayer);
    drawHill(hill, family_.task(task).zeta, scale());
    scene.markers.push_back(hill.take());
    Figure plane(phaseFrame(task), "planes", task, kGroundLayer);
    drawPlane(plane, scale(), velocityScale());
    scene.markers.push_back(plane.take());
    const double axis = -kPhaseHeight / 2 * scale();
    const Point below{(kLeft + kRight) / 2 * kPhaseShare * scale(), axis - 0.09 * scale()};
    scene.markers.push_back(textMarker(phaseFrame(task), "axes", task, below, kTextLayer,
                                       "velocity over position", 0.8 * cards_.letter,
                                       kTrackWidth * kPhaseShare * scale(), kFaint));
    for (const int policy : policiesOf(cards_, task)) {
      scene.markers.push_back(drawPath(viewOf(content, task, policy), task, policy));
    }
  }
  drawLegend({{[](Figure& figure, const Point& at) {
                 drawFlag(figure, {at.x - 0.05, at.y - 0.12}, 0.9);
               },
               "goal"},
              {[](Figure& figure, const Point& at) {
                 figure.segment({at.x, at.y - 0.1}, {at.x, at.y + 0.1}, 0.03, kFlag);
               },
               "goal's position"}},
             scene);
  return scene;
}

visualization_msgs::Marker MountainCarScene::drawPath(const PolicyView& view, int task,
                                                      int policy) const {
  return pathMarker(phaseFrame(task), task, policy, kPathLayer, view, kMostPathPoints,
                    0.034 * scale(), 0.016 * scale(),
                    [&](std::size_t step) { return phasePoint(*view.episode, step); });
}

void MountainCarScene::drawMoving(const PolicyView& view, int task, int policy, double seconds,
                                  MarkerArray& scene) const {
  const bool shown = view.episode != nullptr;
  const bool is_meta = policy == Trajectory::META;
  const std::size_t step = shown ? stepAt(*view.episode, seconds, kTimeStep) : 0;
  const Color color = policyColor(policy);
  const double zeta = family_.task(task).zeta;
  const double s = scale();

  // meta's car is larger and stands behind, so that both are seen where they meet
  scene.markers.push_back(policyMarker(
      hillFrame(task), "cars", task, policy, kCarLayer - (is_meta ? 0.05 : 0), shown,
      [&](Figure& figure) {
        const double x = view.episode->observations[step * kObservation];
        const double half = (is_meta ? 0.105 : 0.065) * s;
        const double roof = (is_meta ? 0.125 : 0.08) * s;
        const double wheel = 0.022 * s;
        figure.rectangle(-half, wheel, half, roof, color);
        figure.raise();
        for (const double at : {-0.6 * half, 0.6 * half}) figure.disc({at, wheel}, wheel, kInk);
        figure.place({x * s, height(zeta, x) * s}, std::atan(0.45 * zeta * std::cos(zeta * x)));
      }));
  scene.markers.push_back(policyMarker(phaseFrame(task), "dots", task, policy,
                                       kDotLayer - (is_meta ? 0.02 : 0), shown,
                                       [&](Figure& figure) {
                                         const double radius = (is_meta ? 0.055 : 0.038) * s;
                                         figure.disc({0, 0}, radius, kWhite);
                                         figure.raise();
                                         figure.disc({0, 0}, 0.8 * radius, color);
                                         figure.place(phasePoint(*view.episode, step), 0);
                                       }));
  std::string text;
  if (shown) {
    const bool ended = step == numSteps(*view.episode);
    const bool at_goal = ended && view.episode->terminated;
    text = at_goal ? "goal at step " : ended ? "goal not reached by step " : "step ";
    text += std::to_string(step);
  }
  const double x = (kLeft + (is_meta ? 0.75 : 0.25) * kTrackWidth) * s;
  scene.markers.push_back(textMarker(hillFrame(task), "steps", policyId(task, policy),
                                     {x, -0.07 * s}, kTextLayer, text, 0.85 * cards_.letter,
                                     0.45 * kTrackWidth * s, color));
}

}  // namespace pmeta_nodes
