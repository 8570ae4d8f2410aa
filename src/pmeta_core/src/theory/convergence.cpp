#include "pmeta_core/theory/convergence.h"

#include <algorithm>

#include "convergence_measures.h"
#include "pmeta_core/base/settings.h"

namespace pmeta {
namespace {

// the settings' slip, or one that makes transitions random where there is none
std::vector<double> samplingSlip(const ConvergenceSettings& settings) {
  const bool spread = settings.fixed_point.diversity == "random_slip";
  const double largest = *std::max_element(settings.slip.begin(), settings.slip.end());
  if (spread || largest > 0) return {};
  return {settings.fixed_point.slip};
}

// the further draws of a task set: those of the seeds after the settings' own
std::vector<KnownTasks> furtherDraws(ConvergenceSettings settings, const std::string& diversity) {
  std::vector<KnownTasks> draws;
  if (diversity != "random" && diversity != "random_slip") return draws;
  for (int d = 1; d < settings.meta.draws; ++d) {
    ++settings.seed;
    draws.push_back(makeKnownTasks(settings, diversity));
  }
  return draws;
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
    const std::vector<KnownTasks> draws = furtherDraws(settings, set.diversity.diversity);
    for (const double lambda : settings.meta.lambdas) {
      announce("Theorem 2, " + set.diversity.diversity, lambda);
      DistanceRow row = measureMeta(settings, set, lambda, report.gradient);
      double sum = row.distance2;
      for (const KnownTasks& draw : draws) sum += measureDistance(settings, draw, lambda);
      row.mean_distance2 = sum / static_cast<double>(1 + draws.size());
      report.distance.push_back(row);
    }
  }
  if (progress) progress("done", 1);
  return report;
}

}  // namespace pmeta
