#include "view/gridworld_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <utility>

#include "pmeta_nodes/scene_parts.h"

namespace pmeta_nodes {
namespace {

const RegisteredScene<GridworldScene, pmeta::GridworldFamily> kGridworld("gridworld");

using pmeta_msgs::Trajectory;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

// grids stand between title and legend
constexpr double kColumnGap = 0.1;        // in sides of a grid
constexpr double kLabelBand = 0.15;       // above and below each grid, in sides of a grid
constexpr double kLeastLabelBand = 0.22;  // so that labels of many small grids can be read
constexpr double kLetterShare = 0.57;     // height of letters, in label bands

// beyond these a grid shows blocks of cells, and no arrows or lines: bounds the size of messages
constexpr int kMaxTiles = 64;
constexpr int kMaxArrows = 32;

// drawing order, bottom to top
constexpr double kCellLayer = 0.0;
constexpr double kArrowLayer = 0.1;
constexpr double kPathLayer = 0.2;
constexpr double kHeadLayer = 0.25;

const Color kLine = rgb(0xffffff);
const Color kUnknown = rgb(0xd9d9d9);

/// Columns and rows of tasks that make the grids as large as possible.
struct Layout {
  int columns = 1;
  int rows = 1;
  double slot_width = 0;
  double slot_height = 0;  ///< of one grid with its labels
  double side = 0;
  double label_band = 0;
};

Layout layoutGrids(int num_tasks) {
  Layout best;
  for (int columns = 1; columns <= num_tasks; ++columns) {
    Layout layout;
    layout.columns = columns;
    layout.rows = (num_tasks + columns - 1) / columns;
    layout.slot_width = kSceneWidth / columns;
    layout.slot_height = (kSceneHeight - kTitleHeight - kLegendHeight) / (2 * layout.rows);
    const double least_band = std::min(kLeastLabelBand, layout.slot_height / 4);
    layout.side =
        std::min({layout.slot_width / (1 + kColumnGap), layout.slot_height / (1 + 2 * kLabelBand),
                  layout.slot_height - 2 * least_band});
    layout.label_band = std::max(least_band, kLabelBand * layout.side);
    if (layout.side > best.side) best = layout;
  }
  return best;
}

struct Cell {
  int row = 0;
  int column = 0;
  bool operator==(const Cell& other) const { return row == other.row && column == other.column; }
  bool operator<(const Cell& other) const {
    return row != other.row ? row < other.row : column < other.column;
  }
};

bool isLandmark(const GridGeometry& grid, int row, int column) {
  return row == grid.task.landmark_row && column == grid.task.landmark_column;
}

/// One grid with what is known of one policy.
struct GridPicture {
  const GridGeometry& grid;
  const PolicyView& view;
  int policy;
  std::string frame;
  int id;
  const Layout& layout;
  double side = layout.side;

