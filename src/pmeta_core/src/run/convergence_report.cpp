#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/run/convergence.h"
#include "pmeta_core/run/experiment.h"
#include "pmeta_core/run/run_log.h"

namespace pmeta {
namespace {

const double kNan = std::numeric_limits<double>::quiet_NaN();

// rounding that a ratio or a fixed point may show
constexpr double kRounding = 1e-12;
// what counts as attaining a bound or meeting a prediction
constexpr double kAttained = 1e-4;
constexpr double kNearLimit = 0.01;
constexpr double kSpread = 0.05;
constexpr double kSpreadFromLambda = 5;

std::string shortNumber(double value) {
  if (std::isnan(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string rounded(double value, int digits = 2) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

// "270x", without an exponent
std::string times(double factor) {
  if (factor >= 100) return std::to_string(std::llround(factor)) + "x";
  return rounded(factor) + "x";
}

std::string yesNo(bool holds) { return holds ? "yes" : "no"; }

std::string lambdaText(double lambda) { return "lambda " + formatNumber(lambda); }

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

// slope of log distance against log K over the last two decades, by least squares
double slopeInSweeps(const std::vector<FixedPointRow>& rows) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const FixedPointRow& row : rows) {
    if (row.sweeps * 100.0 < rows.back().sweeps) continue;
    const double u = std::log(row.sweeps);
    const double v = std::log(row.distance);
    ++n, x += u, y += v, xx += u * u, xy += u * v;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

void addContraction(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const ContractionRow& row : report.contraction) {
    const double worst = std::max(row.worst_pair, row.worst_shift);
    const bool attained = worst >= row.bound * (1 - kAttained);
    all.push_back({"Contraction: ratio at most gamma/(1+lambda)", lambdaText(row.lambda), worst,
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
    all.push_back({"1: so does the sign as printed (+)", lambdaText(lambda), distance, kRounding,
                   yesNo(distance <= kRounding),
                   "after " + std::to_string(printed.back().sweeps) + " sweeps"});
  }
  for (const std::string update : {"robbins_monro", "constant"}) {
    const bool shrinking = update == "robbins_monro";
    for (const double lambda : f.lambdas) {
      const std::vector<FixedPointRow> rows = run(report, update, lambda);
      const double slope = slopeInSweeps(rows);
      all.push_back({shrinking ? "1: sampled; steps n^-" + formatNumber(f.step_exponent) +
                                     ": slope of distance in K"
                               : "1: sampled; constant step: the same slope",
                     lambdaText(lambda), slope, -f.step_exponent / 2,
                     yesNo(slope <= -f.step_exponent / 4),
                     (shrinking ? "reaches " : "stalls at ") + rounded(rows.back().distance)});
    }
  }
}

void addStepLimit(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const StepLimitRow& row : report.step_limit) {
    const double excess = row.measured / row.predicted - 1;
    std::string remark = "attained";
    if (excess > kNearLimit) remark = "stable " + rounded(100 * excess) + "% further";
    if (excess < -kNearLimit) remark = "diverges earlier";
    all.push_back({"1: alpha(1+lambda) stable up to 2(1+l)/(1+l+g)", lambdaText(row.lambda),
                   row.measured, row.predicted, yesNo(excess >= -kNearLimit), remark});
  }
}

void addGradient(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DistanceRow& row : report.distance) {
    const bool holds = row.slope <= -0.5 && row.shape_excess <= 1;
    all.push_back({"2a: running mean |grad L|^2 falls as the bound",
                   row.diversity + " " + formatNumber(row.lambda), row.slope, -0.5,
                   std::isnan(row.allowed_eta) ? "n/a" : yesNo(holds),
                   std::isnan(row.allowed_eta) ? "needs lambda^2 > 8" : "slope in C"});
  }
}

void addStepCondition(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DistanceRow* row : rowsOf(report, report.diversities.front().diversity)) {
    Statement s{"2a: its step condition; eta used and allowed",
                lambdaText(row->lambda),
                row->eta,
                row->allowed_eta,
                "n/a",
                "needs lambda^2 > 8"};
    if (!std::isnan(row->allowed_eta)) {
      const double factor = row->eta / row->allowed_eta;
      s.holds = yesNo(factor <= 1);
      s.remark = factor <= 1 ? "step allowed" : "step " + times(factor) + " larger";
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
  for (const DistanceRow& row : report.distance) {
    if (std::isnan(row.allowed_eta)) continue;
    all.push_back({"2a: |grad L|^2 left after 10 rounds; eta allowed",
                   row.diversity + " " + formatNumber(row.lambda), row.allowed_factor,
                   factorInUse(report, row), yesNo(row.allowed_factor <= 1),
                   "bound: eta used"});
  }
}

void addDistance(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DiversityRow& set : report.diversities) {
    double low = std::numeric_limits<double>::infinity();
    double high = 0;
    for (const DistanceRow* row : rowsOf(report, set.diversity)) {
      if (row->lambda < kSpreadFromLambda) continue;
      const double scaled = row->lambda * row->lambda * row->distance2;
      low = std::min(low, scaled);
      high = std::max(high, scaled);
    }
    if (high == 0) continue;
    all.push_back({"2b: lambda^2 mean|Q_i*-Q|^2 constant from 5 on", set.diversity, high / low - 1,
                   kSpread, yesNo(high / low - 1 <= kSpread),
                   shortNumber(low) + " to " + shortNumber(high)});
  }
}

void addDistanceStep(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DiversityRow& set : report.diversities) {
    const std::vector<const DistanceRow*> rows = rowsOf(report, set.diversity);
    const auto ratio = [](const DistanceRow* row) { return row->gradient_bound / row->distance2; };
    const DistanceRow* tightest =
        *std::min_element(rows.begin(), rows.end(),
                          [&](auto* a, auto* b) { return ratio(a) < ratio(b); });
    all.push_back({"2b: mean|Q_i*-Q|^2 <= 2/l^2 mean|grad L_i|^2",
                   set.diversity + " " + formatNumber(tightest->lambda), tightest->distance2,
                   tightest->gradient_bound, yesNo(ratio(tightest) >= 1),
                   "bound " + shortNumber(ratio(tightest)) + "x loose"});
  }
}

void addEntryBound(const ConvergenceReport& report, std::vector<Statement>& all) {
  for (const DistanceRow& row : report.distance) {
    if (std::isnan(row.entry_bound)) continue;
    all.push_back({"2b: full bound; largest over (s;a)",
                   row.diversity + " " + formatNumber(row.lambda), row.entry_distance2,
                   row.entry_bound, yesNo(row.entry_ratio <= 1),
                   "bound " + times(row.entry_bound / row.entry_distance2) + " loose"});
  }
}

// lines of numbers and words under a header
class CsvText {
 public:
  explicit CsvText(const std::string& header) : text_(header + "\n") {}

  CsvText& add(const std::string& word) {
    text_ += (line_begun_ ? "," : "") + word;
    line_begun_ = true;
    return *this;
  }
  CsvText& add(double value) { return add(std::isnan(value) ? "nan" : formatNumber(value)); }
  void endLine() {
    text_ += "\n";
    line_begun_ = false;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
  bool line_begun_ = false;
};

std::string contractionCsv(const ConvergenceReport& report) {
  CsvText csv("lambda,pairs,worst_pair,worst_shift,bound");
  for (const ContractionRow& row : report.contraction) {
    csv.add(row.lambda).add(row.pairs).add(row.worst_pair).add(row.worst_shift).add(row.bound);
    csv.endLine();
  }
  return csv.text();
}

std::string fixedPointCsv(const ConvergenceReport& report) {
  CsvText csv("lambda,update,sweeps,distance");
  for (const FixedPointRow& row : report.fixed_point) {
    csv.add(row.lambda).add(row.update).add(row.sweeps).add(row.distance).endLine();
  }
  return csv.text();
}

std::string stepLimitCsv(const ConvergenceReport& report) {
  CsvText csv("lambda,measured,predicted");
  for (const StepLimitRow& row : report.step_limit) {
    csv.add(row.lambda).add(row.measured).add(row.predicted).endLine();
  }
  return csv.text();
}

std::string gradientCsv(const ConvergenceReport& report) {
  CsvText csv("diversity,lambda,step,eta,round,grad_norm2,running_mean,shape,distance2");
  for (const GradientRow& row : report.gradient) {
    csv.add(row.diversity).add(row.lambda).add(row.allowed ? "allowed" : "used").add(row.eta);
    csv.add(row.round).add(row.grad_norm2).add(row.running_mean).add(row.shape);
    csv.add(row.distance2).endLine();
  }
  return csv.text();
}

std::string distanceCsv(const ConvergenceReport& report) {
  CsvText csv(
      "diversity,sigma,r_max,lambda,slope,shape_excess,eta,allowed_eta,allowed_factor,distance2,"
      "lambda2_distance2,gradient_bound,sigma2_squared,entry_distance2,entry_bound,entry_ratio");
  for (const DiversityRow& set : report.diversities) {
    for (const DistanceRow* row : rowsOf(report, set.diversity)) {
      csv.add(set.diversity).add(set.sigma).add(set.r_max).add(row->lambda).add(row->slope);
      csv.add(row->shape_excess).add(row->eta).add(row->allowed_eta).add(row->allowed_factor);
      csv.add(row->distance2).add(row->lambda * row->lambda * row->distance2);
      csv.add(row->gradient_bound).add(row->sigma2_squared).add(row->entry_distance2);
      csv.add(row->entry_bound).add(row->entry_ratio).endLine();
    }
  }
  return csv.text();
}

std::string statementsCsv(const ConvergenceReport& report) {
  CsvText csv("statement,setting,measured,bound,holds,remark");
  for (const Statement& s : convergenceStatements(report)) {
    csv.add(s.statement).add(s.setting).add(s.measured).add(s.bound).add(s.holds).add(s.remark);
    csv.endLine();
  }
  return csv.text();
}

std::string manifestText(const ConvergenceReport& report) {
  nlohmann::ordered_json manifest;
  manifest["experiment"] = report.settings.experiment;
  manifest["run_id"] = report.settings.run_id;
  manifest["seed"] = report.settings.seed;
  manifest["status"] = "finished";
  manifest["ended"] = utcTime();
  manifest["commit"] = commit();
  manifest["versions"] = versions();
  manifest["task_sets"] = nlohmann::ordered_json::array();
  for (const DiversityRow& set : report.diversities) {
    nlohmann::ordered_json tasks = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < set.names.size(); ++i) {
      tasks.push_back({{"task", i},
                       {"name", set.names[i]},
                       {"description", set.descriptions[i]},
                       {"sigma_1", set.sigma1[i]},
                       {"sigma_2", set.sigma2[i]}});
    }
    manifest["task_sets"].push_back({{"diversity", set.diversity},
                                     {"sigma", set.sigma},
                                     {"r_max", set.r_max},
                                     {"tasks", tasks}});
  }
  return manifest.dump(2) + "\n";
}

std::string padded(const std::string& text, std::size_t width, bool right = false) {
  const std::string blanks(width > text.size() ? width - text.size() : 0, ' ');
  return right ? blanks + text : text + blanks;
}

std::string range(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return shortNumber(*low) + ".." + shortNumber(*high);
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

std::vector<CsvFile> convergenceCsv(const ConvergenceReport& report) {
  return {{"contraction.csv", contractionCsv(report)}, {"fixed_point.csv", fixedPointCsv(report)},
          {"step_limit.csv", stepLimitCsv(report)},    {"gradient.csv", gradientCsv(report)},
          {"distance.csv", distanceCsv(report)},       {"statements.csv", statementsCsv(report)}};
}

void writeConvergence(const ConvergenceReport& report, const std::string& dir) {
  if (std::filesystem::exists(dir + "/manifest.json")) {
    throw Error("the run folder " + dir + " already holds a run: choose another run_id.");
  }
  requireWritable(dir);
  writeFileAtomically(dir + "/config.yaml", convergenceYaml(report.settings));
  for (const CsvFile& file : convergenceCsv(report)) {
    writeFileAtomically(dir + "/" + file.name, file.text);
  }
  // last: a folder with a manifest is a whole run
  writeFileAtomically(dir + "/manifest.json", manifestText(report));
}

std::string convergenceTable(const ConvergenceReport& report) {
  std::ostringstream out;
  out << "Task sets (Assumption 1)   sigma   sigma_1,i       sigma_2,i        R_max\n";
  for (const DiversityRow& set : report.diversities) {
    out << "  " << padded(set.diversity, 22) << padded(shortNumber(set.sigma), 8, true) << "   "
        << padded(range(set.sigma1), 16) << padded(range(set.sigma2), 17) << shortNumber(set.r_max)
        << "\n";
  }

  const std::vector<Statement> all = convergenceStatements(report);
  std::size_t width = 0;
  std::size_t setting_width = 0;
  for (const Statement& s : all) {
    width = std::max(width, s.statement.size());
    setting_width = std::max(setting_width, s.setting.size());
  }
  const auto line = [&](const std::string& statement, const std::string& setting,
                        const std::string& measured, const std::string& bound,
                        const std::string& holds, const std::string& remark) {
    out << padded(statement, width + 2) << padded(setting, setting_width) << padded(measured, 11, true)
        << padded(bound, 11, true) << "  " << padded(holds, 5) << "  " << remark << "\n";
  };
  out << "\n";
  line("Statement", "setting", "measured", "bound", "holds", "");
  std::string previous;
  for (const Statement& s : all) {
    if (s.statement != previous) out << "\n";
    // a claim that stands on many lines is named once
    line(s.statement == previous ? "" : s.statement, s.setting, shortNumber(s.measured),
         shortNumber(s.bound), s.holds, s.remark);
    previous = s.statement;
  }
  return out.str();
}

}  // namespace pmeta
