#pragma once

#include <boost/make_shared.hpp>

#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/base/settings.h"
#include "pmeta_nodes/scene.h"

namespace pmeta_nodes {
namespace test {

using pmeta_msgs::Trajectory;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

inline pmeta::Experiment experiment(const std::string& text) {
  return pmeta::Experiment::parse(text, "test");
}

/// An episode of these observations, whose actions and rewards are 0.
inline Trajectory episodeOf(int task, int policy, std::size_t observation_size,
                            const std::vector<double>& observations) {
  Trajectory message;
  message.task = static_cast<std::uint32_t>(task);
  message.policy = static_cast<std::uint8_t>(policy);
  message.round = 3;
  message.observation_size = static_cast<std::uint32_t>(observation_size);
  message.observations = observations;
  const std::size_t steps = observations.size() / observation_size - 1;
  message.action_size = 1;
  message.actions.assign(steps, 0);
  message.rewards.assign(steps, 0);
  message.truncated = true;
  return message;
}

inline Trajectory::ConstPtr shared(const Trajectory& message) {
  return boost::make_shared<Trajectory>(message);
}

inline SceneContent contentOf(int tasks) {
  SceneContent content;
  content.experiment = "test";
  content.rounds = 10;
  content.tasks.resize(tasks);
  return content;
}

inline Marker find(const MarkerArray& scene, const std::string& ns, int id) {
  for (const Marker& marker : scene.markers) {
    if (marker.ns == ns && marker.id == id) return marker;
  }
  throw std::out_of_range(ns + " " + std::to_string(id));
}

inline std::set<std::pair<std::string, int>> names(const MarkerArray& scene) {
  std::set<std::pair<std::string, int>> names;
  for (const Marker& marker : scene.markers) names.insert({marker.ns, marker.id});
  return names;
}

/// What is wrong with the markers, in rviz's eyes; "" if nothing is: names that two markers share,
/// frames that the scene does not have, shapes that rviz refuses.
inline std::string complaint(const Scene& scene, const MarkerArray& markers) {
  std::set<std::string> frames = {kWorldFrame};
  for (const auto& frame : scene.frames()) {
    if (frames.count(frame.header.frame_id) == 0) return frame.child_frame_id + " has no parent";
    if (!frames.insert(frame.child_frame_id).second)
      return frame.child_frame_id + " is there twice";
  }
  if (names(markers).size() != markers.markers.size()) return "two markers share a name";
  for (const Marker& marker : markers.markers) {
    const std::string name = marker.ns + " " + std::to_string(marker.id);
    if (frames.count(marker.header.frame_id) == 0) return name + " is in no frame of the scene";
    const auto& q = marker.pose.orientation;
    const double norm = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
    if (!(norm > 0.999 && norm < 1.001)) return name + " has no orientation";
    if (marker.action == Marker::DELETE) continue;
    if (!(marker.color.a > 0) || !(marker.scale.z > 0 || marker.type == Marker::LINE_STRIP ||
                                   marker.type == Marker::POINTS)) {
      return name + " has no colour or size";
    }
    if (marker.type == Marker::TEXT_VIEW_FACING && marker.text.empty()) return name + " is empty";
    if (marker.type == Marker::TRIANGLE_LIST &&
        (marker.points.size() % 3 != 0 || marker.points.size() != marker.colors.size())) {
      return name + " has half a triangle";
    }
  }
  return "";
}

/// The transform below its parent of that frame.
inline geometry_msgs::Vector3 shiftOf(const Scene& scene, const std::string& frame) {
  for (const auto& transform : scene.frames()) {
    if (transform.child_frame_id == frame) return transform.transform.translation;
  }
  throw std::out_of_range(frame);
}

/// All numbers that a message carries: its length.
inline std::size_t lengthOf(const MarkerArray& markers) {
  std::size_t length = 0;
  for (const Marker& marker : markers.markers) length += 1 + marker.points.size();
  return length;
}

}  // namespace test
}  // namespace pmeta_nodes
