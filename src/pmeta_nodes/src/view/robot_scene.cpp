#include "view/robot_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "pmeta_core/base/error.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

namespace {

// m, for a robot of the size of those that are shipped
constexpr double kUsualWidth = 2.6;  // of the view
constexpr double kUsualWidthFromAbove = 3.4;
constexpr double kFloorDepth = 0.3;   // of the lane below the floor of planar robots: its scale
constexpr double kAir = 0.35;         // above the highest point at rest
constexpr double kLegRoom = 0.55;     // above the floor that is seen from above
constexpr double kFewestLines = 1.3;  // across the view
constexpr std::size_t kMostPathPoints = 200;
constexpr double kFarthest = 1e10;  // m or rad: as far as MujocoSimulation lets a state go

constexpr double kFloorLayer = 0.1;
constexpr double kTargetLayer = 0.2;
constexpr double kRobotLayer = 2;  // what leans backward still stands before its card
constexpr double kRobotTextLayer = 4;

const Color kFloor = rgb(0xdde1e7);
const Color kTick = rgb(0xa9b0bc);
const Color kFloorLine = rgb(0x555b66);
const Color kTarget = rgb(0xe08a00);

// the multiples of `spacing` within `half` of `center`, which is no further away than kFarthest
std::vector<double> linesAround(double center, double half, double spacing) {
  std::vector<double> lines;
  const auto first = static_cast<std::int64_t>(std::ceil((center - half) / spacing));
  const auto last = static_cast<std::int64_t>(std::floor((center + half) / spacing));
  for (std::int64_t line = first; line <= last; ++line) {
    lines.push_back(static_cast<double>(line) * spacing);
  }
  return lines;
}

std::string robotFrame(int task, int policy) { return policyFrame(task, policy) + "/robot"; }

}  // namespace

RobotScene::RobotScene(const pmeta::EnvFamily& family, int num_tasks,
                       std::vector<RobotTarget> targets)
    : family_(family), targets_(std::move(targets)) {
  const auto env = family.make(0);
  if (env->model() == nullptr) throw pmeta::Error("a scene of robots needs a model of MuJoCo.");
  view_ = pmeta::viewOf(*env->model());
  readModels(num_tasks);
  step_seconds_ = env->spec().step_seconds;
  rest_height_ = topOf(*kinematics_.front());
  size_ = view_.width / (isPlanar() ? kUsualWidth : kUsualWidthFromAbove);
  spacing_ = std::pow(10, std::floor(std::log10(view_.width / kFewestLines)));
  const double height = isPlanar() ? (kFloorDepth + kAir) * size_ + rest_height_
                                   : view_.depth * std::sin(view_.elevation) + kLegRoom * size_;
  cards_ = layoutCards(num_tasks, family.numTasks(), 2, view_.width, height);
}

// links of tasks may differ in length
void RobotScene::readModels(int num_tasks) {
  std::vector<std::unique_ptr<pmeta::Env>> envs;  // all alive: an address stands for one model
  std::map<const pmeta::MujocoModel*, std::shared_ptr<pmeta::MujocoKinematics>> known;
  for (int task = 0; task < num_tasks; ++task) {
    envs.push_back(family_.make(task));
    const pmeta::MujocoModel* model = envs.back()->model();
    auto& kinematics = known[model];
    if (!kinematics) kinematics = std::make_shared<pmeta::MujocoKinematics>(*model);
    kinematics_.push_back(kinematics);
  }
}

std::vector<geometry_msgs::TransformStamped> RobotScene::frames() const {
  std::vector<geometry_msgs::TransformStamped> frames = cardFrames(cards_);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    for (const int policy : policiesOf(cards_, task)) {
      Point floor = cards_.laneBottom(task, policy);
      floor.y +=
          isPlanar() ? kFloorDepth * unit() : scale() * view_.depth / 2 * std::sin(view_.elevation);
      frames.push_back(shiftedFrame(taskFrame(task), policyFrame(task, policy), floor));
      // seen from -y, and from above by the elevation
      const double angle = view_.elevation - kPi / 2;
      auto robot = shiftedFrame(policyFrame(task, policy), robotFrame(task, policy), {});
      robot.transform.translation.z = kRobotLayer;
      robot.transform.rotation.x = std::sin(angle / 2);
      robot.transform.rotation.w = std::cos(angle / 2);
      frames.push_back(robot);
    }
  }
  return frames;
}

