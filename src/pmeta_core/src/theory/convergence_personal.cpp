#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "convergence_measures.h"
#include "pmeta_core/learn/q_learner.h"
#include "pmeta_core/personal/proximal_sgd.h"

namespace pmeta {
namespace {

// deviation of random tables: about the size of the tasks' values
constexpr double kTableDeviation = 10;
// a rough meta table leads greedy policies in circles of two states, where too long a step shows
// first
constexpr double kRoughDeviation = 100;
// sweeps over which exact iterations are followed; the printed sign is lost long before
constexpr int kExactSweeps = 1000;
constexpr int kPlusSignSweeps = 60;
// a probe of the step limit
constexpr int kProbeSweeps = 3000;
constexpr int kBisections = 12;

// random numbers of one purpose do not depend on what else is measured
enum Purpose : std::uint64_t { kPairs = 1, kFrozenMeta = 2, kSweeps = 3, kProbe = 4 };

double contractionRatio(const KnownTask& task, const QTable& meta, double lambda, const QTable& a,
                        const QTable& b) {
  QTable image_a(task.tableSize(), 0.0);
  QTable image_b(task.tableSize(), 0.0);
  task.regularisedBackup(a, meta, lambda, image_a);
  task.regularisedBackup(b, meta, lambda, image_b);
  return task.distance(image_a, image_b) / task.distance(a, b);
}

// a task's update with frozen meta table and its goal
struct Frozen {
  const KnownTask& task;
  double lambda;
  QTable meta;
  QTable goal;  // fixed point of B^
};

std::vector<Frozen> freeze(const ConvergenceSettings& settings, const KnownTasks& set,
                           double lambda, double deviation) {
  std::vector<Frozen> all;
  for (std::size_t i = 0; i < set.tasks.size(); ++i) {
    Rng rng(settings.seed, i, Stream::kMeasure, kFrozenMeta);
    const KnownTask& task = set.tasks[i];
    QTable meta = task.randomTable(deviation, rng);
    QTable goal = task.solveFixedPoint(meta, lambda);
    all.push_back({task, lambda, std::move(meta), std::move(goal)});
  }
  return all;
}

// the expected personalised update of all entries at once: eq. (per_update_eq)
class ExpectedUpdate {
 public:
  // `lambda` below 0 pushes away from the meta table, as the paper's sign does.
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

 private:
  void move(std::size_t offset, const double* gradient, std::size_t n, double* target,
            double tau) override {
    const double lambda = frozen_.lambda;
    for (std::size_t k = offset; k < offset + n; ++k) {
      const double alpha = std::pow(++visits_[k], -exponent_) / (1 + lambda);
      q_[k] -= alpha * (gradient[k - offset] + lambda * (q_[k] - frozen_.meta[k]));
      if (target != nullptr) target[k - offset] += tau * (q_[k] - target[k - offset]);
    }
  }

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

// gives a task's sweep, which moves its table q
using StartSweeps = std::function<std::function<void()>(Frozen&, std::size_t task, QTable& q)>;

// gives what takes the gradients of a task's samples and moves its table q
using MakeStep = std::function<std::shared_ptr<Optimizer<double>>(Frozen&, QTable& q)>;

StartSweeps expectedSweeps(double alpha, double lambda) {
  return [=](Frozen& one, std::size_t, QTable& q) {
    const auto update = std::make_shared<ExpectedUpdate>(one, alpha, lambda, q);
    return [update] { (*update)(); };
  };
}

// one sweep draws as many samples as the task owns entries: eq. (per_update0)
StartSweeps sampledSweeps(const ConvergenceSettings& settings, const MakeStep& make_step) {
  return [gamma = settings.gamma, seed = settings.seed, make_step](Frozen& one, std::size_t task,
                                                                   QTable& q) {
    return [learner = QLearner(one.task.env(), gamma), step = make_step(one, q),
            rng = Rng(seed, task, Stream::kMeasure, kSweeps),
            &q]() mutable { learner.learnBatch(q, 1, *step, rng); };
  };
}

// follows all tasks from zero tables; a row for each checkpoint with the worst task's distance
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

// does the expected iteration return to its fixed point when it starts beside it? It may also run
// away, or go on swinging between tables that differ in their greedy actions
bool settles(Frozen& frozen, double alpha, std::uint64_t seed) {
  Rng rng(seed, 0, Stream::kMeasure, kProbe);
  QTable q = frozen.task.randomTable(1, rng);
  for (const std::size_t k : frozen.task.entries()) q[k] += frozen.goal[k];
  ExpectedUpdate sweep(frozen, alpha, frozen.lambda, q);
  const double start = frozen.task.distance(q, frozen.goal);
  double halfway = 0;
  double distance = start;
  for (int k = 1; k <= kProbeSweeps; ++k) {
    sweep();
    distance = frozen.task.distance(q, frozen.goal);
    if (!(distance < 1e3 * start)) return false;
    if (distance < 1e-5 * start) return true;
    if (k == kProbeSweeps / 2) halfway = distance;
  }
  return distance < halfway / 2;
}

}  // namespace

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

void measureExpected(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                     std::vector<FixedPointRow>& rows) {
  std::vector<Frozen> frozen = freeze(settings, set, lambda, kTableDeviation);
  followSweeps("exact", kExactSweeps, frozen, expectedSweeps(1 / (1 + lambda), lambda), rows);
  if (lambda == 0) return;
  const double alpha = settings.fixed_point.constant_step / (1 + lambda);
  followSweeps("plus_sign", kPlusSignSweeps, frozen, expectedSweeps(alpha, -lambda), rows);
}

void measureSampled(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                    std::vector<FixedPointRow>& rows) {
  const ConvergenceSettings::FixedPoint& f = settings.fixed_point;
  std::vector<Frozen> frozen = freeze(settings, set, lambda, kTableDeviation);
  const MakeStep shrinking = [&](Frozen& one, QTable& q) {
    return std::make_shared<RobbinsMonroStep>(one, f.step_exponent, q);
  };
  const MakeStep constant = [&](Frozen& one, QTable& q) {
    return std::make_shared<ProximalSgd<double>>(q.data(), one.meta.data(), q.size(),
                                                 f.constant_step / (1 + lambda), lambda, 0);
  };
  followSweeps("robbins_monro", f.sweeps, frozen, sampledSweeps(settings, shrinking), rows);
  followSweeps("constant", f.sweeps, frozen, sampledSweeps(settings, constant), rows);
}

StepLimitRow measureStepLimit(const ConvergenceSettings& settings, const KnownTasks& set,
                              double lambda) {
  StepLimitRow row;
  row.lambda = lambda;
  row.predicted = 2 * (1 + lambda) / (1 + lambda + settings.gamma);
  std::vector<Frozen> frozen = freeze(settings, set, lambda, kRoughDeviation);
  // bisection on alpha (1 + lambda); the limit is that of the first task that does not settle
  double stable = 0.5 * row.predicted;
  double unstable = 1.5 * row.predicted;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = (stable + unstable) / 2;
    const bool all = std::all_of(frozen.rbegin(), frozen.rend(), [&](Frozen& one) {
      return settles(one, middle / (1 + lambda), settings.seed);
    });
    (all ? stable : unstable) = middle;
  }
  row.measured = (stable + unstable) / 2;
  return row;
}

}  // namespace pmeta
