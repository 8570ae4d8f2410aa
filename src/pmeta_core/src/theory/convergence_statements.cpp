#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

#include "pmeta_core/base/number.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/theory/convergence.h"

namespace pmeta {
namespace {

const double kNan = std::numeric_limits<double>::quiet_NaN();

// rounding that a ratio or a fixed point may show
constexpr double kRounding = 1e-12;
// what counts as attaining a bound or meeting a prediction
constexpr double kAttained = 1e-4;
constexpr double kNearLimit = 0.01;
// the slowest term of the bound of Theorem 2(a) is C^(-1/2)
constexpr double kSlowestTerm = -0.5;
constexpr double kSettled = 0.01;
constexpr double kNearConstant = 0.05;
constexpr double kNearExponent = 0.1;
// from here on the distance follows 1 / lambda^2
constexpr double kExponentFrom = 5;

std::string rounded(double value, int digits = 2) {
  const NumbersWithDots dots;
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

// "270x", without an exponent
std::string times(double factor) {
  if (!(factor < 1e9)) return "very";
  if (factor >= 100) return std::to_string(std::llround(factor)) + "x";
  return rounded(factor) + "x";
}

std::string yesNo(bool holds) { return holds ? "yes" : "no"; }

std::string lambdaText(double lambda) { return "lambda " + formatNumber(lambda); }

std::string nameOf(const DistanceRow& row) {
  return row.diversity + ", " + formatNumber(row.lambda);
}

// rows of one diversity, in the order of lambda as given
std::vector<const DistanceRow*> rowsOf(const ConvergenceReport& report,
                                       const std::string& diversity) {
  std::vector<const DistanceRow*> rows;
  for (const DistanceRow& row : report.distance) {
    if (row.diversity == diversity) rows.push_back(&row);
  }
  return rows;
}

std::vector<FixedPointRow> run(const ConvergenceReport& report, const std::string& update,
                               double lambda) {
  std::vector<FixedPointRow> rows;
  for (const FixedPointRow& row : report.fixed_point) {
    if (row.update == update && row.lambda == lambda) rows.push_back(row);
  }
  return rows;
}

// least squares through points
class Line {
 public:
  void add(double x, double y) {
    ++n_;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
  }
  int count() const { return n_; }
  double slope() const { return (n_ * xy_ - x_ * y_) / (n_ * xx_ - x_ * x_); }

 private:
  int n_ = 0;
  double x_ = 0;
  double y_ = 0;
  double xx_ = 0;
  double xy_ = 0;
};

// slope of log distance against log K over the last two decades
double slopeInSweeps(const std::vector<FixedPointRow>& rows) {
  Line line;
  for (const FixedPointRow& row : rows) {
    if (row.sweeps * 100.0 >= rows.back().sweeps) {
      line.add(std::log(row.sweeps), std::log(row.distance));
    }
  }
  return line.slope();
}

void addContraction(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const ContractionRow& row : report.contraction) {
    const double worst = std::max(row.worst_pair, row.worst_shift);
    const bool attained = worst >= row.bound * (1 - kAttained);
    all.push_back({"Contraction ratio at most gamma/(1+lambda)", lambdaText(row.lambda), worst,
                   row.bound, yesNo(worst <= row.bound + kRounding),
                   attained ? "attained" : times(row.bound / worst) + " loose"});
  }
}

void addFixedPoint(const ConvergenceReport& report, std::vector<Statement>& all) {
  const ConvergenceSettings::FixedPoint& f = report.settings.fixed_point;
  for (const double lambda : f.lambdas) {
    const FixedPointRow exact = run(report, "exact", lambda).back();
    all.push_back({"1: expected update reaches the fixed point", lambdaText(lambda), exact.distance,
                   kRounding, yesNo(exact.distance <= kRounding), "max-norm distance"});
  }
  for (const double lambda : f.lambdas) {
    const std::vector<FixedPointRow> printed = run(report, "plus_sign", lambda);
    if (printed.empty()) continue;
    const double distance = printed.back().distance;
    all.push_back({"1: the same with the sign as printed (+)", lambdaText(lambda), distance,
                   kRounding, yesNo(distance <= kRounding),
                   "after " + std::to_string(printed.back().sweeps) + " sweeps"});
  }
  for (const std::string update : {"robbins_monro", "constant"}) {
    const bool shrinking = update == "robbins_monro";
    const std::string step = shrinking ? "n^-" + formatNumber(f.step_exponent)
                                       : "constant " + formatNumber(f.constant_step);
    for (const double lambda : f.lambdas) {
      const std::vector<FixedPointRow> rows = run(report, update, lambda);
      const double slope = slopeInSweeps(rows);
      // noise at step size a leaves a distance of about sqrt(a)
      all.push_back({"1: sampled, step " + step + ": slope in K", lambdaText(lambda), slope,
                     shrinking ? -f.step_exponent / 2 : kNan, yesNo(slope <= -f.step_exponent / 4),
                     (shrinking ? "reaches " : "stalls at ") + rounded(rows.back().distance)});
    }
  }
}

void addStepLimit(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const StepLimitRow& row : report.step_limit) {
    const double excess = row.measured / row.predicted - 1;
    std::string remark = "attained";
    if (excess > kNearLimit) remark = "stable " + rounded(100 * excess) + "% further";
    if (excess < -kNearLimit) remark = "lost earlier";
    all.push_back({"1: alpha(1+l) stable to 2(1+l)/(1+l+gamma)", lambdaText(row.lambda),
                   row.measured, row.predicted, yesNo(excess >= -kNearLimit), remark});
  }
}

void addGradient(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DistanceRow& row : report.distance) {
    std::string holds = yesNo(row.slope <= kSlowestTerm);
    std::string remark = rounded(100 * row.gradient_left) + "% left";
    if (std::isnan(row.allowed_eta)) holds = "n/a";
    // a slope taken before the first descent is over says nothing about the limit
    if (row.slope > kSlowestTerm && row.gradient_left > kSettled) {
      holds = "n/a";
      remark += ": too early";
    }
    all.push_back({"2a: running mean |grad L|^2: slope in C", nameOf(row), row.slope, kSlowestTerm,
                   holds, remark});
  }
}

