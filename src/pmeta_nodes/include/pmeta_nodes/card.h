#pragma once

#include <string>
#include <vector>

#include "pmeta_nodes/scene_parts.h"

namespace pmeta_nodes {

/// Cards for all tasks, side by side between a scene's title and legend: each has a header with the
/// task's name, and below it one lane for both policies, or a lane for each.
///
/// A card's frame "task_I" has its origin in the middle of the card.
struct Cards {
  int num_tasks = 0;       ///< cards, test tasks included
  int num_train = 0;       ///< tasks from there on are test tasks, which have no personal policy
  int columns = 1;         ///< cards side by side
  int lanes = 2;           ///< on a card: 1 or 2
  bool beside = false;     ///< are two lanes side by side, personal on the left? Else it is above
  double slot_width = 0;   ///< of a card with the gap around it
  double slot_height = 0;  ///< of a card with the gap around it
  double letter = 0;       ///< height of letters
  double lane_width = 0;   ///< where content may be drawn
  double lane_height = 0;  ///< without its label
  double scale = 0;        ///< units of the scene for a unit of the lane's content

  bool isTest(int task) const { return task >= num_train; }  ///< has the task a meta-policy alone?
  double width() const;                                      ///< of a card
  double height() const;                                     ///< of a card

  /// The middle of a lane's lower edge on its card.
  Point laneBottom(int task, int policy) const;
};

/// The arrangement in which content of that size is drawn largest in every lane.
Cards layoutCards(int num_tasks, int num_train, int lanes, double content_width,
                  double content_height);

/// "task_I"
std::string taskFrame(int task);

/// Frames "task_I" in the world frame.
std::vector<geometry_msgs::TransformStamped> cardFrames(const Cards& cards);

/// The policies whose lanes a card has: a test task has only meta's.
std::vector<int> policiesOf(const Cards& cards, int task);

/// Grounds, names and descriptions of all tasks, and what is known of each policy (namespaces
/// "cards", "names", "descriptions", "results").
void drawCards(const Cards& cards, const pmeta::EnvFamily& family, const SceneContent& content,
               visualization_msgs::MarkerArray& scene);

/// The namespace's marker of a task and policy, or its deletion: `draw` fills it.
template <class Draw>
visualization_msgs::Marker policyMarker(const std::string& frame, const std::string& ns, int task,
                                        int policy, double layer, bool shown, Draw&& draw) {
  Figure figure(frame, ns, policyId(task, policy), layer);
  if (shown) draw(figure);
  return figure.take();
}

/// A policy's path over its card (namespace "paths"), or its deletion where there is no episode:
/// `at` gives the point of a step. Meta's line is wider and lies below, so that both are seen where
/// they agree.
template <class At>
visualization_msgs::Marker pathMarker(const std::string& frame, int task, int policy, double layer,
                                      const PolicyView& view, std::size_t most_points,
                                      double meta_width, double personal_width, At&& at) {
  const bool is_meta = policy == pmeta_msgs::Trajectory::META;
  return policyMarker(
      frame, "paths", task, policy, layer + (is_meta ? 0 : 0.02), view.episode != nullptr,
      [&](Figure& figure) {
        std::vector<Point> path;
        for (const std::size_t step : thinnedSteps(numSteps(*view.episode), most_points)) {
          path.push_back(at(step));
        }
        figure.polyline(path, is_meta ? meta_width : personal_width,
                        mix(policyColor(policy), kWhite, is_meta ? 0.35 : 0.1));
      });
}

/// draw(view, task, policy, seconds) for each lane; `seconds` by task.
template <class Draw>
void forEachLane(const Cards& cards, const SceneContent& content,
                 const std::vector<double>& seconds, Draw&& draw) {
  for (int task = 0; task < cards.num_tasks; ++task) {
    for (const int policy : policiesOf(cards, task)) {
      draw(viewOf(content, task, policy), task, policy, seconds.at(task));
    }
  }
}

/// A scene of cards in whose lanes episodes are played, each as drawMoving() has it.
class LaneScene : public Scene {
 public:
  visualization_msgs::MarkerArray moving(const SceneContent& content,
                                         const std::vector<double>& seconds) final {
    visualization_msgs::MarkerArray scene;
    forEachLane(cards_, content, seconds,
                [&](const PolicyView& view, int task, int policy, double at) {
                  drawMoving(view, task, policy, at, scene);
                });
    return scene;
  }

  double scale() const { return cards_.scale; }  ///< units of the scene for 1 of its content's

 protected:
  /// `cards`: as layoutCards() gives them.
  explicit LaneScene(const Cards& cards) : cards_(cards) {}

  const Cards cards_;  ///< where lanes are

 private:
  /// One lane, so many seconds after the episode's start.
  virtual void drawMoving(const PolicyView& view, int task, int policy, double seconds,
                          visualization_msgs::MarkerArray& scene) const = 0;
};

}  // namespace pmeta_nodes
