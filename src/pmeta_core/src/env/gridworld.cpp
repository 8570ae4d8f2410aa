#include "pmeta_core/env/gridworld.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/task_values.h"

namespace pmeta {
namespace {

const RegisteredFamily<GridworldFamily> kGridworld("gridworld");

constexpr int kNumMoves = 4;
constexpr int kRowStep[kNumMoves] = {-1, 1, 0, 0};  // up, down, left, right
constexpr int kColumnStep[kNumMoves] = {0, 0, -1, 1};
constexpr int kHorizonPerSide = 4;

EnvSpec gridworldSpec(int size) {
  const double last = size - 1;
  EnvSpec spec = describedSpec("gridworld", kHorizonPerSide * size,
                               {{"row", "cells", 0, last}, {"column", "cells", 0, last}},
                               {{"move", "", 0, kNumMoves - 1}}, {"up", "down", "left", "right"});
  spec.restorable = true;
  return spec;
}

}  // namespace

Gridworld::Gridworld(const GridworldTask& task, int stride)
    : task_(task), stride_(stride), spec_(gridworldSpec(task.size)) {
  outcomes_.resize(static_cast<std::size_t>(numStates()) * kNumMoves);
  for (int row = 0; row < task.size; ++row) {
    for (int column = 0; column < task.size; ++column) {
      if (row == task.landmark_row && column == task.landmark_column) continue;
      const int state = row * stride + column;
      owned_states_.push_back(state);

      Outcome moved[kNumMoves];
      for (int move = 0; move < kNumMoves; ++move) {
        const int r = std::clamp(row + kRowStep[move], 0, task.size - 1);
        const int c = std::clamp(column + kColumnStep[move], 0, task.size - 1);
        const int distance = std::abs(r - task.landmark_row) + std::abs(c - task.landmark_column);
        moved[move] = {r * stride + c, 1.0, static_cast<double>(-distance), distance == 0};
      }
      for (int action = 0; action < kNumMoves; ++action) {
        std::vector<Outcome>& list = outcomes_[state * kNumMoves + action];
        if (task.slip == 0) {
          list = {moved[action]};
          continue;
        }
        for (int move = 0; move < kNumMoves; ++move) {
          Outcome outcome = moved[move];
          outcome.probability = task.slip / kNumMoves + (move == action ? 1 - task.slip : 0);
          list.push_back(outcome);
        }
      }
    }
  }
}

void Gridworld::reset(Rng& rng, double* observation) {
  state_ = owned_states_[rng.below(owned_states_.size())];
  steps_ = 0;
  observe(observation);
}

Step Gridworld::step(const double* action, Rng& rng, double* observation) {
  const Outcome& outcome = sample(state_, static_cast<int>(action[0]), rng);
  state_ = outcome.next_state;
  ++steps_;
  observe(observation);
  return {outcome.reward, outcome.terminated, !outcome.terminated && steps_ >= spec_.horizon};
}

std::vector<double> Gridworld::state() const {
  return {static_cast<double>(state_), static_cast<double>(steps_)};
}

void Gridworld::setState(const std::vector<double>& state) {
  requireState(spec_, state, 2);
  const double cell = state[0];
  if (cell != std::floor(cell) || cell < 0 || cell >= numStates() ||
      static_cast<int>(cell) / stride_ >= task_.size ||
      static_cast<int>(cell) % stride_ >= task_.size) {
    throw Error("a state of gridworld is in cell " + formatNumber(cell) +
                ", which the grid does not have.");
  }
  state_ = static_cast<int>(cell);
  steps_ = static_cast<int>(state[1]);
}

const std::vector<Outcome>& Gridworld::outcomes(int state, int action) const {
  return outcomes_[static_cast<std::size_t>(state) * kNumMoves + action];
}

int Gridworld::stateOf(const double* observation) const {
  return static_cast<int>(observation[0]) * stride_ + static_cast<int>(observation[1]);
}

void Gridworld::observe(double* observation) const {
  observation[0] = state_ / stride_;
  observation[1] = state_ % stride_;
}

void GridworldFamily::bind(Settings& settings) {
  settings.bind("environment.sizes", sizes_, "cells along each side, one task each",
                Range::between(2, 512));
  settings.bind("environment.landmark", landmark_,
                "where the landmark lies: corner (tasks agree), centre or random (tasks conflict)",
                {"corner", "centre", "random"});
  settings.bind("environment.slip", slip_,
                "probability of a random move; one number, or one for each task",
                Range::halfOpen(0, 1));
}

void GridworldFamily::build(std::uint64_t seed) {
  requireTaskValues("environment.slip", slip_, sizes_.size());
  tasks_.clear();
  stride_ = *std::max_element(sizes_.begin(), sizes_.end());
  for (std::size_t i = 0; i < sizes_.size(); ++i) {
    GridworldTask task;
    task.size = sizes_[i];
    task.slip = taskValue(slip_, i);
    if (landmark_ == "corner") {
      task.landmark_row = task.landmark_column = task.size - 1;
    } else if (landmark_ == "centre") {
      task.landmark_row = task.landmark_column = task.size / 2;
    } else {
      Rng rng(seed, i, Stream::kTaskDraw);
      task.landmark_row = static_cast<int>(rng.below(task.size));
      task.landmark_column = static_cast<int>(rng.below(task.size));
    }
    tasks_.push_back(task);
  }
}

std::string GridworldFamily::taskName(int task) const {
  const std::string side = std::to_string(tasks_.at(task).size);
  return "grid_" + side + "x" + side;
}

std::string GridworldFamily::taskDescription(int task) const {
  const GridworldTask& t = tasks_.at(task);
  std::string text = std::to_string(t.size) + "x" + std::to_string(t.size) +
                     " cells, landmark at row " + std::to_string(t.landmark_row) + ", column " +
                     std::to_string(t.landmark_column);
  if (t.slip > 0) text += ", slip " + formatNumber(t.slip);
  return text;
}

std::unique_ptr<Env> GridworldFamily::create(int task) const {
  return std::make_unique<Gridworld>(tasks_.at(task), stride_);
}

}  // namespace pmeta
