#pragma once

#include "pmeta_core/baselines/maml.h"
#include "pmeta_core/baselines/trust_region.h"

namespace pmeta {

/// Settings of MAML-TRPO.
struct MamlTrpoSettings {
  MamlSettings maml;                 ///< of sampling and inner step
  TrustRegionSettings trust_region;  ///< of the step of theta
};

/// Binds all of them below `prefix`, e.g. "maml_trpo.".
void bind(Settings& settings, const std::string& prefix, MamlTrpoSettings& maml);

/// MAML with a trust-region step (Finn et al., 2017, section 5.3): the surrogate of the adapted
/// policies after the inner step goes down, as far as their KL from those that sampled allows.
class MamlTrpo : public Maml {
 public:
  /// As Maml.
  MamlTrpo(const MetaTasks& tasks, const MamlTrpoSettings& settings);

 private:
  std::int64_t metaStep(InnerStepObjective& objective, std::vector<double>& theta,
                        std::vector<Loss>& losses) override;

  MamlTrpoSettings settings_;
};

/// That step from theta, at which `objective` is; it is anywhere afterwards.
TrustRegionStep trustRegionStep(InnerStepObjective& objective, const Vector& theta,
                                const TrustRegionSettings& settings);

}  // namespace pmeta
