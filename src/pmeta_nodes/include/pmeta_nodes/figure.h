#pragma once

#include <std_msgs/ColorRGBA.h>
#include <visualization_msgs/Marker.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace pmeta_nodes {

using Color = std_msgs::ColorRGBA;  ///< r, g, b and opacity, 0 to 1

constexpr double kPi = 3.14159265358979323846;  ///< a half turn, rad

/// Width of a letter, in heights, on average.
constexpr double kLetterWidth = 0.46;

/// 0xrrggbb, opaque.
Color rgb(unsigned hex);

/// `from` at share 0, `to` at share 1.
Color mix(const Color& from, const Color& to, double share);

/// Viridis (van der Walt and Smith), 0 to 1: lightness rises evenly, also for colour-blind eyes.
Color viridis(double x);

/// Relative luminance, 0 to 1: dark ink reads on light colours only.
double luminance(const Color& color);

/// A place in the frame's plane.
struct Point {
  double x = 0;  ///< to the right, in units of the frame
  double y = 0;  ///< upwards
};

/// A marker of that place and identity, all else as rviz needs it.
visualization_msgs::Marker makeMarker(const std::string& frame, const std::string& ns, int id);

/// Text centred at `at`, made smaller if it is wider than `width`; "" deletes it.
visualization_msgs::Marker textMarker(const std::string& frame, const std::string& ns, int id,
                                      const Point& at, double layer, const std::string& text,
                                      double height, double width, const Color& color);

/// Flat figures as one marker of coloured triangles, which rviz draws without shading.
class Figure {
 public:
  /// `layer`: height above the frame's plane, on which what lies higher is seen.
  Figure(const std::string& frame, const std::string& ns, int id, double layer)
      : marker_(makeMarker(frame, ns, id)), z_(layer) {
    marker_.type = visualization_msgs::Marker::TRIANGLE_LIST;
    marker_.scale.x = marker_.scale.y = marker_.scale.z = 1;
    marker_.color = rgb(0xffffff);
  }

  /// What follows is drawn above what was drawn so far.
  void raise() { z_ += 0.01; }
  void moveTo(double layer) { z_ = layer; }  ///< what follows is drawn at that height

  /// A polygon all of whose corners can be seen from `centre`.
  void polygon(const Point& centre, const std::vector<Point>& corners, const Color& color) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      triangle(centre, corners[i], corners[(i + 1) % corners.size()], color);
    }
  }

  /// Edges by their places, left < right and bottom < top.
  void rectangle(double left, double bottom, double right, double top, const Color& color) {
    triangle({left, bottom}, {right, bottom}, {right, top}, color);
    triangle({left, bottom}, {right, top}, {left, top}, color);
  }

  /// Of 20 corners.
  void disc(const Point& centre, double radius, const Color& color) {
    sector(centre, radius, 0, 2 * kPi, color);
  }

  /// The part of a disc from angle `from` to angle `to`.
  void sector(const Point& centre, double radius, double from, double to, const Color& color) {
    constexpr int kCorners = 20;
    Point before = polar(centre, radius, from);
    for (int i = 1; i <= kCorners; ++i) {
      const Point next = polar(centre, radius, from + (to - from) * i / kCorners);
      triangle(centre, before, next, color);
      before = next;
    }
  }

  /// A circle as a line, which lies inside `radius`.
  void ring(const Point& centre, double radius, double width, const Color& color) {
    constexpr int kCorners = 32;
    for (int i = 0; i < kCorners; ++i) {
      const double from = 2 * kPi * i / kCorners;
      const double to = 2 * kPi * (i + 1) / kCorners;
      const Point inner = polar(centre, radius - width, from);
      const Point outer = polar(centre, radius, to);
      triangle(inner, polar(centre, radius, from), outer, color);
      triangle(inner, outer, polar(centre, radius - width, to), color);
    }
  }

  /// A star of five points, one of them up.
  void star(const Point& centre, double radius, const Color& color) {
    std::vector<Point> rim;
    for (int i = 0; i < 10; ++i) {
      rim.push_back(polar(centre, i % 2 == 0 ? radius : 0.45 * radius, kPi / 2 + kPi * i / 5));
    }
    polygon(centre, rim, color);
  }

  /// A line of that width with flat ends; nothing if both ends are one.
  void segment(const Point& from, const Point& to, double width, const Color& color) {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    if (length == 0) return;
    const double dx = -(to.y - from.y) / length * width / 2;
    const double dy = (to.x - from.x) / length * width / 2;
    triangle({from.x + dx, from.y + dy}, {from.x - dx, from.y - dy}, {to.x - dx, to.y - dy}, color);
    triangle({from.x + dx, from.y + dy}, {to.x - dx, to.y - dy}, {to.x + dx, to.y + dy}, color);
  }

  /// Segments from point to point; nothing of fewer than two.
  void polyline(const std::vector<Point>& points, double width, const Color& color) {
    for (std::size_t i = 1; i < points.size(); ++i) {
      segment(points[i - 1], points[i], width, color);
    }
  }

  /// An x.
  void cross(const Point& centre, double radius, double width, const Color& color) {
    for (const double angle : {kPi / 4, 3 * kPi / 4}) {
      segment(polar(centre, radius, angle), polar(centre, -radius, angle), width, color);
    }
  }

  /// An arrow through `centre`, pointing where `angle` says.
  void arrow(const Point& centre, double length, double angle, const Color& color) {
    const Point tip = polar(centre, length / 2, angle);
    const Point neck = polar(centre, 0.02 * length, angle);
    segment(polar(centre, -length / 2, angle), neck, 0.16 * length, color);
    triangle(polar(neck, 0.3 * length, angle + kPi / 2),
             polar(neck, -0.3 * length, angle + kPi / 2), tip, color);
  }

  /// Only the head of an arrow.
  void head(const Point& centre, double length, double angle, const Color& color) {
    const Point foot = polar(centre, -length / 2, angle);
    triangle(polar(foot, length / 2, angle + kPi / 2), polar(foot, -length / 2, angle + kPi / 2),
             polar(centre, length / 2, angle), color);
  }

  /// Places the figure's origin at `at` of its frame, turned by `angle`.
  void place(const Point& at, double angle) {
    marker_.pose.position.x = at.x;
    marker_.pose.position.y = at.y;
    marker_.pose.orientation.z = std::sin(angle / 2);
    marker_.pose.orientation.w = std::cos(angle / 2);
  }

  /// An empty figure deletes what stood in its place.
  visualization_msgs::Marker take() {
    marker_.action = marker_.points.empty() ? visualization_msgs::Marker::DELETE
                                            : visualization_msgs::Marker::ADD;
    return std::move(marker_);
  }

 private:
  static Point polar(const Point& centre, double radius, double angle) {
    return {centre.x + radius * std::cos(angle), centre.y + radius * std::sin(angle)};
  }

  void triangle(const Point& a, const Point& b, const Point& c, const Color& color) {
    for (const Point& corner : {a, b, c}) {
      geometry_msgs::Point point;
      point.x = corner.x;
      point.y = corner.y;
      point.z = z_;
      marker_.points.push_back(point);
      marker_.colors.push_back(color);
    }
  }

  visualization_msgs::Marker marker_;
  double z_;
};

}  // namespace pmeta_nodes
