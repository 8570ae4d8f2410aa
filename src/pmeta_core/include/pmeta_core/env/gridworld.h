#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/tabular_env.h"

namespace pmeta {

/// What sets one gridworld apart.
struct GridworldTask {
  int size = 4;             ///< cells along each side
  int landmark_row = 3;     ///< from 0, the upper edge
  int landmark_column = 3;  ///< from 0, the left edge
  double slip = 0;  ///< probability that a move goes in a uniformly random direction instead
};

/// Square grid of the paper's warm-up: reach the landmark, reward minus the Manhattan distance.
///
/// Four moves (up, down, left, right); a wall leaves the agent in place. The reward is minus the
/// distance to the landmark after the move; the landmark is terminal. Episodes start in a uniformly
/// drawn cell other than the landmark and are truncated after 4 * size steps. Observation: row,
/// column.
class Gridworld : public TabularEnv {
 public:
  /// `stride`: cells along each side of the largest grid; cell (r, c) is state r * stride + c.
  Gridworld(const GridworldTask& task, int stride);

  /// Row and column, and the four moves by name.
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;
  std::vector<double> state() const override;  ///< index of the cell, steps
  void setState(const std::vector<double>& state) override;

  int numStates() const override { return stride_ * stride_; }
  const std::vector<int>& ownedStates() const override { return owned_states_; }
  /// One outcome, or with slip one for each of the four moves; none in a state that is not owned.
  const std::vector<Outcome>& outcomes(int state, int action) const override;
  int stateOf(const double* observation) const override;  ///< row * stride + column

  const GridworldTask& task() const { return task_; }  ///< as given to the constructor

 private:
  void observe(double* observation) const;

  GridworldTask task_;
  int stride_;
  EnvSpec spec_;
  std::vector<int> owned_states_;
  std::vector<std::vector<Outcome>> outcomes_;  ///< by state * 4 + action
  int state_ = 0;
  int steps_ = 0;
};

/// The five grids of the paper (Section "A Warm-Up"): tasks differ in size and landmark.
class GridworldFamily : public EnvFamily {
 public:
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(tasks_.size()); }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

  /// Size, landmark and slip of a task; throws std::out_of_range if there is none.
  const GridworldTask& task(int task) const { return tasks_.at(task); }
  /// Cells along each side of the largest grid, for all tasks.
  int stride() const { return stride_; }

 private:
  std::vector<int> sizes_ = {4, 5, 6, 7, 8};
  std::string landmark_ = "corner";
  std::vector<double> slip_ = {0};
  std::vector<GridworldTask> tasks_;
  int stride_ = 0;
};

}  // namespace pmeta
