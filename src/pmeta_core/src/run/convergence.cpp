#include "pmeta_core/run/convergence.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "convergence_tasks.h"
#include "pmeta_core/aggregate/mix.h"
#include "pmeta_core/learn/q_learner.h"
#include "pmeta_core/personal/proximal_sgd.h"

namespace pmeta {
namespace {

using Eigen::ArrayXd;

// deviation of random tables: about the size of the tasks' values
constexpr double kTableDeviation = 10;
// sweeps over which exact iterations are followed; the printed sign is lost long before
constexpr int kExactSweeps = 1000;
constexpr int kPlusSignSweeps = 60;
// a probe of the step limit
constexpr int kProbeSweeps = 3000;
constexpr int kBisections = 12;
// the slope of the running mean leaves out the first rounds
constexpr int kFirstSlopeRound = 10;
constexpr int kAllowedRounds = 10;

// random numbers of one purpose do not depend on what else is measured
enum Purpose : std::uint64_t { kPairs = 1, kFrozenMeta = 2, kSweeps = 3, kProbe = 4 };

const double kNan = std::numeric_limits<double>::quiet_NaN();

// ---- contraction

double contractionRatio(const KnownTask& task, const QTable& meta, double lambda, const QTable& a,
                        const QTable& b) {
  QTable image_a(task.tableSize(), 0.0);
  QTable image_b(task.tableSize(), 0.0);
  task.regularisedBackup(a, meta, lambda, image_a);
  task.regularisedBackup(b, meta, lambda, image_b);
  return task.distance(image_a, image_b) / task.distance(a, b);
}

ContractionRow measureContraction(const ConvergenceSettings& settings,
                                  const std::vector<KnownTasks>& sets, double lambda) {
  std::vector<const KnownTask*> tasks;
  for (const KnownTasks& set : sets) {
    for (const KnownTask& task : set.tasks) tasks.push_back(&task);
  }
  ContractionRow row;
  row.lambda = lambda;
  row.pairs = settings.contraction.pairs;
  row.bound = settings.gamma / (1 + lambda);

  Rng rng(settings.seed, 0, Stream::kMeasure, kPairs);
  for (int pair = 0; pair < row.pairs; ++pair) {
    const KnownTask& task = *tasks[pair % tasks.size()];
    const QTable meta = task.randomTable(kTableDeviation, rng);
    const QTable a = task.randomTable(kTableDeviation, rng);
    // tables that have nothing to do with each other, and tables that are close
    QTable b = task.randomTable(pair % 2 == 0 ? kTableDeviation : 1, rng);
    if (pair % 2 == 1) {
      for (const std::size_t k : task.entries()) b[k] += a[k];
    }
    row.worst_pair = std::max(row.worst_pair, contractionRatio(task, meta, lambda, a, b));
  }
  for (const KnownTask* task : tasks) {
    const QTable meta = task->randomTable(kTableDeviation, rng);
    const QTable a = task->randomTable(kTableDeviation, rng);
    QTable b = a;
    const double shift = 1 + kTableDeviation * rng.uniform();
    for (const std::size_t k : task->entries()) b[k] += shift;
    row.worst_shift = std::max(row.worst_shift, contractionRatio(*task, meta, lambda, a, b));
  }
  return row;
}

// ---- Theorem 1: the personalised update with a frozen meta table

// a task's update with frozen meta table and its goal
struct Frozen {
  const KnownTask& task;
  double lambda;
  QTable meta;
  QTable goal;  // fixed point of B^
};

std::vector<Frozen> freeze(const ConvergenceSettings& settings, const KnownTasks& set,
                           double lambda) {
  std::vector<Frozen> all;
  for (std::size_t i = 0; i < set.tasks.size(); ++i) {
    Rng rng(settings.seed, i, Stream::kMeasure, kFrozenMeta);
    const KnownTask& task = set.tasks[i];
    QTable meta = task.randomTable(kTableDeviation, rng);
    QTable goal = task.solveFixedPoint(meta, lambda);
    all.push_back({task, lambda, std::move(meta), std::move(goal)});
  }
  return all;
}

// the expected personalised update of all entries at once: eq. (per_update_eq)
class ExpectedUpdate {
 public:
  /// `lambda` below 0 pushes away from the meta table, as the paper's sign does.
  ExpectedUpdate(Frozen& frozen, double alpha, double lambda, QTable& q)
      : task_(frozen.task),
        q_(q),
        gradient_(q.size(), 0.0),
        backup_(q.size(), 0.0),
        step_(q.data(), frozen.meta.data(), q.size(), alpha, lambda, 0) {}

