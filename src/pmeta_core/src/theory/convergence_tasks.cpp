#include "convergence_tasks.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/env.h"

namespace pmeta {
namespace {

// what an entry leads to: the expected reward and the probability of each next state
struct EntryModel {
  double reward = 0;
  std::map<int, double> next;
};

EntryModel modelOf(const TabularEnv& env, std::size_t entry) {
  const int n = env.numActions();
  EntryModel model;
  for (const Outcome& outcome :
       env.outcomes(static_cast<int>(entry) / n, static_cast<int>(entry) % n)) {
    model.reward += outcome.probability * outcome.reward;
    // the end of an episode is worth 0 wherever it happens: one state more
    model.next[outcome.terminated ? env.numStates() : outcome.next_state] += outcome.probability;
  }
  return model;
}

// largest |P_i(s'|s,a) - mean P(s'|s,a)| over s', given the sum of P over `owners` tasks
double largestDifference(const EntryModel& one, const EntryModel& sum, int owners) {
  double largest = 0;
  for (const auto& [state, total] : sum.next) {
    const auto found = one.next.find(state);
    const double p = found == one.next.end() ? 0 : found->second;
    largest = std::max(largest, std::abs(p - total / owners));
  }
  return largest;
}

// sigma_1,i, sigma_2,i and sigma: Assumption 1 and Theorem 2
void measureDiversity(const std::vector<KnownTask>& tasks, double gamma, DiversityRow& row) {
  const std::size_t size = tasks.front().tableSize();
  std::vector<EntryModel> sums(size);
  std::vector<int> owners(size, 0);
  for (const KnownTask& task : tasks) {
    for (const std::size_t entry : task.entries()) {
      const EntryModel model = modelOf(task.env(), entry);
      sums[entry].reward += model.reward;
      for (const auto& [state, p] : model.next) sums[entry].next[state] += p;
      ++owners[entry];
      const int n = task.env().numActions();
      for (const Outcome& outcome :
           task.env().outcomes(static_cast<int>(entry) / n, static_cast<int>(entry) % n)) {
        row.r_max = std::max(row.r_max, std::abs(outcome.reward));
      }
    }
  }

  double squares = 0;
  for (const KnownTask& task : tasks) {
    double sigma1 = 0;
    double sigma2 = 0;
    for (const std::size_t entry : task.entries()) {
      const EntryModel model = modelOf(task.env(), entry);
      const double mean = sums[entry].reward / owners[entry];
      sigma1 = std::max(sigma1, std::abs(model.reward - mean));
      sigma2 = std::max(sigma2, largestDifference(model, sums[entry], owners[entry]));
    }
    row.sigma1.push_back(sigma1);
    row.sigma2.push_back(sigma2);
    squares += std::pow(sigma1 + sigma2 * gamma / (1 - gamma) * row.r_max, 2);
  }
  row.sigma = std::sqrt(squares / static_cast<double>(tasks.size()));
}

std::vector<double> spreadSlip(double largest, std::size_t n) {
  std::vector<double> slip(n, 0);
  for (std::size_t i = 1; i < n; ++i) {
    slip[i] = largest * static_cast<double>(i) / static_cast<double>(n - 1);
  }
  return slip;
}

template <class T>
std::string listText(const std::vector<T>& values) {
  std::vector<std::string> words;
  for (const T value : values) words.push_back(formatNumber(static_cast<double>(value)));
  return "[" + join(words) + "]";
}

}  // namespace

KnownTask::KnownTask(std::unique_ptr<TabularEnv> env, double gamma)
    : env_(std::move(env)),
      gamma_(gamma),
      table_size_(static_cast<std::size_t>(env_->numStates()) * env_->numActions()) {
  for (const int s : env_->ownedStates()) {
    for (int a = 0; a < env_->numActions(); ++a) {
      entries_.push_back(static_cast<std::size_t>(s) * env_->numActions() + a);
    }
  }
}

void KnownTask::backup(const QTable& q, QTable& out) const {
  const int n = env_->numActions();
  for (const int s : env_->ownedStates()) {
    for (int a = 0; a < n; ++a) {
      out[static_cast<std::size_t>(s) * n + a] = bellmanBackup(*env_, q, s, a, gamma_);
    }
  }
}

void KnownTask::regularisedBackup(const QTable& q, const QTable& anchor, double lambda,
                                  QTable& out) const {
  backup(q, out);
  for (const std::size_t k : entries_) out[k] = (lambda * anchor[k] + out[k]) / (1 + lambda);
}

void KnownTask::iterateToFixedPoint(const QTable& anchor, double lambda, QTable& q) const {
  // what is left after a step is at most gamma / (1 + lambda - gamma) times the step
  constexpr double kRelativeStep = 1e-14;
  QTable next(table_size_, 0.0);
  const QTable zero(table_size_, 0.0);
  double step = 0;
  double before = 0;
  do {
    before = step;
    regularisedBackup(q, anchor, lambda, next);
    step = distance(q, next);
    // copied, not swapped: others may hold the address of q's values
    std::copy(next.begin(), next.end(), q.begin());
  } while (step > kRelativeStep * (1 + distance(q, zero)) && (before == 0 || step < before));
}

QTable KnownTask::solveFixedPoint(const QTable& anchor, double lambda) const {
  const int n = env_->numActions();
  const std::vector<int>& states = env_->ownedStates();
  const auto size = static_cast<Eigen::Index>(states.size());
  std::vector<Eigen::Index> row(env_->numStates(), 0);
  for (Eigen::Index k = 0; k < size; ++k) row[states[k]] = k;

  std::vector<int> policy(states.size(), 0);
  QTable q(table_size_, 0.0);
  for (bool changed = true; changed;) {
    Eigen::MatrixXd matrix = (1 + lambda) * Eigen::MatrixXd::Identity(size, size);
    Eigen::VectorXd right(size);
    for (Eigen::Index k = 0; k < size; ++k) {
      right[k] = lambda * anchor[static_cast<std::size_t>(states[k]) * n + policy[k]];
      for (const Outcome& outcome : env_->outcomes(states[k], policy[k])) {
        right[k] += outcome.probability * outcome.reward;
        if (!outcome.terminated) {
          matrix(k, row[outcome.next_state]) -= gamma_ * outcome.probability;
        }
      }
    }
    const Eigen::VectorXd values = matrix.partialPivLu().solve(right);

    changed = false;
    for (Eigen::Index k = 0; k < size; ++k) {
      double* actions = &q[static_cast<std::size_t>(states[k]) * n];
      for (int a = 0; a < n; ++a) {
        double sum = lambda * anchor[static_cast<std::size_t>(states[k]) * n + a];
        for (const Outcome& outcome : env_->outcomes(states[k], a)) {
          const double value = outcome.terminated ? 0.0 : values[row[outcome.next_state]];
          sum += outcome.probability * (outcome.reward + gamma_ * value);
        }
        actions[a] = sum / (1 + lambda);
      }
      // an action must be better by more than rounding, or policies could cycle
      const int best = greedyAction(actions, n);
      if (actions[best] > actions[policy[k]] + 1e-10) {
        policy[k] = best;
        changed = true;
      }
    }
  }
  return q;
}

double KnownTask::distance(const QTable& a, const QTable& b) const {
  double largest = 0;
  for (const std::size_t k : entries_) largest = std::max(largest, std::abs(a[k] - b[k]));
  return largest;
}

Model KnownTask::emptyModel() const {
  Model model(ModelLayout(Precision::kFloat64, {{"q_table",
                                                 {static_cast<std::size_t>(env_->numStates()),
                                                  static_cast<std::size_t>(env_->numActions())}}}));
  model.present.assign(table_size_, 0);
  for (const std::size_t k : entries_) model.present[k] = 1;
  return model;
}

QTable KnownTask::randomTable(double deviation, Rng& rng) const {
  QTable table(table_size_, 0.0);
  for (const std::size_t k : entries_) table[k] = deviation * rng.normal();
  return table;
}

KnownTasks makeKnownTasks(const ConvergenceSettings& settings, const std::string& diversity,
                          std::vector<double> slip) {
  const bool spread = diversity == "random_slip";
  if (slip.empty()) {
    slip = spread ? spreadSlip(settings.slip_spread, settings.sizes.size()) : settings.slip;
  }
  const std::unique_ptr<EnvFamily> family = makeFamily(settings.environment);
  Settings bound;
  family->bind(bound);
  bound.assign("environment.sizes:=" + listText(settings.sizes));
  bound.assign("environment.landmark:=" + (spread ? "random" : diversity));
  bound.assign("environment.slip:=" + listText(slip));
  family->build(static_cast<std::uint64_t>(settings.seed));

  KnownTasks known;
  known.diversity.diversity = diversity;
  for (int i = 0; i < family->numTasks(); ++i) {
    std::unique_ptr<Env> env = family->make(i);
    auto* tabular = dynamic_cast<TabularEnv*>(env.get());
    if (tabular == nullptr) {
      throw Error("environment '" + settings.environment +
                  "' is not tabular: its exact values are not known.");
    }
    env.release();
    known.tasks.emplace_back(std::unique_ptr<TabularEnv>(tabular), settings.gamma);
    known.diversity.names.push_back(family->taskName(i));
    known.diversity.descriptions.push_back(family->taskDescription(i));
  }
  measureDiversity(known.tasks, settings.gamma, known.diversity);
  return known;
}

}  // namespace pmeta
