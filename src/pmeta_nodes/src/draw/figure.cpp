#include "pmeta_nodes/figure.h"

#include <algorithm>

namespace pmeta_nodes {

using visualization_msgs::Marker;

Color rgb(unsigned hex) {
  Color color;
  color.r = static_cast<float>((hex >> 16 & 255) / 255.0);
  color.g = static_cast<float>((hex >> 8 & 255) / 255.0);
  color.b = static_cast<float>((hex & 255) / 255.0);
  color.a = 1;
  return color;
}

Color mix(const Color& from, const Color& to, double share) {
  const auto s = static_cast<float>(share);
  Color color;
  color.r = from.r + s * (to.r - from.r);
  color.g = from.g + s * (to.g - from.g);
  color.b = from.b + s * (to.b - from.b);
  color.a = 1;
  return color;
}

Color viridis(double x) {
  static const Color kAnchors[] = {rgb(0x440154), rgb(0x472d7b), rgb(0x3b528b),
                                   rgb(0x2c728e), rgb(0x21918c), rgb(0x28ae80),
                                   rgb(0x5ec962), rgb(0xaddc30), rgb(0xfde725)};
  const double at = std::clamp(x, 0.0, 1.0) * 8;
  const int i = std::min(static_cast<int>(at), 7);
  return mix(kAnchors[i], kAnchors[i + 1], at - i);
}

double luminance(const Color& c) { return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b; }

Marker makeMarker(const std::string& frame, const std::string& ns, int id) {
  Marker marker;
  marker.header.frame_id = frame;
  marker.ns = ns;
  marker.id = id;
  marker.pose.orientation.w = 1;
  return marker;
}

Marker textMarker(const std::string& frame, const std::string& ns, int id, const Point& at,
                  double layer, const std::string& text, double height, double width,
                  const Color& color) {
  Marker marker = makeMarker(frame, ns, id);
  marker.type = Marker::TEXT_VIEW_FACING;
  marker.action = text.empty() ? Marker::DELETE : Marker::ADD;
  marker.pose.position.x = at.x;
  marker.pose.position.y = at.y;
  marker.pose.position.z = layer;
  marker.scale.z = std::min(height, width / (kLetterWidth * std::max<std::size_t>(text.size(), 1)));
  marker.color = color;
  marker.text = text;
  return marker;
}

}  // namespace pmeta_nodes