  void operator()() {
    task_.backup(q_, backup_);
    for (const std::size_t k : task_.entries()) gradient_[k] = q_[k] - backup_[k];
    step_.apply(0, gradient_.data(), gradient_.size());
  }

 private:
  const KnownTask& task_;
  QTable& q_;
  QTable gradient_;
  QTable backup_;
  ProximalSgd<double> step_;
};

// ProximalSgd with a step size of its own for each entry: alpha (1 + lambda) = visits^-w, whose sum
// diverges and whose squares' sum does not
class RobbinsMonroStep : public Optimizer<double> {
 public:
  RobbinsMonroStep(Frozen& frozen, double exponent, QTable& q)
      : frozen_(frozen), exponent_(exponent), q_(q), visits_(q.size(), 0) {}

  void apply(std::size_t offset, const double* gradient, std::size_t n) override {
    const double lambda = frozen_.lambda;
    for (std::size_t k = offset; k < offset + n; ++k) {
      const double alpha = std::pow(++visits_[k], -exponent_) / (1 + lambda);
      q_[k] -= alpha * (gradient[k - offset] + lambda * (q_[k] - frozen_.meta[k]));
    }
  }

 private:
  const Frozen& frozen_;
  double exponent_;
  QTable& q_;
  std::vector<int> visits_;
};

// 1 2 3 5 7 10 20 ... and the last sweep
std::vector<int> checkpoints(int sweeps) {
  std::vector<int> at;
  for (std::int64_t decade = 1; decade <= sweeps; decade *= 10) {
    for (const int digit : {1, 2, 3, 5, 7}) {
      if (decade * digit < sweeps) at.push_back(static_cast<int>(decade * digit));
    }
  }
  at.push_back(sweeps);
  return at;
}

// worst distance over the tasks after each checkpoint's sweeps; `start` gives the sweep of a task
// that moves its table q
using StartSweeps = std::function<std::function<void()>(Frozen&, std::size_t task, QTable& q)>;

void followSweeps(const std::string& update, int sweeps, std::vector<Frozen>& frozen,
                  const StartSweeps& start, std::vector<FixedPointRow>& rows) {
  const std::vector<int> at = checkpoints(sweeps);
  std::vector<double> worst(at.size(), 0);
  for (std::size_t i = 0; i < frozen.size(); ++i) {
    QTable q(frozen[i].meta.size(), 0.0);
    const std::function<void()> sweep = start(frozen[i], i, q);
    int done = 0;
    for (std::size_t c = 0; c < at.size(); ++c) {
      for (; done < at[c]; ++done) sweep();
      worst[c] = std::max(worst[c], frozen[i].task.distance(q, frozen[i].goal));
    }
  }
  for (std::size_t c = 0; c < at.size(); ++c) {
    rows.push_back({frozen.front().lambda, update, at[c], worst[c]});
  }
}

void measureExpected(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                     std::vector<FixedPointRow>& rows) {
  std::vector<Frozen> frozen = freeze(settings, set, lambda);
  const auto with = [](double alpha, double strength) -> StartSweeps {
    return [=](Frozen& one, std::size_t, QTable& q) {
      auto update = std::make_shared<ExpectedUpdate>(one, alpha, strength, q);
      return [update] { (*update)(); };
    };
  };
  followSweeps("exact", kExactSweeps, frozen, with(1 / (1 + lambda), lambda), rows);
  if (lambda == 0) return;
  const double alpha = settings.fixed_point.constant_step / (1 + lambda);
  followSweeps("plus_sign", kPlusSignSweeps, frozen, with(alpha, -lambda), rows);
}

void measureSampled(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                    std::vector<FixedPointRow>& rows) {
  const ConvergenceSettings::FixedPoint& f = settings.fixed_point;
  std::vector<Frozen> frozen = freeze(settings, set, lambda);
  const auto with = [&](const std::function<std::shared_ptr<Optimizer<double>>(Frozen&, QTable&)>&
                            makeStep) -> StartSweeps {
    return [&settings, makeStep](Frozen& one, std::size_t task, QTable& q) {
      Rng rng(settings.seed, task, Stream::kMeasure, kSweeps);
      return [learner = QLearner(one.task.env(), settings.gamma), step = makeStep(one, q), rng,
              &q]() mutable { learner.learnBatch(q, 1, *step, rng); };
    };
  };
  followSweeps("robbins_monro", f.sweeps, frozen, with([&](Frozen& one, QTable& q) {
                 return std::make_shared<RobbinsMonroStep>(one, f.step_exponent, q);
               }),
               rows);
  followSweeps("constant", f.sweeps, frozen, with([&](Frozen& one, QTable& q) {
                 return std::make_shared<ProximalSgd<double>>(q.data(), one.meta.data(), q.size(),
                                                              f.constant_step / (1 + lambda),
                                                              lambda, 0);
               }),
               rows);
}

// does the expected iteration leave its fixed point when it starts beside it?
bool runsAway(Frozen& frozen, double alpha, std::uint64_t seed) {
  Rng rng(seed, 0, Stream::kMeasure, kProbe);
  QTable q = frozen.task.randomTable(1, rng);
  for (const std::size_t k : frozen.task.entries()) q[k] += frozen.goal[k];
  ExpectedUpdate sweep(frozen, alpha, frozen.lambda, q);
  const double start = frozen.task.distance(q, frozen.goal);
  double halfway = 0;
  for (int k = 1; k <= kProbeSweeps; ++k) {
    sweep();
    const double distance = frozen.task.distance(q, frozen.goal);
    if (!(distance < 1e3 * start)) return true;
    if (distance < 1e-5 * start) return false;
    if (k == kProbeSweeps / 2) halfway = distance;
  }
  return frozen.task.distance(q, frozen.goal) > halfway;
}

StepLimitRow measureStepLimit(const ConvergenceSettings& settings, const KnownTasks& set,
                              double lambda) {
  StepLimitRow row;
  row.lambda = lambda;
  row.predicted = 2 * (1 + lambda) / (1 + lambda + settings.gamma);
  std::vector<Frozen> frozen = freeze(settings, set, lambda);
  // bisection on alpha (1 + lambda); the tasks' limit is that of the first to run away
  double stable = 0.5 * row.predicted;
  double unstable = 1.5 * row.predicted;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = (stable + unstable) / 2;
    const bool any = std::any_of(frozen.rbegin(), frozen.rend(), [&](Frozen& one) {
      return runsAway(one, middle / (1 + lambda), settings.seed);
    });
    (any ? unstable : stable) = middle;
  }
  row.measured = (stable + unstable) / 2;
  return row;
}

// ---- Theorem 2: the meta iteration with exact inner solutions

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