  double cell() const { return side / grid.task.size; }
  Point centre(const Cell& c) const { return {(c.column + 0.5) * cell(), -(c.row + 0.5) * cell()}; }
  /// Sizes of symbols: shares of a cell, but never too small to see.
  double symbol(double share) const { return share * std::max(cell(), side / 14); }
};

struct ValueRange {
  double low = INFINITY;
  double high = -INFINITY;
};

void extend(ValueRange& range, const PolicyView& view) {
  if (!view.episode) return;
  for (const double value : view.episode->state_values) {
    if (!std::isfinite(value)) continue;
    range.low = std::min(range.low, value);
    range.high = std::max(range.high, value);
  }
}

/// Mean value over a block of cells, NaN if none of them has one.
double blockValue(const GridPicture& picture, int row, int column, int block) {
  if (!picture.view.episode || picture.view.episode->state_values.empty()) return NAN;
  double sum = 0;
  int count = 0;
  const int size = picture.grid.task.size;
  for (int r = row; r < std::min(row + block, size); ++r) {
    for (int c = column; c < std::min(column + block, size); ++c) {
      const double value = picture.view.episode->state_values[r * picture.grid.stride + c];
      if (!std::isfinite(value) || isLandmark(picture.grid, r, c)) continue;
      sum += value;
      ++count;
    }
  }
  return count == 0 ? NAN : sum / count;
}

Color valueColor(double value, const ValueRange& range) {
  if (!std::isfinite(value)) return kUnknown;
  return viridis(range.high > range.low ? (value - range.low) / (range.high - range.low) : 0.5);
}

Marker drawCells(const GridPicture& picture, const ValueRange& range) {
  const int size = picture.grid.task.size;
  const int block = (size + kMaxTiles - 1) / kMaxTiles;
  const double cell = picture.cell();
  const double inset = size <= kMaxArrows ? 0.003 * picture.side : 0;

  // cells leave a little of the ground free: the grid's lines
  Figure figure(picture.frame, "cells", picture.id, kCellLayer);
  const double border = 0.008 * picture.side;
  figure.rectangle(-border, -picture.side - border, picture.side + border, border,
                   policyColor(picture.policy));
  figure.raise();
  figure.rectangle(0, -picture.side, picture.side, 0, kLine);
  figure.raise();
  for (int row = 0; row < size; row += block) {
    for (int column = 0; column < size; column += block) {
      const Color color = block == 1 && isLandmark(picture.grid, row, column)
                              ? kWhite
                              : valueColor(blockValue(picture, row, column, block), range);
      figure.rectangle(column * cell + inset, -std::min(row + block, size) * cell + inset,
                       std::min(column + block, size) * cell - inset, -row * cell - inset, color);
    }
  }
  return figure.take();
}

/// The cells of an episode, without standing still.
std::vector<Cell> cellsOf(const PolicyView& view) {
  std::vector<Cell> cells;
  if (!view.episode) return cells;
  const std::vector<double>& observations = view.episode->observations;
  for (std::size_t i = 0; i + 1 < observations.size(); i += 2) {
    const Cell cell{static_cast<int>(observations[i]), static_cast<int>(observations[i + 1])};
    if (cells.empty() || !(cells.back() == cell)) cells.push_back(cell);
  }
  return cells;
}

/// Greedy actions: arrows in the cells, and white heads on the path.
Marker drawArrows(const GridPicture& picture, const ValueRange& range) {
  constexpr double kAngles[] = {kPi / 2, -kPi / 2, kPi, 0};  // up, down, left, right
  Figure figure(picture.frame, "arrows", picture.id, kArrowLayer);
  const int size = picture.grid.task.size;
  const bool known = picture.view.episode && !picture.view.episode->greedy_actions.empty();
  if (!known || size > kMaxArrows) return figure.take();
  const std::vector<Cell> path = cellsOf(picture.view);
  const std::set<Cell> visited(path.begin(), path.end());
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      const int action = picture.view.episode->greedy_actions[row * picture.grid.stride + column];
      if (action < 0 || isLandmark(picture.grid, row, column)) continue;
      const Point centre = picture.centre({row, column});
      if (visited.count({row, column}) != 0) {
        figure.moveTo(kHeadLayer);
        figure.head(centre, 0.17 * picture.cell(), kAngles[action], kWhite);
        continue;
      }
      const Color ground = valueColor(blockValue(picture, row, column, 1), range);
      const Color color = mix(ground, luminance(ground) > 0.5 ? kInk : kWhite, 0.75);
      figure.moveTo(kArrowLayer);
      figure.arrow(centre, 0.55 * picture.cell(), kAngles[action], color);
    }
  }
  return figure.take();
}