std::string RobotScene::problem(const Trajectory& trajectory) const {
  const std::size_t numbers =
      (numSteps(trajectory) + 1) * static_cast<std::size_t>(kinematics_.front()->nq());
  if (trajectory.position_size != static_cast<std::uint32_t>(kinematics_.front()->nq()) ||
      trajectory.positions.size() != numbers) {
    return "it has " + std::to_string(trajectory.positions.size()) + " positions of size " +
           std::to_string(trajectory.position_size) + " for " +
           std::to_string(numSteps(trajectory)) + " steps; the model's are of size " +
           std::to_string(kinematics_.front()->nq()) + ".";
  }
  const std::string problem = formProblem(trajectory, trajectory.observation_size);
  if (!problem.empty()) return problem;
  for (const double value : trajectory.positions) {
    if (std::abs(value) > kFarthest) {
      return "it holds a position beyond " + number(kFarthest) + ", which no simulation reaches.";
    }
  }
  return "";
}

double RobotScene::halfWidth() const { return cards_.lane_width / 2 / scale(); }

const std::vector<Position>& RobotScene::pathOf(int task, int policy,
                                                const Trajectory::ConstPtr& episode) {
  Path& path = paths_[{task, policy}];
  if (path.episode == episode) return path.torso;
  path.episode = episode;
  path.torso.clear();
  pmeta::MujocoKinematics& kinematics = *kinematics_.at(task);
  for (std::size_t step = 0; episode && step <= numSteps(*episode); ++step) {
    kinematics.pose(&episode->positions[step * episode->position_size]);
    const double* at = kinematics.bodyPosition(view_.body);
    path.torso.push_back({at[0], at[1], at[2]});
  }
  return path.torso;
}

MarkerArray RobotScene::still(const SceneContent& content) const {
  MarkerArray scene;
  drawTitle(content, scene);
  drawCards(cards_, family_, content, scene);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    if (targets_.empty()) continue;
    for (const int policy : policiesOf(cards_, task)) drawTarget(task, policy, scene);
  }
  drawLegend(legend(), scene);
  return scene;
}

std::vector<LegendEntry> RobotScene::legend() const {
  std::vector<LegendEntry> entries;
  if (!targets_.empty()) {
    entries.push_back({[](Figure& figure, const Point& at) { figure.arrow(at, 0.26, 0, kTarget); },
                       "where it is to go"});
  }
  entries.push_back({[](Figure& figure, const Point& at) {
                       figure.polyline({{at.x - 0.12, at.y - 0.03},
                                        {at.x - 0.04, at.y + 0.05},
                                        {at.x + 0.04, at.y - 0.05},
                                        {at.x + 0.12, at.y + 0.03}},
                                       0.035, kFaint);
                     },
                     "where it was"});
  entries.push_back(
      {[](Figure& figure, const Point& at) {
         figure.segment({at.x, at.y - 0.1}, {at.x, at.y + 0.1}, 0.03, kTick);
       },
       spacing_ == 1 ? "every metre" : "every " + pmeta::formatNumber(spacing_) + " m"});
  return entries;
}

/// An arrow: above the heads of planar robots, on the floor of the others.
void RobotScene::drawTarget(int task, int policy, MarkerArray& scene) const {
  const RobotTarget& target = targets_.at(task);
  const double length = 0.5 * unit();
  if (isPlanar()) {
    Figure figure(policyFrame(task, policy), "targets", policyId(task, policy), kTargetLayer);
    const bool forward = std::cos(target.direction) > 0;
    const double x = (forward ? 1 : -1) * (cards_.lane_width / 2 - 0.6 * length);
    figure.arrow({x, rest_height_ * scale() + 0.55 * kAir * unit()}, length, forward ? 0 : kPi,
                 kTarget);
    scene.markers.push_back(figure.take());
    return;
  }
  Figure figure(robotFrame(task, policy), "targets", policyId(task, policy),
                kTargetLayer * scale());
  const double reach = std::min(halfWidth(), 0.5 * view_.depth + 0.6 * size_) * scale();
  const double far = reach - 0.6 * length;
  figure.arrow({far * std::cos(target.direction), far * std::sin(target.direction)}, 1.2 * length,
               target.direction, kTarget);
  scene.markers.push_back(figure.take());
}

MarkerArray RobotScene::moving(const SceneContent& content, const std::vector<double>& seconds) {
  MarkerArray scene;
  for (int task = 0; task < cards_.num_tasks; ++task) {
    for (const int policy : policiesOf(cards_, task)) {
      Moment moment;
      moment.task = task;
      moment.policy = policy;
      moment.episode = viewOf(content, task, policy).episode;
      moment.lane_frame = policyFrame(task, policy);
      moment.robot_frame = robotFrame(task, policy);
      moment.torso = &pathOf(task, policy, moment.episode);
      if (moment.episode) moment.step = stepAt(*moment.episode, seconds.at(task), step_seconds_);
      drawFloor(moment, scene);
      scene.markers.push_back(drawPath(moment));
      if (moment.episode) {
        kinematics_.at(task)->pose(
            &moment.episode->positions[moment.step * moment.episode->position_size]);
      }
      drawGeoms(*kinematics_.at(task), pictureOf(moment), scene);
      const double y =
          isPlanar() ? -0.68 * kFloorDepth * unit()
                     : -0.5 * view_.depth * std::sin(view_.elevation) * scale() + 0.1 * unit();
      scene.markers.push_back(textMarker(moment.lane_frame, "steps", policyId(task, policy), {0, y},
                                         kRobotTextLayer, speedText(moment), 0.85 * cards_.letter,
                                         cards_.lane_width, kInk));
    }
  }
  return scene;
}

