#include "draw/action_value_map.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace pmeta_nodes {

using pmeta_msgs::Trajectory;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

namespace {

constexpr std::uint32_t kFinestGrid = 64;

constexpr double kAxesLayer = 0.05;
constexpr double kCellLayer = 0.1;
constexpr double kDotLayer = 0.15;

// in sides of the map
constexpr double kTick = 0.06;
constexpr double kKeyGap = 0.08;
constexpr double kKeyWidth = 0.09;
constexpr double kNumberWidth = 0.75;
constexpr int kKeyParts = 16;

/// Values of one map, thinned out to the cells that are drawn.
class Values {
 public:
  Values(const Trajectory& episode, int most_cells)
      : episode_(episode),
        cells_(std::min(static_cast<int>(episode.action_grid), std::max(most_cells, 2))) {
    const auto [low, high] =
        std::minmax_element(episode.action_values.begin(), episode.action_values.end());
    low_ = *low;
    high_ = *high;
  }

  int cells() const { return cells_; }
  double low() const { return low_; }
  double high() const { return high_; }

  Color color(int row, int column) const {
    const double value = episode_.action_values[index(row) * episode_.action_grid + index(column)];
    return viridis(high_ > low_ ? (value - low_) / (high_ - low_) : 0.5);
  }

  /// Where an action lies along an axis of length 1: -1 and 1 in the middle of the outer cells.
  double along(double action) const {
    const double cell = (std::clamp(action, -1.0, 1.0) + 1) / 2 * (cells_ - 1);
    return (cell + 0.5) / cells_;
  }

 private:
  std::size_t index(int cell) const {
    return static_cast<std::size_t>(
        std::lround(static_cast<double>(cell) * (episode_.action_grid - 1) / (cells_ - 1)));
  }

  const Trajectory& episode_;
  int cells_;
  double low_, high_;
};

std::string threeDigits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// One point for each cell: a tenth of what its triangles would take.
Marker cellMarker(const ActionValuePlace& place, int id, const Values* values) {
  Marker marker = makeMarker(place.frame, "action values", id);
  marker.type = Marker::POINTS;
  marker.color = kWhite;
  marker.action = values == nullptr ? Marker::DELETE : Marker::ADD;
  if (values == nullptr) return marker;
  const double size = place.side / values->cells();
  marker.scale.x = marker.scale.y = size;
  for (int row = 0; row < values->cells(); ++row) {
    for (int column = 0; column < values->cells(); ++column) {
      geometry_msgs::Point point;
      point.x = place.corner.x + (column + 0.5) * size;
      point.y = place.corner.y + (row + 0.5) * size;
      point.z = kCellLayer;
      marker.points.push_back(point);
      marker.colors.push_back(values->color(row, column));
    }
  }
  return marker;
}

void drawAxes(Figure& figure, const ActionValuePlace& place, const Values& values,
              const Color& color) {
  const double s = place.side;
  const auto [x, y] = place.corner;
  const double line = 0.035 * s;
  figure.rectangle(x - line, y - line, x + s + line, y + s + line, color);
  figure.raise();
  // seen where squares leave a gap
  figure.rectangle(x, y, x + s, y + s, viridis(0.5));
  for (const double action : {-1.0, 0.0, 1.0}) {
    const double at = values.along(action) * s;
    figure.rectangle(x + at - line / 2, y - kTick * s - line, x + at + line / 2, y, color);
    figure.rectangle(x - kTick * s - line, y + at - line / 2, x, y + at + line / 2, color);
  }
  const double left = x + (1 + kKeyGap) * s;
  for (int part = 0; part < kKeyParts; ++part) {
    figure.rectangle(left, y + s * part / kKeyParts, left + kKeyWidth * s,
                     y + s * (part + 1) / kKeyParts, viridis((part + 0.5) / kKeyParts));
  }
}

void drawAction(Figure& figure, const ActionValuePlace& place, const Values& values,
                const Trajectory& episode, const Color& color) {
  if (episode.action_size != 2 || episode.actions.size() < 2) return;
  const double s = place.side;
  const Point at{place.corner.x + values.along(episode.actions[0]) * s,
                 place.corner.y + values.along(episode.actions[1]) * s};
  figure.moveTo(kDotLayer);
  figure.disc(at, 0.09 * s, kWhite);
  figure.raise();
  figure.disc(at, 0.065 * s, color);
}

}  // namespace

void drawActionValues(const ActionValuePlace& place, int task, int policy, const PolicyView& view,
                      MarkerArray& scene) {
  const bool shown = view.episode != nullptr && view.episode->action_grid > 0;
  const int id = policyId(task, policy);
  std::string low, high;
  Figure axes(place.frame, "action value axes", id, kAxesLayer);
  if (shown) {
    const Values values(*view.episode, place.cells);
    low = threeDigits(values.low());
    high = threeDigits(values.high());
    scene.markers.push_back(cellMarker(place, id, &values));
    drawAxes(axes, place, values, policyColor(policy));
    drawAction(axes, place, values, *view.episode, policyColor(policy));
  } else {
    scene.markers.push_back(cellMarker(place, id, nullptr));
  }
  scene.markers.push_back(axes.take());

  const double s = place.side;
  const auto [x, y] = place.corner;
  const auto write = [&](int which, const Point& at, const std::string& text, double width,
                         const Color& color) {
    scene.markers.push_back(textMarker(place.frame, "action value texts", 4 * id + which, at,
                                       kTextLayer, text, place.letter, width, color));
  };
  const double numbers = x + (1 + kKeyGap + kKeyWidth + 0.03 + kNumberWidth / 2) * s;
  write(0, {numbers, y + s - place.letter / 2}, high, kNumberWidth * s, kInk);
  write(1, {numbers, y + place.letter / 2}, low, kNumberWidth * s, kInk);
  write(2, {x + 0.75 * s, y - kTick * s - 0.3 * place.letter}, shown ? "x" : "", s, kInk);
  write(3, {x - kTick * s - 0.4 * place.letter, y + 0.75 * s}, shown ? "y" : "", s, kInk);
}

std::string actionValueProblem(const Trajectory& trajectory) {
  const std::size_t grid = trajectory.action_grid;
  if (grid == 1 || grid > kFinestGrid || trajectory.action_values.size() != grid * grid) {
    return "it has " + std::to_string(trajectory.action_values.size()) +
           " action values for a grid of " + std::to_string(grid) +
           "; there must be its square, from 2 to " + std::to_string(kFinestGrid) +
           " along each axis, or none.";
  }
  const auto finite = [](float value) { return std::isfinite(value); };
  if (!std::all_of(trajectory.action_values.begin(), trajectory.action_values.end(), finite)) {
    return "it holds an action value that is not finite.";
  }
  for (const double action : trajectory.actions) {
    if (!std::isfinite(action)) return "it holds an action that is not finite.";
  }
  return "";
}

}  // namespace pmeta_nodes
