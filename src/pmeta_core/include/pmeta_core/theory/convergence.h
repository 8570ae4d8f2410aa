#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace pmeta {

/// What the convergence experiment measures and on which tasks, with defaults.
struct ConvergenceSettings {
  std::string experiment = "convergence";  ///< names the results folder
  std::int64_t seed = 0;      ///< of tables, samples and random landmarks: one seed, one report
  std::string results_dir;    ///< "" means $ROS_HOME/pmeta, by default ~/.ros/pmeta
  std::string run_id;         ///< "" means one made of the start time and seed
  double gamma = 0.9;         ///< discount
  int rounds = 120;           ///< C
  int updates_per_round = 3;  ///< R: exact auxiliary steps a round
  /// Where the landmarks lie, one task set each: corner, centre, random, random_slip.
  std::vector<std::string> diversities = {"corner", "centre", "random"};

  /// How much the personalised backup contracts: by gamma / (1 + lambda).
  struct Contraction {
    std::vector<double> lambdas = {0, 1, 5, 10, 20, 50};  ///< strengths of the pull, each measured
    int pairs = 2000;  ///< random pairs of tables for each lambda
  } contraction;       ///< of ContractionRow and StepLimitRow

  /// Theorem 1: the personalised update finds its fixed point.
  struct FixedPoint {
    std::string diversity = "random";          ///< the task set of Theorem 1
    std::vector<double> lambdas = {0, 1, 10};  ///< strengths of the pull, each measured
    int sweeps = 10000;          ///< K: each draws as many samples as the task owns entries
    double slip = 0.2;           ///< makes transitions random where environment.slip is 0
    double step_exponent = 0.8;  ///< w of alpha (1 + lambda) = visits^-w, in (0.5, 1]
    double constant_step = 0.1;  ///< alpha (1 + lambda) of the run beside it
  } fixed_point;                 ///< of FixedPointRow

  /// Theorem 2: the meta iteration settles, near the personal policies.
  struct Meta {
    /// Strengths of the pull, each measured; positive.
    std::vector<double> lambdas = {1, 5, 10, 20, 50};
    double eta_cap = 0.1;  ///< eta = min(eta_cap, 1 / lambda)
    double beta = 1;       ///< mixing: meta <- (1 - beta) meta + beta mean
    int draws = 8;         ///< task sets that the mean distance is over, where landmarks are random
  } meta;                  ///< of GradientRow and DistanceRow

  std::string environment = "gridworld";     ///< of the tasks; there is one choice
  std::vector<int> sizes = {4, 5, 6, 7, 8};  ///< cells along each side, one task each
  std::vector<double> slip = {0};  ///< probability of a random move: one number, or one a task
  double slip_spread = 0.4;  ///< random_slip: slip runs from 0 (first task) to this (last task)
};

/// Reads a settings file and applies "key:=value" overrides; throws Error. results_dir and run_id
/// come out filled in.
ConvergenceSettings loadConvergence(const std::string& path,
                                    const std::vector<std::string>& overrides = {});

/// The same from YAML text; `source` names it in errors.
ConvergenceSettings parseConvergence(const std::string& text, const std::string& source,
                                     const std::vector<std::string>& overrides = {});

/// All settings as YAML; parseConvergence() of it gives the same settings.
std::string convergenceYaml(const ConvergenceSettings& settings);

/// Every setting for people: its value, the default where that is another, and its meaning.
std::string describeConvergence(const ConvergenceSettings& settings);

/// RESULTS_DIR/EXPERIMENT/RUN_ID
std::string convergenceDir(const ConvergenceSettings& settings);

/// One task set, and how far its tasks differ by Assumption 1. Means run over the tasks that own an
/// entry, bounds are taken on absolute differences, and the terminal state is a state of its own.
struct DiversityRow {
  std::string diversity;  ///< which of ConvergenceSettings::diversities
  double sigma = 0;       ///< sigma^2 = mean_i (sigma_1,i + sigma_2,i gamma / (1 - gamma) R_max)^2
  double r_max = 0;       ///< largest |r| of any task
  std::vector<std::string> names;         ///< of the tasks
  std::vector<std::string> descriptions;  ///< of the tasks
  std::vector<double> sigma1;             ///< max |R_i - mean R| of each task
  std::vector<double> sigma2;             ///< max |P_i - mean P| of each task
};

/// Largest ||B^Q1 - B^Q2|| / ||Q1 - Q2|| (max norm) over all task sets, where
/// B^Q = (lambda Q_meta + r + gamma E max Q) / (1 + lambda).
struct ContractionRow {
  double lambda = 0;       ///< strength of the pull
  int pairs = 0;           ///< of random tables, spread over the tasks of all sets
  double worst_pair = 0;   ///< over random pairs
  double worst_shift = 0;  ///< over constant shifts Q2 = Q1 + c, one for each task
  double bound = 0;        ///< gamma / (1 + lambda)
};

