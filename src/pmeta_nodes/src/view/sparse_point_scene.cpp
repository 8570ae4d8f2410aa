#include "view/sparse_point_scene.h"

#include <algorithm>
#include <cmath>

#include "draw/action_value_map.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

const RegisteredScene<SparsePointScene, pmeta::SparsePointFamily> kSparsePoint(
    "sparse_point_robot");

constexpr std::size_t kObservation = 2;  // x, y
constexpr std::size_t kMostPathPoints = 200;
constexpr int kMostGoals = 24;  // faint ones on a card

// what is seen of the plane; points beyond are drawn on its edge
constexpr double kLeft = -1.25;
constexpr double kRight = 1.25;
constexpr double kBottom = -0.42;
constexpr double kTop = 1.3;

// the maps of action values, beside it: personal above meta
constexpr double kMapGap = 0.14;
constexpr double kLargestMap = 0.68;
constexpr double kMaps = kMapGap + (1 + kActionValueKey) * kLargestMap;
constexpr double kMostCells = 30000;  // of all maps

constexpr double kGoalLayer = 0.05;
constexpr double kFillLayer = 0.1;
constexpr double kPathLayer = 0.15;
constexpr double kPointLayer = 0.25;

const Color kFaintGoal = rgb(0xbcc3cf);
const Color kGoal = rgb(0xe08a00);

/// Lower edge of the plane that is seen.
double bottomOf(const pmeta::SparsePointFamily& family, int num_tasks) {
  for (int task = 0; task < num_tasks; ++task) {
    if (family.task(task).goal_y < -1e-9) return -kTop;
  }
  return kBottom;
}

}  // namespace

SparsePointScene::SparsePointScene(const pmeta::SparsePointFamily& family, int num_tasks)
    : LaneScene(layoutCards(num_tasks, family.numTasks(), 1, kRight - kLeft + kMaps,
                            kTop - bottomOf(family, num_tasks))),
      family_(family),
      bottom_(bottomOf(family, num_tasks)) {}

std::vector<geometry_msgs::TransformStamped> SparsePointScene::frames() const {
  std::vector<geometry_msgs::TransformStamped> frames = cardFrames(cards_);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    Point origin = cards_.laneBottom(task, Trajectory::META);
    origin.x -= kMaps / 2 * scale();
    origin.y -= bottom_ * scale();
    frames.push_back(shiftedFrame(taskFrame(task), planeFrame(task), origin));
  }
  return frames;
}

std::string SparsePointScene::planeFrame(int task) { return taskFrame(task) + "/plane"; }

std::string SparsePointScene::problem(const Trajectory& trajectory) const {
  const std::string problem = formProblem(trajectory, kObservation);
  return problem.empty() ? actionValueProblem(trajectory) : problem;
}

int SparsePointScene::reachedAt(const Trajectory& episode, int task, std::size_t last) const {
  const pmeta::SparsePointTask& goal = family_.task(task);
  for (std::size_t step = 0; step <= last; ++step) {
    const double* at = &episode.observations[step * kObservation];
    if (std::hypot(at[0] - goal.goal_x, at[1] - goal.goal_y) <= family_.goalRadius()) {
      return static_cast<int>(step);
    }
  }
  return -1;
}

Point SparsePointScene::pointAt(const Trajectory& episode, std::size_t step) const {
  const double* at = &episode.observations[step * kObservation];
  return {std::clamp(at[0], kLeft, kRight) * scale(), std::clamp(at[1], bottom_, kTop) * scale()};
}

void SparsePointScene::drawGoals(Figure& figure, int task) const {
  const double s = scale();
  const double radius = family_.goalRadius() * s;
  std::vector<Point> circle;
  const double from = bottom_ == kBottom ? 0 : -kPi;
  for (int i = 0; i <= 48; ++i) {
    const double angle = from + (kPi - from) * i / 48;
    circle.push_back({s * std::cos(angle), s * std::sin(angle)});
  }
  figure.polyline(circle, 0.012 * s, kFaintGoal);
  const int stride = (cards_.num_tasks + kMostGoals - 1) / kMostGoals;
  for (int other = 0; other < cards_.num_tasks; other += stride) {
    const pmeta::SparsePointTask& goal = family_.task(other);
    figure.ring({goal.goal_x * s, goal.goal_y * s}, radius, 0.012 * s, kFaintGoal);
  }
  figure.raise();
  const pmeta::SparsePointTask& own = family_.task(task);
  const Point centre{own.goal_x * s, own.goal_y * s};
  figure.disc(centre, radius, mix(kGoal, kWhite, 0.8));
  figure.raise();
  figure.ring(centre, radius, 0.03 * s, kGoal);
  figure.cross({0, 0}, 0.05 * s, 0.02 * s, kInk);
}

