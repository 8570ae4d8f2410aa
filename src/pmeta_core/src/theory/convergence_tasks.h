#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/env/tabular_env.h"
#include "pmeta_core/learn/tabular.h"
#include "pmeta_core/theory/convergence.h"

namespace pmeta {

/// A task with a known model, on the table that all tasks share. Entries it does not own are 0.
class KnownTask {
 public:
  KnownTask(std::unique_ptr<TabularEnv> env, double gamma);

  const TabularEnv& env() const { return *env_; }
  const std::vector<std::size_t>& entries() const { return entries_; }  ///< owned, ascending
  std::size_t tableSize() const { return table_size_; }

  /// r + gamma E max Q on owned entries.
  void backup(const QTable& q, QTable& out) const;

  /// B^Q = (lambda anchor + r + gamma E max Q) / (1 + lambda) on owned entries.
  void regularisedBackup(const QTable& q, const QTable& anchor, double lambda, QTable& out) const;

  /// Moves q to the fixed point of B^ by applying B^ until nothing moves: fast from a good start.
  void iterateToFixedPoint(const QTable& anchor, double lambda, QTable& q) const;

  /// The fixed point of B^ by policy iteration: each policy's values solve
  /// (1 + lambda) V - gamma P V = lambda anchor + r.
  QTable solveFixedPoint(const QTable& anchor, double lambda) const;

  /// max |a - b| over owned entries.
  double distance(const QTable& a, const QTable& b) const;

  /// A zero table whose owned entries are marked as present.
  Model emptyModel() const;

  /// A random table, normal with this deviation on owned entries.
  QTable randomTable(double deviation, Rng& rng) const;

 private:
  std::unique_ptr<TabularEnv> env_;
  double gamma_;
  std::size_t table_size_;
  std::vector<std::size_t> entries_;
};

/// The tasks of one diversity, and how far they differ.
struct KnownTasks {
  std::vector<KnownTask> tasks;
  DiversityRow diversity;
};

/// Builds the tasks of a diversity; `slip` overrides the settings' unless it is empty.
KnownTasks makeKnownTasks(const ConvergenceSettings& settings, const std::string& diversity,
                          std::vector<double> slip = {});

}  // namespace pmeta