/// Distance to the fixed point of B^ (max norm, worst task) with a frozen random meta table. The
/// fixed point comes from policy iteration with linear solves, which shares no code with the
/// iterations measured.
struct FixedPointRow {
  double lambda = 0;    ///< strength of the pull
  std::string update;   ///< exact, plus_sign (as printed), robbins_monro or constant
  int sweeps = 0;       ///< K
  double distance = 0;  ///< after those sweeps
};

/// alpha (1 + lambda) from which the expected iteration with a frozen meta table no longer settles.
struct StepLimitRow {
  double lambda = 0;     ///< strength of the pull
  double measured = 0;   ///< by bisection; the limit of the first task that does not settle
  double predicted = 0;  ///< 2 (1 + lambda) / (1 + lambda + gamma)
};

/// One round of the meta iteration with exact inner solutions.
struct GradientRow {
  std::string diversity;    ///< which of ConvergenceSettings::diversities
  double lambda = 0;        ///< strength of the pull
  double eta = 0;           ///< auxiliary step size of this run
  bool allowed = false;     ///< eta is the one the theorem allows, else the one in use
  int round = 0;            ///< 1..C
  double grad_norm2 = 0;    ///< ||grad L(Q)||^2 of the Q that the round starts from, all entries
  double running_mean = 0;  ///< of grad_norm2 over the rounds so far
  double shape = 0;         ///< 1/c + c^(-2/3) + c^(-1/2): the bound of Theorem 2(a) as a shape
  double distance2 = 0;     ///< mean_i ||Q_i* - Q||^2
};

/// Theorem 2(b) at the end of the last round, and the step size that the theorem asks for.
/// Values are NaN where lambda^2 <= 8 and the theorem says nothing.
struct DistanceRow {
  std::string diversity;       ///< which of ConvergenceSettings::diversities
  double lambda = 0;           ///< strength of the pull
  double slope = 0;            ///< of the running mean, log-log, over the rounds from 10 on
  double shape_ratio = 0;      ///< running_mean / shape of the last round over that of round 10
  double gradient_left = 0;    ///< ||grad L||^2 after the last round over that before the first
  double eta = 0;              ///< in use
  double allowed_eta = 0;      ///< the largest that satisfies the theorem's step condition
  double allowed_factor = 0;   ///< ||grad L||^2 after 10 rounds at allowed_eta over that before
  double distance2 = 0;        ///< mean_i ||Q_i* - Q||^2
  double mean_distance2 = 0;   ///< the same, mean over the draws of the task set
  double gradient_bound = 0;   ///< 2 / lambda^2 mean_i ||grad L_i||^2
  double sigma2_squared = 0;   ///< sigma_2^2 of the theorem
  double entry_distance2 = 0;  ///< largest mean_i |Q_i* - Q|^2 of one (s,a)
  double entry_bound = 0;      ///< 2/(lambda^2-8) |grad L|^2 + 2 sigma_2^2 / lambda^2 at that entry
  double entry_ratio = 0;      ///< largest of the two's ratio over all entries and rounds
};

/// All that measureConvergence() has found, a row for each line of the CSV files.
struct ConvergenceReport {
  ConvergenceSettings settings;             ///< that it was measured with
  std::vector<DiversityRow> diversities;    ///< by task set
  std::vector<ContractionRow> contraction;  ///< by lambda
  std::vector<FixedPointRow> fixed_point;   ///< by lambda, update and number of sweeps
  std::vector<StepLimitRow> step_limit;     ///< by lambda
  std::vector<GradientRow> gradient;        ///< by task set, lambda, step size and round
  std::vector<DistanceRow> distance;        ///< by task set and lambda
};

/// One claim of the paper against its measurement.
struct Statement {
  std::string statement;  ///< what the paper says, in short
  std::string setting;    ///< task set and strength that it was measured at
  double measured = 0;    ///< what `statement` speaks of, as measured
  double bound = 0;       ///< bound or prediction; NaN if there is none
  std::string holds;      ///< yes, no or n/a
  std::string remark;     ///< what the number alone would hide, e.g. "bound 200x loose"
};

/// What is being measured, and the part of the whole that is done (0 to 1).
using ConvergenceProgress = std::function<void(const std::string& what, double done)>;

/// Measures the paper's theory (Theorems 1 and 2) on tabular tasks with known models. The same
/// settings give the same report bit for bit.
ConvergenceReport measureConvergence(const ConvergenceSettings& settings,
                                     const ConvergenceProgress& progress = {});

/// The claims, in the paper's order.
std::vector<Statement> convergenceStatements(const ConvergenceReport& report);

/// A file of results: its name, and its text.
struct CsvFile {
  std::string name;  ///< without a folder
  std::string text;  ///< with a header line
};

/// contraction.csv, fixed_point.csv, step_limit.csv, gradient.csv, distance.csv, statements.csv.
std::vector<CsvFile> convergenceCsv(const ConvergenceReport& report);

/// Writes the CSV files, config.yaml and manifest.json; throws Error if `dir` holds a run already
/// or cannot be written.
void writeConvergence(const ConvergenceReport& report, const std::string& dir);

/// The task sets and one line for each claim, for a console of 110 columns.
std::string convergenceTable(const ConvergenceReport& report);

}  // namespace pmeta