void SparsePointScene::drawMaps(const SceneContent& content, int task, MarkerArray& scene) const {
  const double s = scale();
  const double height = kTop - bottom_;
  const double side = std::min(kLargestMap, (height - 3 * kMapGap) / 2);
  const int maps = cards_.num_tasks + cards_.num_train;
  ActionValuePlace place;
  place.frame = planeFrame(task);
  place.side = side * s;
  place.letter = 0.8 * cards_.letter;
  place.cells = static_cast<int>(std::sqrt(kMostCells / maps));
  for (const int policy : policiesOf(cards_, task)) {
    // a test task's only map stands in the middle
    const double lower = cards_.isTest(task) ? (height - side) / 2 : kMapGap;
    const double above = policy == Trajectory::META ? 0 : side + kMapGap;
    place.corner = {(kRight + kMapGap) * s, (bottom_ + lower + above) * s};
    drawActionValues(place, task, policy, viewOf(content, task, policy), scene);
  }
}

MarkerArray SparsePointScene::still(const SceneContent& content) const {
  MarkerArray scene;
  drawTitle(content, scene);
  drawCards(cards_, family_, content, scene);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    Figure goals(planeFrame(task), "goals", task, kGoalLayer);
    drawGoals(goals, task);
    scene.markers.push_back(goals.take());
    for (const int policy : policiesOf(cards_, task)) {
      scene.markers.push_back(drawPath(viewOf(content, task, policy), task, policy));
    }
    drawMaps(content, task, scene);
  }
  drawLegend(
      {{[](Figure& figure, const Point& at) { figure.cross(at, 0.09, 0.035, kInk); }, "start"},
       {[](Figure& figure, const Point& at) { figure.ring(at, 0.11, 0.025, kGoal); },
        "the task's goal"},
       {[](Figure& figure, const Point& at) {
          figure.sector(at, 0.11, kPi / 2, 3 * kPi / 2, mix(kPersonal, kWhite, 0.45));
          figure.sector(at, 0.11, -kPi / 2, kPi / 2, mix(kMeta, kWhite, 0.45));
        },
        "reached"},
       {[](Figure& figure, const Point& at) {
          for (int part = 0; part < 10; ++part) {
            const double left = at.x - 0.1 + 0.02 * part;
            figure.rectangle(left, at.y - 0.1, left + 0.02, at.y + 0.1, viridis(part / 9.0));
          }
        },
        "Q at the start by action, -1 to 1"},
       {[](Figure& figure, const Point& at) {
          figure.disc(at, 0.11, viridis(0.75));
          figure.raise();
          figure.disc(at, 0.07, kWhite);
          figure.raise();
          figure.disc(at, 0.05, kInk);
        },
        "the action taken"},
       {[](Figure& figure, const Point& at) { figure.ring(at, 0.11, 0.015, kFaint); },
        "other tasks' goals"}},
      scene);
  return scene;
}

visualization_msgs::Marker SparsePointScene::drawPath(const PolicyView& view, int task,
                                                      int policy) const {
  return pathMarker(planeFrame(task), task, policy, kPathLayer, view, kMostPathPoints,
                    0.05 * scale(), 0.022 * scale(),
                    [&](std::size_t step) { return pointAt(*view.episode, step); });
}

void SparsePointScene::drawMoving(const PolicyView& view, int task, int policy, double seconds,
                                  MarkerArray& scene) const {
  const bool shown = view.episode != nullptr;
  const bool is_meta = policy == Trajectory::META;
  const std::size_t step = shown ? stepAt(*view.episode, seconds, kTimeStep) : 0;
  const int reached = shown ? reachedAt(*view.episode, task, step) : -1;
  const Color color = policyColor(policy);
  const double s = scale();

  scene.markers.push_back(policyMarker(
      planeFrame(task), "fills", task, policy, kFillLayer, reached >= 0, [&](Figure& figure) {
        const pmeta::SparsePointTask& goal = family_.task(task);
        const double from = is_meta ? -kPi / 2 : kPi / 2;
        const double to = cards_.isTest(task) ? from + 2 * kPi : from + kPi;
        figure.sector({goal.goal_x * s, goal.goal_y * s}, (family_.goalRadius() - 0.03) * s, from,
                      to, mix(color, kWhite, 0.45));
      }));
  // meta's point is larger and lies below, so that both are seen where they meet
  scene.markers.push_back(policyMarker(planeFrame(task), "points", task, policy,
                                       kPointLayer - (is_meta ? 0.05 : 0), shown,
                                       [&](Figure& figure) {
                                         const double radius = (is_meta ? 0.085 : 0.055) * s;
                                         figure.disc({0, 0}, radius, kWhite);
                                         figure.raise();
                                         figure.disc({0, 0}, 0.82 * radius, color);
                                         figure.place(pointAt(*view.episode, step), 0);
                                       }));
  std::string text;
  if (shown) {
    const bool ended = step == numSteps(*view.episode);
    text = reached >= 0 ? "goal at step " + std::to_string(reached)
           : ended      ? "goal not reached by step " + std::to_string(step)
                        : "step " + std::to_string(step);
  }
  const double x = cards_.isTest(task) ? 0 : (is_meta ? 0.5 : -0.5) * kRight;
  scene.markers.push_back(textMarker(planeFrame(task), "steps", policyId(task, policy),
                                     {x * s, (bottom_ + 0.1) * s}, kTextLayer, text,
                                     0.85 * cards_.letter, kRight * s, color));
}

}  // namespace pmeta_nodes
