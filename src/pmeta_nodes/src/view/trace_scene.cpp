#include "view/trace_scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/settings.h"

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

constexpr double kLowestRow = 0.3;  // a plot and the line above it that names it: what can be read
constexpr double kHighestRow = 0.95;
constexpr double kNarrowestPlot = 1.5;
constexpr std::size_t kMostColumns = 3;
constexpr std::size_t kMostPoints = 200;      // of a trace
constexpr std::size_t kMostSegments = 20000;  // of a scene
constexpr double kSecondsOfEpisode = 12;      // where the environment knows no seconds

constexpr double kPlotLayer = 0.05;
constexpr double kTraceLayer = 0.1;
constexpr double kDotLayer = 0.2;

const Color kPlotGround = rgb(0xffffff);
const Color kPlotBorder = rgb(0xd5d9e0);
const Color kZero = rgb(0xaab0bb);

/// Width of a line in heights of its letters, in rviz's font.
double lineWidth(const std::string& text) {
  constexpr double kNarrow = 0.24, kUsual = 0.5, kWide = 0.72;
  double width = 0;
  for (const char c : text) {
    const bool narrow = std::strchr("ijltfr.,:;[]()-/'", c) != nullptr;
    width += narrow ? kNarrow : c == 'm' || c == 'w' ? kWide : kUsual;
  }
  return width;
}

/// A text from `edge` to the right, or to the left of it; smaller if it is wider than `width`.
visualization_msgs::Marker sideText(const std::string& ns, int task, int id, const Point& edge,
                                    bool to_right, const std::string& text, double letter,
                                    double width, const Color& color) {
  const double height = text.empty() ? letter : std::min(letter, width / lineWidth(text));
  const double half = 0.5 * lineWidth(text) * height;
  return textMarker(taskFrame(task), ns, id, {edge.x + (to_right ? half : -half), edge.y},
                    kTextLayer, text, height, kSceneWidth, color);
}

std::string nameOf(const pmeta::Quantity& quantity) {
  return quantity.unit.empty() ? quantity.name : quantity.name + " [" + quantity.unit + "]";
}

bool isShown(const PolicyView& view) { return view.episode && numSteps(*view.episode) > 0; }

std::size_t longestEpisode(const SceneContent& content) {
  std::size_t longest = 1;
  for (const TaskView& task : content.tasks) {
    for (const PolicyView* view : {&task.personal, &task.meta}) {
      if (view->episode) longest = std::max(longest, numSteps(*view->episode));
    }
  }
  return longest;
}

}  // namespace

TraceScene::TraceScene(const pmeta::EnvFamily& family, int num_tasks)
    : family_(family), spec_(family.make(0)->spec()) {
  step_seconds_ = spec_.step_seconds > 0 ? spec_.step_seconds
                                         : std::clamp(kSecondsOfEpisode / spec_.horizon, 0.02, 0.5);
  arrange(num_tasks, family.numTasks());
  chooseTraces();
  const std::size_t lines = traces_.size() * 2 * static_cast<std::size_t>(num_tasks);
  points_ = std::clamp<std::size_t>(kMostSegments / lines, 20, kMostPoints);
}

/// As many plots to a card as can be read.
void TraceScene::arrange(int num_tasks, int num_train) {
  const auto wanted = static_cast<std::size_t>(spec_.observation_size + spec_.action_size + 1);
  const double rows = std::clamp<double>(wanted, 4, 12);
  cards_ = layoutCards(num_tasks, num_train, 1, 2.2, 0.55 * rows);
  axis_ = 1.2 * cards_.letter;
  const double height = cards_.lane_height - axis_;
  const auto most_rows = static_cast<std::size_t>(std::max(1.0, std::floor(height / kLowestRow)));
  while (columns_ < kMostColumns && columns_ * most_rows < wanted &&
         cards_.lane_width / static_cast<double>(columns_ + 1) >= kNarrowestPlot) {
    ++columns_;
  }
  rows_ = std::min(most_rows, (wanted + columns_ - 1) / columns_);
  pitch_ = std::min(kHighestRow, height / static_cast<double>(rows_));
  letter_ = std::min(0.14, 0.33 * pitch_);
}

/// The reward, and of observations and actions as many as there is room for.
void TraceScene::chooseTraces() {
  const auto observations = static_cast<std::size_t>(spec_.observation_size);
  const auto actions = static_cast<std::size_t>(spec_.action_size);
  const std::size_t room = columns_ * rows_ - 1;
  const std::size_t most_actions =
      observations + actions <= room ? actions : std::min(actions, room / 3);
  const std::size_t most_observations = std::min(observations, room - most_actions);
  const auto names = pmeta::observationsOf(spec_);
  for (std::size_t i = 0; i < most_observations; ++i) {
    traces_.push_back({Source::kObservation, i, nameOf(names[i])});
  }
  const auto bounds = pmeta::actionsOf(spec_);
  for (std::size_t i = 0; i < most_actions; ++i) {
    traces_.push_back({Source::kAction, i, nameOf(bounds[i]), bounds[i].low, bounds[i].high});
  }
  traces_.push_back({Source::kReward, 0, "reward"});
}

