#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pmeta_nodes/figure.h"
#include "pmeta_nodes/scene.h"

namespace pmeta_nodes {

// what all scenes have in common: colours, drawing order, title and legend

const Color kWhite = rgb(0xffffff);     ///< behind letters, and to lighten colours with
const Color kInk = rgb(0x222222);       ///< of text and lines
const Color kFaint = rgb(0x777777);     ///< of what matters less
const Color kGold = rgb(0xffb000);      ///< of goals
const Color kPersonal = rgb(0xd81b60);  ///< of personal policies
const Color kMeta = rgb(0x0b4fb3);      ///< of the meta-policy

/// `policy` as in Trajectory.msg.
Color policyColor(int policy);

/// Bands at the upper and lower edge of a scene.
constexpr double kTitleHeight = 1.05;
constexpr double kLegendHeight = 0.55;  ///< see kTitleHeight

/// Layer of symbols in the legend and of all text.
constexpr double kSymbolLayer = 0.3;
constexpr double kTextLayer = 0.5;  ///< see kSymbolLayer

/// Two decimals, "-" where there is none.
std::string number(double value);

/// "task_I/personal" or "task_I/meta".
std::string policyFrame(int task, int policy);

/// The identity of a marker of that task and policy.
int policyId(int task, int policy);

/// What is known of that policy; `policy` as in Trajectory.msg.
const PolicyView& viewOf(const SceneContent& content, int task, int policy);

/// What is known of a policy on a task, e.g. "round 7, return -3.50".
std::string resultText(const PolicyView& view, const SceneContent& content, bool is_meta);

/// Experiment, round and mean returns along the upper edge; namespace "title".
void drawTitle(const SceneContent& content, visualization_msgs::MarkerArray& scene);

/// What a symbol means.
struct LegendEntry {
  std::function<void(Figure& figure, const Point& at)> draw;  ///< within 0.25 x 0.25
  std::string text;                                           ///< beside the symbol
};

/// Both policies by colour, then `entries`, along the lower edge; namespace "legend".
void drawLegend(const std::vector<LegendEntry>& entries, visualization_msgs::MarkerArray& scene);

/// A frame below `parent`, not rotated.
geometry_msgs::TransformStamped shiftedFrame(const std::string& parent, const std::string& child,
                                             const Point& at);

}  // namespace pmeta_nodes