RobotPicture RobotScene::pictureOf(const Moment& moment) const {
  RobotPicture picture;
  picture.frame = moment.robot_frame;
  picture.id = policyId(moment.task, moment.policy);
  picture.color = policyColor(moment.policy);
  picture.scale = scale();
  picture.shown = moment.episode != nullptr;
  if (picture.shown) picture.origin = (*moment.torso)[moment.step];
  return picture;
}

/// Lines on the floor at every metre, which pass by as the robot moves; for planar robots ticks
/// with numbers.
void RobotScene::drawFloor(const Moment& moment, MarkerArray& scene) const {
  Position origin;
  if (moment.episode) origin = (*moment.torso)[moment.step];
  const int id = policyId(moment.task, moment.policy);
  const double s = scale();
  const double half = halfWidth();
  const double line = 0.02 * unit();
  if (isPlanar()) {
    Figure floor(moment.lane_frame, "floors", id, kFloorLayer);
    floor.rectangle(-half * s, -0.14 * unit(), half * s, 0, kFloor);
    floor.raise();
    for (const double x : linesAround(origin.x, half, spacing_)) {
      const double at = (x - origin.x) * s;
      floor.rectangle(at - line, -0.14 * unit(), at + line, 0, kTick);
    }
    floor.raise();
    floor.rectangle(-half * s, -line, half * s, line / 4, kFloorLine);
    scene.markers.push_back(floor.take());
    return;
  }
  Figure floor(moment.robot_frame, "floors", id, 0);
  const double depth = view_.depth / 2;
  floor.rectangle(-half * s, -depth * s, half * s, depth * s, kFloor);
  floor.raise();
  for (const double x : linesAround(origin.x, half, spacing_)) {
    const double at = (x - origin.x) * s;
    floor.rectangle(at - line / 2, -depth * s, at + line / 2, depth * s, kTick);
  }
  for (const double y : linesAround(origin.y, depth, spacing_)) {
    const double at = (y - origin.y) * s;
    floor.rectangle(-half * s, at - line / 2, half * s, at + line / 2, kTick);
  }
  scene.markers.push_back(floor.take());
}

/// What of the torso's path lies in view: beside planar robots, on the floor of the others.
Marker RobotScene::drawPath(const Moment& moment) const {
  const bool planar = isPlanar();
  Figure figure(planar ? moment.lane_frame : moment.robot_frame, "paths",
                policyId(moment.task, moment.policy), planar ? kFloorLayer : 0.02);
  if (!moment.episode) return figure.take();
  const Position& origin = (*moment.torso)[moment.step];
  const double s = scale();
  const double deep = planar ? 0 : view_.depth / 2;
  const double high = rest_height_ + kAir * size_;
  std::optional<Point> before;
  // backwards from the torso, until the path leaves the view
  for (const std::size_t i : thinnedSteps(moment.step, kMostPathPoints)) {
    const Position& at = (*moment.torso)[moment.step - i];
    const Point offset{at.x - origin.x, planar ? at.z : at.y - origin.y};
    const bool seen = std::abs(offset.x) <= halfWidth() &&
                      (planar ? offset.y >= 0 && offset.y <= high : std::abs(offset.y) <= deep);
    if (!seen) break;
    const Point next{offset.x * s, offset.y * s};
    if (before) {
      figure.segment(*before, next, 0.03 * unit(), mix(policyColor(moment.policy), kWhite, 0.5));
    }
    before = next;
  }
  return figure.take();
}

/// Speed towards the target, and what it should be or how far that has led.
std::string RobotScene::speedText(const Moment& moment) const {
  if (!moment.episode) return "";
  const std::vector<Position>& torso = *moment.torso;
  const std::size_t step = moment.step;
  const Position& now = torso[step];
  const Position& before = torso[step == 0 ? 0 : step - 1];
  static const RobotTarget kForward;
  const RobotTarget& target = targets_.empty() ? kForward : targets_.at(moment.task);
  const double along = ((now.x - before.x) * std::cos(target.direction) +
                        (now.y - before.y) * std::sin(target.direction)) /
                       step_seconds_;
  if (moment.episode->terminated && step == numSteps(*moment.episode)) {
    return (targets_.empty() ? "ended at step " : "fell at step ") + std::to_string(step);
  }
  if (view_.body == 0) return "step " + std::to_string(step);
  const std::string text = number(along) + " m/s";
  return target.velocity ? text + ", target " + number(*target.velocity)
                         : "x " + number(now.x) + " m, " + text;
}

}  // namespace pmeta_nodes