Marker drawPath(const GridPicture& picture) {
  Figure figure(picture.frame, "paths", picture.id, kPathLayer);
  // each edge once: a policy that runs in circles does not make a longer message
  const std::vector<Cell> cells = cellsOf(picture.view);
  std::set<std::pair<Cell, Cell>> edges;
  for (std::size_t i = 0; i + 1 < cells.size(); ++i) {
    edges.insert(std::minmax(cells[i], cells[i + 1]));
  }
  const std::set<Cell> joints(cells.begin(), cells.end());

  // a white rim sets the line off from any colour of cell
  const std::pair<double, Color> strokes[] = {{picture.symbol(0.36), kWhite},
                                              {picture.symbol(0.24), policyColor(picture.policy)}};
  for (const auto& [width, color] : strokes) {
    for (const auto& [from, to] : edges) {
      figure.segment(picture.centre(from), picture.centre(to), width, color);
    }
    for (const Cell& joint : joints) figure.disc(picture.centre(joint), width / 2, color);
    figure.raise();
  }
  return figure.take();
}

void drawStartSymbol(Figure& figure, const Point& at, double radius, const Color& color) {
  figure.disc(at, radius, kWhite);
  figure.raise();
  figure.disc(at, 0.8 * radius, color);
  figure.raise();
  figure.disc(at, 0.4 * radius, kWhite);
  figure.raise();
}

void drawEndSymbol(Figure& figure, const Point& at, double radius, const Color& color) {
  figure.cross(at, 1.15 * radius, 0.6 * radius, kWhite);
  figure.raise();
  figure.cross(at, radius, 0.35 * radius, color);
  figure.raise();
}

void drawLandmarkSymbol(Figure& figure, const Point& at, double radius) {
  figure.star(at, radius, kInk);
  figure.raise();
  figure.star(at, 0.72 * radius, kGold);
  figure.raise();
}

Marker drawLandmark(const GridPicture& picture) {
  Figure figure(picture.frame, "landmarks", picture.id, kSymbolLayer);
  const Cell landmark{picture.grid.task.landmark_row, picture.grid.task.landmark_column};
  drawLandmarkSymbol(figure, picture.centre(landmark), picture.symbol(0.46));
  return figure.take();
}

Marker drawEnds(const GridPicture& picture) {
  Figure figure(picture.frame, "ends", picture.id, kSymbolLayer);
  const std::vector<Cell> cells = cellsOf(picture.view);
  if (cells.empty()) return figure.take();
  const Color color = policyColor(picture.policy);
  drawStartSymbol(figure, picture.centre(cells.front()), picture.symbol(0.34), color);
  if (picture.view.episode->truncated) {
    drawEndSymbol(figure, picture.centre(cells.back()), picture.symbol(0.36), color);
  }
  return figure.take();
}

/// Name and policy above the grid, round and return below it.
void drawLabels(const GridPicture& picture, const std::string& below, MarkerArray& scene) {
  const bool is_meta = picture.policy == Trajectory::META;
  const std::string above = picture.grid.name + (is_meta ? " meta (MP)" : " personal (PP)");
  const double middle = picture.side / 2;
  const double band = picture.layout.label_band;
  const double height = kLetterShare * band;
  const double width = 0.95 * picture.layout.slot_width;
  scene.markers.push_back(textMarker(picture.frame, "labels", picture.id, {middle, band / 2},
                                     kTextLayer, above, height, width,
                                     policyColor(picture.policy)));
  scene.markers.push_back(textMarker(picture.frame, "returns", picture.id,
                                     {middle, -picture.side - band / 2}, kTextLayer, below, height,
                                     width, kInk));
}

void drawTask(const GridGeometry& grid, int task, const Layout& layout, const SceneContent& content,
              MarkerArray& scene) {
  const TaskView& views = content.tasks.at(task);
  // one scale for both policies, so that their colours can be compared
  ValueRange range;
  extend(range, views.personal);
  extend(range, views.meta);
  for (const int policy : {Trajectory::PERSONAL, Trajectory::META}) {
    const bool is_meta = policy == Trajectory::META;
    const PolicyView& view = is_meta ? views.meta : views.personal;
    const GridPicture picture{grid,  view, policy, policyFrame(task, policy), 2 * task + is_meta,
                              layout};
    scene.markers.push_back(drawCells(picture, range));
    scene.markers.push_back(drawArrows(picture, range));
    scene.markers.push_back(drawPath(picture));
    scene.markers.push_back(drawLandmark(picture));
    scene.markers.push_back(drawEnds(picture));
    const bool plays = view.episode && (content.has_meta || !is_meta);
    const bool lost = plays && view.episode->truncated;
    drawLabels(picture, resultText(view, content, is_meta) + (lost ? ", landmark not reached" : ""),
               scene);
  }
}

