#pragma once

#include "pmeta_core/baselines/adam.h"
#include "pmeta_core/baselines/maml.h"

namespace pmeta {

/// Settings of ProMP.
struct ProMpSettings {
  MamlSettings maml;             ///< of sampling and inner step
  double clip = 0.3;             ///< of the likelihood ratio after it
  double learning_rate = 1e-3;   ///< Adam's
  int meta_steps = 5;            ///< of Adam, an iteration
  double kl_coefficient = 5e-4;  ///< eta, of the KL before the inner step
  double kl_target = 0;          ///< that eta follows; 0: it stays
};

/// Binds all of them below `prefix`, e.g. "promp.".
void bind(Settings& settings, const std::string& prefix, ProMpSettings& promp);

/// ProMP: proximal meta-policy search (Rothfuss et al., 2019, algorithm 1). Steps of Adam on
///
///     mean over tasks of [ - mean min(r A', clip(r) A') + eta KL(old || pi_theta) ],
///
/// r the likelihood ratio of the adapted policy after the inner step, the KL on the data before it;
/// the inner step is made again from the current theta before each.
class ProMp : public Maml {
 public:
  /// As Maml.
  ProMp(const MetaTasks& tasks, const ProMpSettings& settings);

  void saveState(StateWriter& writer) const override;
  /// Refuses what no saveState() of one with these settings gives.
  void loadState(StateReader& reader) override;

 private:
  std::int64_t metaStep(InnerStepObjective& objective, std::vector<double>& theta,
                        std::vector<Loss>& losses) override;
  double loss(const InnerStepObjective& objective) const;
  void gradient(const InnerStepObjective& objective, double* gradient) const;

  ProMpSettings settings_;
  double kl_coefficient_;
  Adam adam_;
};

}  // namespace pmeta
