#include "pmeta_nodes/scene_parts.h"

#include <algorithm>

#include "pmeta_core/base/format.h"

namespace pmeta_nodes {

using pmeta_msgs::RoundSummary;
using pmeta_msgs::Trajectory;
using visualization_msgs::MarkerArray;

namespace {

std::string stateText(const RoundSummary& summary) {
  switch (summary.state) {
    case RoundSummary::LATE:
      return " (waiting for late agents)";
    case RoundSummary::PAUSED:
      return " (paused)";
    case RoundSummary::FINISHED:
      return " (finished)";
    case RoundSummary::STOPPED:
      return " (stopped)";
    default:
      return "";
  }
}

}  // namespace

Color policyColor(int policy) { return policy == Trajectory::META ? kMeta : kPersonal; }

std::string number(double value) { return pmeta::shortNumber(value); }

std::string policyFrame(int task, int policy) {
  return "task_" + std::to_string(task) + (policy == Trajectory::META ? "/meta" : "/personal");
}

int policyId(int task, int policy) { return 2 * task + (policy == Trajectory::META); }

const PolicyView& viewOf(const SceneContent& content, int task, int policy) {
  const TaskView& views = content.tasks.at(task);
  return policy == Trajectory::META ? views.meta : views.personal;
}

std::string resultText(const PolicyView& view, const SceneContent& content, bool is_meta) {
  if (is_meta && !content.has_meta) return "no meta-policy here";
  if (!is_meta && !content.has_personal) return "no personal policy here";
  if (view.result) {
    return "round " + std::to_string(view.result->round) + ", return " +
           number(view.result->return_mean);
  }
  if (view.episode) {
    return "round " + std::to_string(view.episode->round) + ", episode " +
           number(view.episode->episode_return);
  }
  return "no round yet";
}

void drawTitle(const SceneContent& content, MarkerArray& scene) {
  std::string title = content.experiment + ": ";
  std::string personal;
  std::string meta;
  std::string test;
  if (content.summary) {
    title += "round " + std::to_string(content.summary->round) + " of " +
             std::to_string(content.summary->rounds) + stateText(*content.summary);
    personal = "mean personal return (PP) " + number(content.summary->personal_return);
    if (content.has_meta) meta = "mean meta return (MP) " + number(content.summary->meta_return);
    if (std::isfinite(content.summary->test_return)) {
      test = "meta, on test tasks " + number(content.summary->test_return);
    }
  } else {
    title += "waiting for round 1 of " + std::to_string(content.rounds);
  }
  if (!content.has_trajectories) title += " - trajectories are switched off";

  const double y = kSceneHeight / 2 - 0.72;
  const double spread = test.empty() ? 2.2 : 3.8;
  const double middle = test.empty() ? spread : 0;
  scene.markers.push_back(
      textMarker(kWorldFrame, "title", 0, {0, y + 0.42}, kTextLayer, title, 0.3, 11.5, kInk));
  scene.markers.push_back(textMarker(kWorldFrame, "title", 1, {-spread, y}, kTextLayer, personal,
                                     0.23, 4.2, kPersonal));
  scene.markers.push_back(
      textMarker(kWorldFrame, "title", 2, {middle, y}, kTextLayer, meta, 0.23, 4.2, kMeta));
  scene.markers.push_back(
      textMarker(kWorldFrame, "title", 3, {spread, y}, kTextLayer, test, 0.23, 3.6, kMeta));
}

void drawLegend(const std::vector<LegendEntry>& entries, MarkerArray& scene) {
  constexpr double kMargin = 0.1;
  double letter = 0.17;
  double symbol = 0.25;
  double gap = 0.3;
  const auto swatch = [](const Color& color) {
    return [color](Figure& figure, const Point& at) { figure.disc(at, 0.1, color); };
  };
  std::vector<LegendEntry> all = {{swatch(kPersonal), "personal policy"},
                                  {swatch(kMeta), "meta-policy"}};
  all.insert(all.end(), entries.begin(), entries.end());

  const auto textWidth = [&](const LegendEntry& e) {
    return kLetterWidth * letter * e.text.size();
  };
  double width = -gap;
  for (const LegendEntry& entry : all) width += symbol + textWidth(entry) + gap;
  const double shrink = std::min(1.0, (kSceneWidth - 2 * kMargin) / width);
  for (double* size : {&width, &letter, &symbol, &gap}) *size *= shrink;

  const double y = -kSceneHeight / 2 + kLegendHeight / 2;
  Figure figure(kWorldFrame, "legend", 0, kSymbolLayer);
  double x = -width / 2;
  int id = 1;
  for (const LegendEntry& entry : all) {
    entry.draw(figure, {x + symbol / 2 - 0.05, y});
    const Point at{x + symbol + textWidth(entry) / 2, y};
    scene.markers.push_back(
        textMarker(kWorldFrame, "legend", id++, at, kTextLayer, entry.text, letter, 4, kInk));
    x += symbol + textWidth(entry) + gap;
  }
  scene.markers.push_back(figure.take());
}

geometry_msgs::TransformStamped shiftedFrame(const std::string& parent, const std::string& child,
                                             const Point& at) {
  geometry_msgs::TransformStamped frame;
  frame.header.frame_id = parent;
  frame.child_frame_id = child;
  frame.transform.translation.x = at.x;
  frame.transform.translation.y = at.y;
  frame.transform.rotation.w = 1;
  return frame;
}

}  // namespace pmeta_nodes