void addStepCondition(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DistanceRow* row : rowsOf(report, report.diversities.front().diversity)) {
    Statement s{"2a: its condition on eta (used, allowed)",
                lambdaText(row->lambda),
                row->eta,
                row->allowed_eta,
                "n/a",
                "needs lambda^2>8"};
    if (!std::isnan(row->allowed_eta)) {
      const double factor = row->eta / row->allowed_eta;
      s.holds = yesNo(factor <= 1);
      s.remark = factor <= 1 ? "step allowed" : "step " + times(factor) + " too large";
    }
    all.push_back(s);
  }
}

// |grad L|^2 after 10 rounds over that before, with the eta in use
double factorInUse(const ConvergenceReport& report, const DistanceRow& of) {
  double before = kNan;
  for (const GradientRow& row : report.gradient) {
    if (row.allowed || row.diversity != of.diversity || row.lambda != of.lambda) continue;
    if (row.round == 1) before = row.grad_norm2;
    if (row.round == 11) return row.grad_norm2 / before;
  }
  return kNan;
}

void addAllowedStep(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DiversityRow& set : report.diversities) {
    // the lambda for which that step does most
    const DistanceRow* best = nullptr;
    for (const DistanceRow* row : rowsOf(report, set.diversity)) {
      if (std::isnan(row->allowed_eta)) continue;
      if (best == nullptr || row->allowed_factor < best->allowed_factor) best = row;
    }
    if (best == nullptr) continue;
    all.push_back({"2a: kept after 10 rounds at the allowed eta", nameOf(*best),
                   best->allowed_factor, kNan, "n/a",
                   rounded(factorInUse(report, *best)) + " with eta used"});
  }
}

