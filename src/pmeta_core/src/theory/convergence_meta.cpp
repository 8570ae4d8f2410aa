#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "convergence_measures.h"
#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/personal/proximal_sgd.h"

namespace pmeta {
namespace {

using Eigen::ArrayXd;

// the slope of the running mean leaves out the first rounds
constexpr int kFirstSlopeRound = 10;
constexpr int kAllowedRounds = 10;

const double kNan = std::numeric_limits<double>::quiet_NaN();

double square(double x) { return x * x; }

// meta table, its tasks' solutions Q_i* = argmin at the meta table, and what follows from them;
// grad L_i(Q) = lambda (Q - Q_i*(Q)), and means run over the tasks that own an entry
class MetaIteration {
 public:
  MetaIteration(const std::vector<KnownTask>& tasks, double lambda)
      : tasks_(tasks),
        lambda_(lambda),
        meta_(tasks.front().emptyModel().layout),
        solutions_(tasks.size(), QTable(meta_.size(), 0.0)),
        owners_(ArrayXd::Zero(static_cast<Eigen::Index>(meta_.size()))) {
    for (const KnownTask& task : tasks_) {
      auxiliary_.push_back(task.emptyModel());
      for (const std::size_t k : task.entries()) owners_[k] += 1;
    }
    solve();
  }

  // One round of R exact auxiliary steps a task, then the aggregation, both as in the algorithm.
  void runRound(int updates, double eta, double beta) {
    std::vector<Contribution> contributions;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      QTable& omega = auxiliary_[i].doubles();
      omega = meta_.doubles();
      ProximalSgd<double> step(solutions_[i].data(), omega.data(), omega.size(), 0, lambda_, eta);
      for (int r = 0; r < updates; ++r) {
        tasks_[i].iterateToFixedPoint(omega, lambda_, solutions_[i]);
        step.moveAuxiliary();
      }
      contributions.push_back({&auxiliary_[i], 1});
    }
    mixInto(meta_, contributions, beta);
    solve();
  }

  // grad L(Q) of each entry.
  const ArrayXd& gradient() const { return gradient_; }
  // mean_i |Q_i* - Q|^2 of each entry.
  const ArrayXd& entryDistance2() const { return entry_distance2_; }

  // mean_i ||Q_i* - Q||^2 over tasks.
  double distance2() const {
    return (entry_distance2_ * owners_).sum() / static_cast<double>(tasks_.size());
  }

  // mean_i ||grad L_i||^2, where grad L_i = Q_i* - [r + gamma E max Q_i*] by the fixed point.
  double taskGradientNorm2() const {
    double sum = 0;
    QTable backup(meta_.size(), 0.0);
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      tasks_[i].backup(solutions_[i], backup);
      for (const std::size_t k : tasks_[i].entries()) sum += square(solutions_[i][k] - backup[k]);
    }
    return sum / static_cast<double>(tasks_.size());
  }

 private:
  void solve() {
    gradient_.setZero(owners_.size());
    entry_distance2_.setZero(owners_.size());
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      tasks_[i].iterateToFixedPoint(meta_.doubles(), lambda_, solutions_[i]);
      for (const std::size_t k : tasks_[i].entries()) {
        const double difference = meta_.doubles()[k] - solutions_[i][k];
        gradient_[k] += lambda_ * difference / owners_[k];
        entry_distance2_[k] += difference * difference / owners_[k];
      }
    }
  }

  const std::vector<KnownTask>& tasks_;
  double lambda_;
  Model meta_;
  std::vector<Model> auxiliary_;
  std::vector<QTable> solutions_;
  ArrayXd owners_;
  ArrayXd gradient_;
  ArrayXd entry_distance2_;
};

double usedEta(const ConvergenceSettings& settings, double lambda) {
  return std::min(settings.meta.eta_cap, 1 / lambda);
}

// largest eta with eta_tilde L (3/2 + 12/(lambda^2-8) + 24 lambda^2/(lambda^2-8)) <= 1/4, where
// L = lambda and eta_tilde = eta beta R
double allowedEta(double lambda, int updates, double beta) {
  const double room = lambda * lambda - 8;
  if (room <= 0) return kNan;
  const double factor = 1.5 + 12 / room + 24 * lambda * lambda / room;
  return 0.25 / (factor * lambda * beta * updates);
}

// sigma_2^2 = (2 lambda^2 sigma^2 + 2 lambda^2 gamma / (1 - gamma) R_max) / (lambda^2 - 8)
double sigma2Squared(double lambda, double gamma, const DiversityRow& diversity) {
  const double room = lambda * lambda - 8;
  if (room <= 0) return kNan;
  return 2 * lambda * lambda / room *
         (square(diversity.sigma) + gamma / (1 - gamma) * diversity.r_max);
}