  /// One round of R exact auxiliary steps a task, then the aggregation, both as in the algorithm.
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

  /// grad L(Q) of each entry.
  const ArrayXd& gradient() const { return gradient_; }
  /// mean_i |Q_i* - Q|^2 of each entry.
  const ArrayXd& entryDistance2() const { return entry_distance2_; }
  /// 1 where some task owns the entry.
  ArrayXd owned() const { return owners_.min(1); }

  /// mean_i ||Q_i* - Q||^2 over tasks.
  double distance2() const {
    return (entry_distance2_ * owners_).sum() / static_cast<double>(tasks_.size());
  }

  /// mean_i ||grad L_i||^2, where grad L_i = Q_i* - [r + gamma E max Q_i*] by the fixed point.
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

    iteration.runRound(settings.updates_per_round, eta, settings.meta.beta);
    if (!std::isnan(result.sigma2_squared) && !allowed) {
      const ArrayXd bounds = entryBounds(iteration, result.lambda, result.sigma2_squared);
      result.entry_ratio =
          std::max(result.entry_ratio, (iteration.entryDistance2() / bounds).maxCoeff());
    }
  }
}

// slope of the running mean by least squares in log-log, and how it fares against the bound's shape
void judgeRunningMean(const GradientRow* rows, int rounds, DistanceRow& result) {
  const int first = kFirstSlopeRound - 1;
  const Eigen::Index n = rounds - first;
  ArrayXd x(n);
  ArrayXd y(n);
  const double start = rows[first].running_mean / rows[first].shape;
  for (Eigen::Index k = 0; k < n; ++k) {
    const GradientRow& row = rows[first + k];
    x[k] = std::log(row.round);
    y[k] = std::log(row.running_mean);
    result.shape_excess = std::max(result.shape_excess, row.running_mean / row.shape / start);
  }
  x -= x.mean();
  result.slope = (x * (y - y.mean())).sum() / x.square().sum();
}