/// What the symbols mean, along the lower edge.
void drawSymbols(MarkerArray& scene) {
  const double y = -kSceneHeight / 2 + kLegendHeight / 2;
  const double r = 0.11;
  Figure figure(kWorldFrame, "legend", 0, kSymbolLayer);
  constexpr int kSteps = 32;
  const double bar_left = -3.67;
  const double bar_step = 1.6 / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    figure.rectangle(bar_left + i * bar_step, y - 0.08, bar_left + (i + 1) * bar_step, y + 0.08,
                     viridis((i + 0.5) / kSteps));
  }
  figure.arrow({-0.67, y}, 0.3, 0, kInk);
  drawStartSymbol(figure, {1.01, y}, r, kInk);
  drawLandmarkSymbol(figure, {2.15, y}, 1.4 * r);
  drawEndSymbol(figure, {3.48, y}, r, kInk);
  scene.markers.push_back(figure.take());

  const std::pair<double, const char*> texts[] = {{-4.12, "low value"},    {-1.59, "high value"},
                                                  {0.04, "greedy action"}, {1.41, "start"},
                                                  {2.67, "landmark"},      {4.06, "out of time"}};
  int id = 1;
  for (const auto& [x, text] : texts) {
    scene.markers.push_back(
        textMarker(kWorldFrame, "legend", id++, {x, y}, kTextLayer, text, 0.17, 2, kFaint));
  }
}

}  // namespace

double gridSide(int num_tasks) { return layoutGrids(num_tasks).side; }

std::vector<geometry_msgs::TransformStamped> gridFrames(int num_tasks) {
  const Layout layout = layoutGrids(num_tasks);
  std::vector<geometry_msgs::TransformStamped> frames;
  for (int task = 0; task < num_tasks; ++task) {
    const int row = task / layout.columns;
    const int in_row = std::min(layout.columns, num_tasks - row * layout.columns);
    const double middle = (task % layout.columns - (in_row - 1) / 2.0) * layout.slot_width;
    for (const int policy : {Trajectory::PERSONAL, Trajectory::META}) {
      const int slot = 2 * row + (policy == Trajectory::META);
      geometry_msgs::TransformStamped frame;
      frame.header.frame_id = kWorldFrame;
      frame.child_frame_id = policyFrame(task, policy);
      frame.transform.translation.x = middle - layout.side / 2;
      frame.transform.translation.y =
          kSceneHeight / 2 - kTitleHeight - (slot + 0.5) * layout.slot_height + layout.side / 2;
      frame.transform.rotation.w = 1;
      frames.push_back(frame);
    }
  }
  return frames;
}

MarkerArray gridworldScene(const std::vector<GridGeometry>& grids, const SceneContent& content) {
  MarkerArray scene;
  const Layout layout = layoutGrids(static_cast<int>(grids.size()));
  for (std::size_t task = 0; task < grids.size(); ++task) {
    drawTask(grids[task], static_cast<int>(task), layout, content, scene);
  }
  drawTitle(content, scene);
  drawSymbols(scene);
  return scene;
}

GridworldScene::GridworldScene(const pmeta::GridworldFamily& family, int num_tasks) {
  for (int task = 0; task < num_tasks; ++task) {
    grids_.push_back({family.task(task), family.stride(), family.taskName(task)});
  }
}

std::vector<geometry_msgs::TransformStamped> GridworldScene::frames() const {
  return gridFrames(static_cast<int>(grids_.size()));
}

std::string GridworldScene::problem(const Trajectory& trajectory) const {
  return trajectoryProblem(trajectory, grids_.at(trajectory.task));
}

MarkerArray GridworldScene::still(const SceneContent& content) const {
  return gridworldScene(grids_, content);
}

}  // namespace pmeta_nodes
