#pragma once

#include <limits>
#include <string>
#include <vector>

#include "pmeta_core/env/env_spec.h"
#include "pmeta_nodes/card.h"

namespace pmeta_nodes {

/// Any environment, where nothing is known of how it looks: on each task's card the traces of
/// observations, actions and rewards over the episode, both policies in one plot, with a dot that
/// plays the episode.
///
/// A trace is named after its number in the environment's EnvSpec. Its scale is the same on all
/// cards and stands beside it: the bounds of an action, of all else the range of what is shown.
/// Where there are more numbers than fit, the first of the observations and of the actions are
/// shown, and the legend says so; the reward always is.
class TraceScene : public Scene {
 public:
  /// `family` must outlive the scene.
  TraceScene(const pmeta::EnvFamily& family, int num_tasks);

  std::vector<geometry_msgs::TransformStamped> frames() const override;
  std::string problem(const pmeta_msgs::Trajectory& trajectory) const override;
  double stepSeconds() const override { return step_seconds_; }
  visualization_msgs::MarkerArray still(const SceneContent& content) const override;
  visualization_msgs::MarkerArray moving(const SceneContent& content,
                                         const std::vector<double>& seconds) override;

 private:
  enum class Source { kObservation, kAction, kReward };
  struct Trace {
    Source source = Source::kReward;
    std::size_t index = 0;  ///< in an observation or action
    std::string name;       ///< with its unit
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
  };
  /// What a trace's values are drawn to, on one card.
  struct Plot {
    double left = 0, bottom = 0, width = 0, height = 0;
  };

  /// What the number is after so many steps: what is then observed, the action taken there (the
  /// last one at the end), the reward of the last step.
  static double valueOf(const Trace& trace, const pmeta_msgs::Trajectory& episode,
                        std::size_t step);

  void arrange(int num_tasks, int num_train);
  void chooseTraces();
  std::vector<Trace> scaledTraces(const SceneContent& content) const;
  Plot plotOf(int task, std::size_t trace) const;
  Point pointAt(const Plot& plot, const Trace& trace, const pmeta_msgs::Trajectory& episode,
                std::size_t step, std::size_t longest) const;
  std::string scaleOf(const Trace& trace) const;
  std::vector<LegendEntry> legend() const;
  void drawPlots(int task, const std::vector<Trace>& traces, std::size_t longest,
                 visualization_msgs::MarkerArray& scene) const;
  void drawTraces(int task, int policy, const std::vector<Trace>& traces, std::size_t longest,
                  const PolicyView& view, visualization_msgs::MarkerArray& scene) const;

  const pmeta::EnvFamily& family_;
  pmeta::EnvSpec spec_;  // of task 0; all have the same sizes
  double step_seconds_ = 0;
  Cards cards_;
  std::size_t columns_ = 1;  // of plots on a card
  std::size_t rows_ = 1;
  double axis_ = 0;         // height of the line of text below the plots
  double pitch_ = 0;        // from one plot to the next below it
  double letter_ = 0;       // height of the names above them
  std::size_t points_ = 0;  // of a trace, at most
  std::vector<Trace> traces_;
};

}  // namespace pmeta_nodes
