#include "view/cart_pole_scene.h"

#include <algorithm>

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

const RegisteredScene<CartPoleScene, pmeta::CartPoleFamily> kCartPole("cart_pole");

constexpr std::size_t kObservation = 4;  // position, velocity, angle, angular velocity
constexpr double kHalfTrack = 2.6;       // m, of which kPositionLimit may be used
constexpr double kCartWidth = 0.46;
constexpr double kTrace = 0.5;    // m below the track
constexpr double kAir = 0.12;     // above an upright pole
constexpr double kBeside = 0.25;  // m, from where a pole may reach the text on the right
constexpr double kAngleLimit = 12 * kPi / 180;
constexpr std::size_t kMostTracePoints = 200;

constexpr double kTraceLayer = 0.1;
constexpr double kTrackLayer = 0.15;
constexpr double kCartLayer = 0.2;
constexpr double kPoleLayer = 0.25;

const Color kTrack = rgb(0x555b66);
const Color kLimit = rgb(0xaab0bb);
const Color kFallen = rgb(0x8b8b8b);

double longestPole(const pmeta::CartPoleFamily& family) {
  double longest = 0;
  for (int task = 0; task < family.numTasks(); ++task) {
    longest = std::max(longest, 2 * family.task(task).length);
  }
  return std::min(longest, CartPoleScene::kLongestPole);
}

bool isFallen(const double* at) { return std::abs(at[2]) > kAngleLimit; }
bool isOffTrack(const double* at) { return std::abs(at[0]) > CartPoleScene::kPositionLimit; }

void drawTrack(Figure& figure, double scale) {
  const double end = CartPoleScene::kPositionLimit * scale;
  const double line = 0.03 * scale;
  for (const double x : {-end, 0.0, end}) {
    figure.rectangle(x - line / 2, -kTrace * scale, x + line / 2, x == 0 ? 0 : 0.3 * scale, kLimit);
  }
  figure.raise();
  figure.rectangle(-kHalfTrack * scale, -line, kHalfTrack * scale, line, kTrack);
}

void drawTrace(Figure& figure, const Trajectory& episode, double scale, const Color& color) {
  const std::size_t steps = numSteps(episode);
  const double longest = std::max<double>(static_cast<double>(steps), kMostTracePoints);
  std::vector<Point> trace;
  for (const std::size_t step : thinnedSteps(steps, kMostTracePoints)) {
    const double x = std::clamp(episode.observations[step * kObservation], -kHalfTrack, kHalfTrack);
    const double share = static_cast<double>(step) / longest;
    trace.push_back({x * scale, -(0.06 + share * (kTrace - 0.08)) * scale});
  }
  figure.polyline(trace, 0.05 * scale, mix(color, kWhite, 0.45));
}

}  // namespace

CartPoleScene::CartPoleScene(const pmeta::CartPoleFamily& family, int num_tasks)
    : LaneScene(layoutCards(num_tasks, family.numTasks(), 2, 2 * kHalfTrack,
                            kTrace + kCartHeight + longestPole(family) + kAir)),
      family_(family) {}

std::vector<geometry_msgs::TransformStamped> CartPoleScene::frames() const {
  std::vector<geometry_msgs::TransformStamped> frames = cardFrames(cards_);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    for (const int policy : policiesOf(cards_, task)) {
      Point track = cards_.laneBottom(task, policy);
      track.y += kTrace * scale();
      frames.push_back(shiftedFrame(taskFrame(task), policyFrame(task, policy), track));
    }
  }
  return frames;
}

std::string CartPoleScene::problem(const Trajectory& trajectory) const {
  return formProblem(trajectory, kObservation);
}

double CartPoleScene::poleLength(int task) const {
  return std::min(2 * family_.task(task).length, kLongestPole);
}

MarkerArray CartPoleScene::still(const SceneContent& content) const {
  MarkerArray scene;
  drawTitle(content, scene);
  drawCards(cards_, family_, content, scene);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    for (const int policy : policiesOf(cards_, task)) {
      const std::string frame = policyFrame(task, policy);
      const Trajectory::ConstPtr& episode = viewOf(content, task, policy).episode;
      scene.markers.push_back(policyMarker(frame, "tracks", task, policy, kTrackLayer, true,
                                           [&](Figure& figure) { drawTrack(figure, scale()); }));
      scene.markers.push_back(policyMarker(
          frame, "traces", task, policy, kTraceLayer, episode != nullptr,
          [&](Figure& figure) { drawTrace(figure, *episode, scale(), policyColor(policy)); }));
    }
  }
  drawLegend({{[](Figure& figure, const Point& at) {
                 figure.polyline(
                     {{at.x - 0.06, at.y + 0.1}, {at.x + 0.05, at.y}, {at.x - 0.05, at.y - 0.1}},
                     0.04, kFaint);
               },
               "where the cart was, time runs down"},
              {[](Figure& figure, const Point& at) {
                 figure.rectangle(at.x - 0.02, at.y - 0.1, at.x + 0.02, at.y + 0.1, kLimit);
               },
               "limits of the track"}},
             scene);
  return scene;
}

void CartPoleScene::drawMoving(const PolicyView& view, int task, int policy, double seconds,
                               MarkerArray& scene) const {
  const std::string frame = policyFrame(task, policy);
  const bool shown = view.episode != nullptr;
  const std::size_t step = shown ? stepAt(*view.episode, seconds, kTimeStep) : 0;
  const double* at = shown ? &view.episode->observations[step * kObservation] : nullptr;
  const bool over = shown && (isFallen(at) || isOffTrack(at));
  const Color color = over ? kFallen : policyColor(policy);
  const double s = scale();

  scene.markers.push_back(
      policyMarker(frame, "carts", task, policy, kCartLayer, shown, [&](Figure& figure) {
        const double half = kCartWidth / 2 * s;
        const double wheel = 0.25 * kCartHeight * s;
        figure.rectangle(-half, wheel, half, kCartHeight * s, color);
        figure.raise();
        for (const double x : {-0.6 * half, 0.6 * half}) figure.disc({x, wheel}, wheel, kInk);
        figure.place({at[0] * s, 0}, 0);
      }));
  scene.markers.push_back(
      policyMarker(frame, "poles", task, policy, kPoleLayer, shown, [&](Figure& figure) {
        const double width = 0.07 * s;
        figure.rectangle(-width / 2, 0, width / 2, poleLength(task) * s,
                         mix(color, kInk, over ? 0 : 0.45));
        figure.disc({0, 0}, width, kInk);
        figure.place({at[0] * s, kCartHeight * s}, -at[2]);
      }));
  const std::string what = !over ? "" : isFallen(at) ? "fell at " : "left the track at ";
  const std::string text = shown ? what + "step " + std::to_string(step) : "";
  // on the side where the pole is not
  const double side = shown && at[0] > kBeside ? -1 : 1;
  scene.markers.push_back(textMarker(frame, "steps", policyId(task, policy),
                                     {side * 1.6 * s, (kCartHeight + 0.5) * s}, kTextLayer, text,
                                     0.85 * cards_.letter, 1.9 * s, kFaint));
}

}  // namespace pmeta_nodes