DistanceRow measureMeta(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                        std::vector<GradientRow>& rows) {
  DistanceRow result;
  result.diversity = set.diversity.diversity;
  result.lambda = lambda;
  result.eta = std::min(settings.meta.eta_cap, 1 / lambda);
  result.allowed_eta = allowedEta(lambda, settings.updates_per_round, settings.meta.beta);
  result.sigma2_squared = sigma2Squared(lambda, settings.gamma, set.diversity);

  MetaIteration iteration(set.tasks, lambda);
  const std::size_t first_row = rows.size();
  followRounds(settings, settings.rounds, false, result, iteration, rows);
  judgeRunningMean(&rows[first_row], settings.rounds, result);
  result.distance2 = iteration.distance2();
  result.gradient_bound = 2 / (lambda * lambda) * iteration.taskGradientNorm2();
  Eigen::Index entry = 0;
  result.entry_distance2 = iteration.entryDistance2().maxCoeff(&entry);
  if (std::isnan(result.allowed_eta)) {
    result.allowed_factor = result.entry_bound = result.entry_ratio = kNan;
    return result;
  }
  result.entry_bound = entryBounds(iteration, lambda, result.sigma2_squared)[entry];

  MetaIteration careful(set.tasks, lambda);
  const double before = careful.gradient().square().sum();
  followRounds(settings, kAllowedRounds, true, result, careful, rows);
  result.allowed_factor = careful.gradient().square().sum() / before;
  return result;
}

// the settings' slip, or one that makes transitions random where there is none
std::vector<double> samplingSlip(const ConvergenceSettings& settings) {
  const bool spread = settings.fixed_point.diversity == "random_slip";
  const double largest = *std::max_element(settings.slip.begin(), settings.slip.end());
  if (spread || largest > 0) return {};
  return {settings.fixed_point.slip};
}

}  // namespace

ConvergenceReport measureConvergence(const ConvergenceSettings& settings,
                                     const ConvergenceProgress& progress) {
  ConvergenceReport report;
  report.settings = settings;
  std::vector<KnownTasks> sets;
  for (const std::string& diversity : settings.diversities) {
    sets.push_back(makeKnownTasks(settings, diversity));
    report.diversities.push_back(sets.back().diversity);
  }

  const std::size_t steps = 2 * settings.contraction.lambdas.size() +
                            settings.fixed_point.lambdas.size() +
                            sets.size() * settings.meta.lambdas.size();
  std::size_t done = 0;
  const auto announce = [&](const std::string& what, double lambda) {
    if (progress) {
      progress(what + ", lambda " + formatNumber(lambda),
               static_cast<double>(done) / static_cast<double>(steps));
    }
    ++done;
  };

  for (const double lambda : settings.contraction.lambdas) {
    announce("contraction", lambda);
    report.contraction.push_back(measureContraction(settings, sets, lambda));
  }

  const KnownTasks plain = makeKnownTasks(settings, settings.fixed_point.diversity);
  const KnownTasks slippery =
      makeKnownTasks(settings, settings.fixed_point.diversity, samplingSlip(settings));
  for (const double lambda : settings.fixed_point.lambdas) {
    announce("Theorem 1, fixed point", lambda);
    measureExpected(settings, plain, lambda, report.fixed_point);
    measureSampled(settings, slippery, lambda, report.fixed_point);
  }
  for (const double lambda : settings.contraction.lambdas) {
    announce("Theorem 1, step limit", lambda);
    report.step_limit.push_back(measureStepLimit(settings, plain, lambda));
  }

  for (const KnownTasks& set : sets) {
    for (const double lambda : settings.meta.lambdas) {
      announce("Theorem 2, " + set.diversity.diversity, lambda);
      report.distance.push_back(measureMeta(settings, set, lambda, report.gradient));
    }
  }
  if (progress) progress("done", 1);
  return report;
}

}  // namespace pmeta