// 2(b) at one (s,a), with delta = 0 since inner problems are solved exactly
ArrayXd entryBounds(const MetaIteration& iteration, double lambda, double sigma2_squared) {
  return 2 / (lambda * lambda - 8) * iteration.gradient().square() +
         2 * sigma2_squared / (lambda * lambda);
}

// how much of its bound the worst entry uses
double worstEntryRatio(const MetaIteration& iteration, const DistanceRow& result) {
  const ArrayXd bounds = entryBounds(iteration, result.lambda, result.sigma2_squared);
  return (iteration.entryDistance2() / bounds).maxCoeff();
}

// follows the meta iteration and appends a row for each round
void followRounds(const ConvergenceSettings& settings, int rounds, bool allowed,
                  DistanceRow& result, MetaIteration& iteration, std::vector<GradientRow>& rows) {
  const double eta = allowed ? result.allowed_eta : result.eta;
  double sum = 0;
  for (int c = 1; c <= rounds; ++c) {
    GradientRow row;
    row.diversity = result.diversity;
    row.lambda = result.lambda;
    row.eta = eta;
    row.allowed = allowed;
    row.round = c;
    row.grad_norm2 = iteration.gradient().square().sum();
    row.running_mean = (sum += row.grad_norm2) / c;
    row.shape = 1.0 / c + std::pow(c, -2.0 / 3) + 1 / std::sqrt(c);
    row.distance2 = iteration.distance2();
    rows.push_back(row);
    if (!std::isnan(result.sigma2_squared)) {
      result.entry_ratio = std::max(result.entry_ratio, worstEntryRatio(iteration, result));
    }
    iteration.runRound(settings.updates_per_round, eta, settings.meta.beta);
  }
}

// slope of the running mean by least squares in log-log, and how it fares against the bound's shape
void judgeRunningMean(const std::vector<GradientRow>& rows, std::size_t start,
                      DistanceRow& result) {
  const std::size_t first = start + kFirstSlopeRound - 1;
  const auto n = static_cast<Eigen::Index>(rows.size() - first);
  ArrayXd x(n);
  ArrayXd y(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    x[k] = std::log(rows[first + k].round);
    y[k] = std::log(rows[first + k].running_mean);
  }
  x -= x.mean();
  result.slope = (x * (y - y.mean())).sum() / x.square().sum();
  const auto over_shape = [](const GradientRow& row) { return row.running_mean / row.shape; };
  result.shape_ratio = over_shape(rows.back()) / over_shape(rows[first]);
}

}  // namespace

DistanceRow measureMeta(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                        std::vector<GradientRow>& rows) {
  DistanceRow result;
  result.diversity = set.diversity.diversity;
  result.lambda = lambda;
  result.eta = usedEta(settings, lambda);
  result.allowed_eta = allowedEta(lambda, settings.updates_per_round, settings.meta.beta);
  result.sigma2_squared = sigma2Squared(lambda, settings.gamma, set.diversity);

  MetaIteration iteration(set.tasks, lambda);
  const std::size_t first_row = rows.size();
  followRounds(settings, settings.rounds, false, result, iteration, rows);
  judgeRunningMean(rows, first_row, result);
  result.gradient_left = iteration.gradient().square().sum() / rows[first_row].grad_norm2;
  result.distance2 = iteration.distance2();
  result.gradient_bound = 2 / (lambda * lambda) * iteration.taskGradientNorm2();
  Eigen::Index entry = 0;
  result.entry_distance2 = iteration.entryDistance2().maxCoeff(&entry);
  if (std::isnan(result.allowed_eta)) {
    result.allowed_factor = result.entry_bound = result.entry_ratio = kNan;
    return result;
  }
  result.entry_ratio = std::max(result.entry_ratio, worstEntryRatio(iteration, result));
  result.entry_bound = entryBounds(iteration, lambda, result.sigma2_squared)[entry];

  MetaIteration careful(set.tasks, lambda);
  const double before = careful.gradient().square().sum();
  followRounds(settings, kAllowedRounds, true, result, careful, rows);
  result.allowed_factor = careful.gradient().square().sum() / before;
  return result;
}

double measureDistance(const ConvergenceSettings& settings, const KnownTasks& set, double lambda) {
  MetaIteration iteration(set.tasks, lambda);
  for (int c = 1; c <= settings.rounds; ++c) {
    iteration.runRound(settings.updates_per_round, usedEta(settings, lambda), settings.meta.beta);
  }
  return iteration.distance2();
}

}  // namespace pmeta