// ", 8 draws" where tasks are drawn: the number is their mean
std::string drawsOf(const ConvergenceReport& report, const std::string& diversity) {
  const int draws = report.settings.meta.draws;
  if (diversity.rfind("random", 0) != 0 || draws == 1) return "";
  return ", " + std::to_string(draws) + " draws";
}

// how nearly mean_i ||Q_i* - Q||^2 goes with 1 / lambda^2
void addDistance(const ConvergenceReport& report, std::vector<Statement>& all) {
  std::vector<Statement> exponents;
  for (const DiversityRow& set : report.diversities) {
    Line line;
    std::vector<double> scaled;
    for (const DistanceRow* row : rowsOf(report, set.diversity)) {
      if (row->lambda < kExponentFrom) continue;
      line.add(std::log(row->lambda), std::log(row->mean_distance2));
      scaled.push_back(row->lambda * row->lambda * row->mean_distance2);
    }
    // equal tasks agree in the end, whatever lambda
    if (line.count() < 2 || set.sigma == 0) continue;
    const double mean = std::accumulate(scaled.begin(), scaled.end(), 0.0) / scaled.size();
    double deviation = 0;
    for (const double one : scaled) deviation = std::max(deviation, std::abs(one / mean - 1));
    const auto range = std::minmax_element(scaled.begin(), scaled.end());
    all.push_back({"2b: l^2 mean |Q_i*-Q|^2 constant from l = 5", set.diversity, deviation,
                   kNearConstant, yesNo(deviation <= kNearConstant),
                   rounded(*range.first, 4) + ".." + rounded(*range.second, 4) +
                       drawsOf(report, set.diversity)});
    exponents.push_back({"2b: exponent of mean |Q_i*-Q|^2 in l", set.diversity, line.slope(), -2,
                         yesNo(std::abs(line.slope() + 2) <= kNearExponent),
                         rounded(line.slope() + 2) + " off" + drawsOf(report, set.diversity)});
  }
  all.insert(all.end(), exponents.begin(), exponents.end());
}

void addDistanceStep(const ConvergenceReport& report, std::vector<Statement>& all) {
  const auto ratio = [](const DistanceRow* row) { return row->gradient_bound / row->distance2; };
  for (const DiversityRow& set : report.diversities) {
    const std::vector<const DistanceRow*> rows = rowsOf(report, set.diversity);
    const DistanceRow* tightest = *std::min_element(
        rows.begin(), rows.end(), [&](auto* a, auto* b) { return ratio(a) < ratio(b); });
    all.push_back({"2b: that is at most 2/l^2 mean |grad L_i|^2", nameOf(*tightest),
                   tightest->distance2, tightest->gradient_bound, yesNo(ratio(tightest) >= 1),
                   "bound " + rounded(ratio(tightest), 5) + "x loose"});
  }
}

double looseness(const DistanceRow& row) { return row.entry_bound / row.entry_distance2; }

void addEntryBound(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DiversityRow& set : report.diversities) {
    bool holds = true;
    const DistanceRow* tightest = nullptr;
    for (const DistanceRow* row : rowsOf(report, set.diversity)) {
      if (std::isnan(row->entry_bound)) continue;
      holds = holds && row->entry_ratio <= 1;
      if (tightest == nullptr || looseness(*row) < looseness(*tightest)) tightest = row;
    }
    if (tightest == nullptr) continue;
    all.push_back({"2b: full bound per (s,a), largest distance", nameOf(*tightest),
                   tightest->entry_distance2, tightest->entry_bound, yesNo(holds),
                   "bound " + times(looseness(*tightest)) + " loose"});
  }
}

}  // namespace

std::vector<Statement> convergenceStatements(const ConvergenceReport& report) {
  std::vector<Statement> all;
  addContraction(report, all);
  addFixedPoint(report, all);
  addStepLimit(report, all);
  addGradient(report, all);
  addStepCondition(report, all);
  addAllowedStep(report, all);
  addDistance(report, all);
  addDistanceStep(report, all);
  addEntryBound(report, all);
  return all;
}

}  // namespace pmeta
