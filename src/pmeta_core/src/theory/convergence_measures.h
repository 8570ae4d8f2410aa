#pragma once

#include <vector>

#include "convergence_tasks.h"
#include "pmeta_core/theory/convergence.h"

namespace pmeta {

/// Contraction of B^ over the tasks of all sets.
ContractionRow measureContraction(const ConvergenceSettings& settings,
                                  const std::vector<KnownTasks>& sets, double lambda);

/// Theorem 1 with expected updates of all entries at once: eq. (per_update_eq), by either sign.
void measureExpected(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                     std::vector<FixedPointRow>& rows);

/// Theorem 1 with sampled updates: eq. (per_update0), by Robbins-Monro and by constant steps.
void measureSampled(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                    std::vector<FixedPointRow>& rows);

/// The step size from which expected updates no longer settle, by bisection.
StepLimitRow measureStepLimit(const ConvergenceSettings& settings, const KnownTasks& set,
                              double lambda);

/// Theorem 2 with exact inner solutions; appends a row for each round.
DistanceRow measureMeta(const ConvergenceSettings& settings, const KnownTasks& set, double lambda,
                        std::vector<GradientRow>& rows);

/// mean_i ||Q_i* - Q||^2 after the last round, with the step size of measureMeta.
double measureDistance(const ConvergenceSettings& settings, const KnownTasks& set, double lambda);

}  // namespace pmeta