std::vector<geometry_msgs::TransformStamped> TraceScene::frames() const {
  return cardFrames(cards_);
}

std::string TraceScene::problem(const Trajectory& trajectory) const {
  const std::string problem =
      formProblem(trajectory, static_cast<std::size_t>(spec_.observation_size));
  if (!problem.empty()) return problem;
  if (trajectory.action_size != static_cast<std::uint32_t>(spec_.action_size)) {
    return "its actions are of size " + std::to_string(trajectory.action_size) +
           "; they must be of size " + std::to_string(spec_.action_size) + ".";
  }
  for (const auto* values : {&trajectory.actions, &trajectory.rewards}) {
    for (const double value : *values) {
      if (!std::isfinite(value)) return "it holds an action or a reward that is not finite.";
    }
  }
  return "";
}

double TraceScene::valueOf(const Trace& trace, const Trajectory& episode, std::size_t step) {
  const std::size_t steps = numSteps(episode);
  if (trace.source == Source::kObservation) {
    return episode.observations[step * episode.observation_size + trace.index];
  }
  if (trace.source == Source::kAction) {
    return episode.actions[std::min(step, steps - 1) * episode.action_size + trace.index];
  }
  return episode.rewards[std::max<std::size_t>(step, 1) - 1];
}

std::vector<TraceScene::Trace> TraceScene::scaledTraces(const SceneContent& content) const {
  std::vector<Trace> traces = traces_;
  const auto extend = [&](const PolicyView& view) {
    if (!isShown(view)) return;
    for (Trace& trace : traces) {
      if (trace.source == Source::kAction) continue;
      for (const std::size_t step : thinnedSteps(numSteps(*view.episode), points_)) {
        const double value = valueOf(trace, *view.episode, step);
        trace.low = std::min(trace.low, value);
        trace.high = std::max(trace.high, value);
      }
    }
  };
  for (const TaskView& task : content.tasks) {
    extend(task.personal);
    extend(task.meta);
  }
  return traces;
}

TraceScene::Plot TraceScene::plotOf(int task, std::size_t trace) const {
  const double width = cards_.lane_width / static_cast<double>(columns_);
  const Point origin = cards_.laneBottom(task, Trajectory::META);
  const double top =
      origin.y + cards_.lane_height - static_cast<double>(trace % rows_) * pitch_ - 1.2 * letter_;
  Plot plot;
  plot.height = 0.94 * pitch_ - 1.2 * letter_;
  plot.width = 0.96 * width;
  plot.left =
      origin.x - cards_.lane_width / 2 + static_cast<double>(trace / rows_) * width + 0.02 * width;
  plot.bottom = top - plot.height;
  return plot;
}

Point TraceScene::pointAt(const Plot& plot, const Trace& trace, const Trajectory& episode,
                          std::size_t step, std::size_t longest) const {
  constexpr double kMargin = 0.1;  // of the plot, above and below
  const double value = valueOf(trace, episode, step);
  // halves first: the range of what strangers send may be more than a double holds
  const double range = 0.5 * trace.high - 0.5 * trace.low;
  const double share =
      range > 0 ? std::clamp((0.5 * value - 0.5 * trace.low) / range, 0.0, 1.0) : 0.5;
  return {plot.left + plot.width * static_cast<double>(step) / static_cast<double>(longest),
          plot.bottom + plot.height * (kMargin + (1 - 2 * kMargin) * share)};
}

MarkerArray TraceScene::still(const SceneContent& content) const {
  MarkerArray scene;
  drawTitle(content, scene);
  drawCards(cards_, family_, content, scene);
  const std::vector<Trace> traces = scaledTraces(content);
  const std::size_t longest = longestEpisode(content);
  for (int task = 0; task < cards_.num_tasks; ++task) {
    drawPlots(task, traces, longest, scene);
    for (const int policy : policiesOf(cards_, task)) {
      drawTraces(task, policy, traces, longest, viewOf(content, task, policy), scene);
    }
  }
  drawLegend(legend(), scene);
  return scene;
}

std::vector<LegendEntry> TraceScene::legend() const {
  const auto line = [](Figure& figure, const Point& at) {
    figure.segment({at.x - 0.11, at.y}, {at.x + 0.11, at.y}, 0.012, kZero);
  };
  std::vector<LegendEntry> entries = {{line, "zero"}};
  const auto count = [&](Source source) {
    return std::count_if(traces_.begin(), traces_.end(),
                         [source](const Trace& trace) { return trace.source == source; });
  };
  const auto tell = [&](Source source, int all, const std::string& what) {
    if (count(source) == all) return;
    entries.push_back({[](Figure&, const Point&) {},
                       std::to_string(count(source)) + " of " + std::to_string(all) + " " + what});
  };
  tell(Source::kObservation, spec_.observation_size, "observations");
  tell(Source::kAction, spec_.action_size, "actions");
  return entries;
}

