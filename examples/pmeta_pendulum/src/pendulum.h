#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta_pendulum {

constexpr char kName[] = "pmeta_pendulum/Pendulum";  ///< as pmeta_plugins.xml has it
constexpr double kTimeStep = 0.05;                   ///< s

/// A rod that hangs from a motor, which is too weak to lift it at once.
class Pendulum : public pmeta::Env {
 public:
  /// `length`: of the rod, m.
  explicit Pendulum(double length);

  const pmeta::EnvSpec& spec() const override { return spec_; }
  void reset(pmeta::Rng& rng, double* observation) override;
  pmeta::Step step(const double* action, pmeta::Rng& rng, double* observation) override;

  /// Angle and speed, and the steps since the reset: what a checkpoint needs.
  std::vector<double> state() const override;
  void setState(const std::vector<double>& state) override;

 private:
  void observe(double* observation) const;

  double length_;
  pmeta::EnvSpec spec_;
  double angle_ = 0;  // rad, 0 is up
  double speed_ = 0;  // rad/s
  int steps_ = 0;
};

/// A task for each length.
class PendulumFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(lengths_.size()); }
  int numTestTasks() const override { return static_cast<int>(test_lengths_.size()); }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;

  double length(int task) const;  ///< of a training or test task, m
  double longest() const;         ///< of all tasks, m

 private:
  std::unique_ptr<pmeta::Env> create(int task) const override;

  std::vector<double> lengths_ = {0.8, 1, 1.2};
  std::vector<double> test_lengths_;
};

}  // namespace pmeta_pendulum
