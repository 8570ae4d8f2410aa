#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/experiment/results_dir.h"
#include "pmeta_core/storage/run_log.h"
#include "pmeta_core/theory/convergence.h"

namespace pmeta {
namespace {

std::string shortText(double value) { return significant(value, 4); }

// lines of numbers and words under a header
class CsvText {
 public:
  explicit CsvText(const std::string& header) : text_(header + "\n") {}

  CsvText& add(const std::string& word) {
    const bool plain = word.find(',') == std::string::npos;
    text_ += (line_begun_ ? "," : "") + (plain ? word : '"' + word + '"');
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
      "diversity,sigma,r_max,lambda,slope,shape_ratio,gradient_left,eta,allowed_eta,allowed_factor,"
      "distance2,mean_distance2,lambda2_mean_distance2,gradient_bound,sigma2_squared,entry_"
      "distance2,entry_bound,"
      "entry_ratio");
  for (const DistanceRow& row : report.distance) {
    const DiversityRow& set =
        *std::find_if(report.diversities.begin(), report.diversities.end(),
                      [&](const DiversityRow& one) { return one.diversity == row.diversity; });
    csv.add(set.diversity).add(set.sigma).add(set.r_max).add(row.lambda).add(row.slope);
    csv.add(row.shape_ratio).add(row.gradient_left).add(row.eta).add(row.allowed_eta);
    csv.add(row.allowed_factor).add(row.distance2).add(row.mean_distance2);
    csv.add(row.lambda * row.lambda * row.mean_distance2);
    csv.add(row.gradient_bound).add(row.sigma2_squared).add(row.entry_distance2);
    csv.add(row.entry_bound).add(row.entry_ratio).endLine();
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

std::string range(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return shortText(*low) + ".." + shortText(*high);
}

}  // namespace

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
    out << "  " << padded(set.diversity, 22) << padded(shortText(set.sigma), 8, true) << "   "
        << padded(range(set.sigma1), 16) << padded(range(set.sigma2), 17) << shortText(set.r_max)
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
    out << padded(statement, width + 2) << padded(setting, setting_width)
        << padded(measured, 10, true) << padded(bound, 10, true) << "  " << padded(holds, 5) << "  "
        << remark << "\n";
  };
  out << "\n1, 2a, 2b: Theorems 1, 2(a) and 2(b). l is lambda; \"random, 10\" is a task set and "
         "its "
         "lambda.\n";
  line("Statement", "setting", "measured", "bound", "holds", "");
  std::string previous;
  for (const Statement& s : all) {
    if (s.statement != previous) out << "\n";
    // a claim that stands on many lines is named once
    line(s.statement == previous ? "" : s.statement, s.setting, shortText(s.measured),
         shortText(s.bound), s.holds, s.remark);
    previous = s.statement;
  }
  return out.str();
}

}  // namespace pmeta