/// Grounds, zero lines, names and scales.
void TraceScene::drawPlots(int task, const std::vector<Trace>& traces, std::size_t longest,
                           MarkerArray& scene) const {
  constexpr double kLine = 0.008;
  Figure ground(taskFrame(task), "plots", task, kPlotLayer);
  for (std::size_t i = 0; i < traces.size(); ++i) {
    const Trace& trace = traces[i];
    const Plot plot = plotOf(task, i);
    const double right = plot.left + plot.width;
    const double top = plot.bottom + plot.height;
    ground.moveTo(kPlotLayer);
    ground.rectangle(plot.left, plot.bottom, right, top, kPlotBorder);
    ground.raise();
    ground.rectangle(plot.left + kLine, plot.bottom + kLine, right - kLine, top - kLine,
                     kPlotGround);
    if (trace.low < 0 && trace.high > 0) {
      const double share = 0.1 + 0.8 * (-trace.low / (trace.high - trace.low));
      const double zero = plot.bottom + share * plot.height;
      ground.raise();
      ground.rectangle(plot.left, zero - kLine / 2, right, zero + kLine / 2, kZero);
    }
    const double y = top + 0.55 * letter_;
    const int id = task * static_cast<int>(traces_.size()) + static_cast<int>(i);
    scene.markers.push_back(sideText("quantities", task, id, {plot.left, y}, true, trace.name,
                                     letter_, 0.6 * plot.width, kInk));
    scene.markers.push_back(sideText("scales", task, id, {right, y}, false, scaleOf(trace),
                                     0.9 * letter_, 0.36 * plot.width, kFaint));
  }
  scene.markers.push_back(ground.take());
  const Plot last = plotOf(task, rows_ - 1);
  const std::string steps = std::to_string(longest) + (longest == 1 ? " step" : " steps");
  scene.markers.push_back(sideText("axes", task, task,
                                   {last.left + last.width, last.bottom - 0.55 * axis_}, false,
                                   steps, 0.9 * letter_, 0.3 * last.width, kFaint));
}

/// What the plot's lower and upper edge are: of discrete actions, their names from below.
std::string TraceScene::scaleOf(const Trace& trace) const {
  if (trace.source == Source::kAction && !spec_.choices.empty()) return pmeta::join(spec_.choices);
  if (trace.low > trace.high) return "";
  if (trace.low == trace.high) return pmeta::significant(trace.low, 3);
  return pmeta::significant(trace.low, 3) + " to " + pmeta::significant(trace.high, 3);
}

void TraceScene::drawTraces(int task, int policy, const std::vector<Trace>& traces,
                            std::size_t longest, const PolicyView& view, MarkerArray& scene) const {
  const bool is_meta = policy == Trajectory::META;
  const bool shown = isShown(view);
  scene.markers.push_back(policyMarker(
      taskFrame(task), "traces", task, policy, kTraceLayer + (is_meta ? 0 : 0.02), shown,
      [&](Figure& figure) {
        const Color color = mix(policyColor(policy), kWhite, is_meta ? 0.35 : 0.1);
        for (std::size_t i = 0; i < traces.size(); ++i) {
          const bool holds = traces[i].source == Source::kAction && spec_.num_actions > 0;
          const Plot plot = plotOf(task, i);
          std::vector<Point> line;
          for (const std::size_t step : thinnedSteps(numSteps(*view.episode), points_)) {
            const Point at = pointAt(plot, traces[i], *view.episode, step, longest);
            if (holds && !line.empty()) line.push_back({at.x, line.back().y});
            line.push_back(at);
          }
          figure.polyline(line, is_meta ? 0.032 : 0.016, color);
        }
      }));
}

MarkerArray TraceScene::moving(const SceneContent& content, const std::vector<double>& seconds) {
  MarkerArray scene;
  const std::vector<Trace> traces = scaledTraces(content);
  const std::size_t longest = longestEpisode(content);
  forEachLane(
      cards_, content, seconds, [&](const PolicyView& view, int task, int policy, double at) {
        const bool is_meta = policy == Trajectory::META;
        const bool shown = isShown(view);
        const std::size_t step = shown ? stepAt(*view.episode, at, step_seconds_) : 0;
        scene.markers.push_back(policyMarker(
            taskFrame(task), "dots", task, policy, kDotLayer - (is_meta ? 0.05 : 0), shown,
            [&](Figure& figure) {
              for (std::size_t i = 0; i < traces.size(); ++i) {
                const Point dot = pointAt(plotOf(task, i), traces[i], *view.episode, step, longest);
                figure.disc(dot, is_meta ? 0.045 : 0.03, policyColor(policy));
              }
            }));
        std::string text;
        if (shown) {
          const bool ended = view.episode->terminated && step == numSteps(*view.episode);
          text = (ended ? "ended at " : "step ") + std::to_string(step);
        }
        const Plot last = plotOf(task, rows_ - 1);
        const double left = cards_.isTest(task) || !is_meta ? 0 : 0.35 * last.width;
        scene.markers.push_back(sideText("steps", task, policyId(task, policy),
                                         {last.left + left, last.bottom - 0.55 * axis_}, true, text,
                                         letter_, 0.32 * last.width, policyColor(policy)));
      });
  return scene;
}

}  // namespace pmeta_nodes
