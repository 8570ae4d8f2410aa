// ProMP: proximal meta-policy search (Rothfuss et al., 2019).
#include <algorithm>
#include <cmath>
#include <numeric>

#include "pmeta_core/baselines/adam.h"
#include "pmeta_core/baselines/promp.h"

namespace pmeta {

void bind(Settings& settings, const std::string& prefix, ProMpSettings& promp) {
  bind(settings, prefix, promp.maml);
  settings.bind(prefix + "clip", promp.clip,
                "likelihood ratios count as within 1 +- clip where they would gain beyond",
                Range::above(0));
  settings.bind(prefix + "learning_rate", promp.learning_rate, "Adam's", Range::above(0));
  settings.bind(prefix + "meta_steps", promp.meta_steps,
                "steps of Adam an iteration, on all of its data", Range::between(1, 1e4));
  settings.bind(prefix + "kl_coefficient", promp.kl_coefficient,
                "weight of the KL from the policy that sampled before the inner step",
                Range::atLeast(0));
  settings.bind(prefix + "kl_target", promp.kl_target,
                "the weight is halved where that KL is less than two thirds of this, doubled where "
                "it is more than one and a half times; 0: it stays",
                Range::atLeast(0));
}

ProMp::ProMp(const MetaTasks& tasks, const ProMpSettings& settings)
    : Maml(tasks, settings.maml),
      settings_(settings),
      kl_coefficient_(settings.kl_coefficient),
      adam_(policy().size(), settings.learning_rate) {}

double ProMp::loss(const InnerStepObjective& objective) const {
  const std::vector<double> kls = objective.innerKl();
  return objective.loss(Surrogate::kClippedRatio, settings_.clip) +
         kl_coefficient_ * std::accumulate(kls.begin(), kls.end(), 0.0) /
             static_cast<double>(kls.size());
}

void ProMp::gradient(const InnerStepObjective& objective, double* gradient) const {
  objective.gradient(Surrogate::kClippedRatio, gradient, settings_.clip);
  std::vector<double> of_kl(policy().size());
  objective.innerKlGradient(of_kl.data());
  for (std::size_t k = 0; k < of_kl.size(); ++k) gradient[k] += kl_coefficient_ * of_kl[k];
}

std::int64_t ProMp::metaStep(InnerStepObjective& objective, std::vector<double>& theta,
                             std::vector<Loss>& losses) {
  std::vector<double> gradient(theta.size());
  for (int k = 0; k < settings_.meta_steps; ++k) {
    this->gradient(objective, gradient.data());
    adam_.step(theta.data(), gradient.data());
    objective.at(theta.data());
  }
  const std::vector<double> kls = objective.innerKl();
  const double kl = std::accumulate(kls.begin(), kls.end(), 0.0) / static_cast<double>(kls.size());
  losses.push_back({"surrogate", loss(objective)});
  losses.push_back({"kl", kl});
  if (settings_.kl_target > 0) {
    if (kl < settings_.kl_target / 1.5) kl_coefficient_ /= 2;
    if (kl > settings_.kl_target * 1.5) kl_coefficient_ *= 2;
  }
  return settings_.meta_steps;
}

void ProMp::saveState(StateWriter& writer) const {
  Maml::saveState(writer);
  writer.value("kl_coefficient", kl_coefficient_);
  writer.part("adam", adam_);
}

void ProMp::loadState(StateReader& reader) {
  Maml::loadState(reader);
  kl_coefficient_ = reader.finite("kl_coefficient");
  reader.part("adam", adam_);
}

namespace {

struct ProMpKind : MamlKind<ProMp, ProMpSettings> {
  ProMpKind() : MamlKind("promp.") {}
};

const RegisteredMetaLearner<ProMpKind> kProMp(
    "promp", "ProMP",
    "all tasks in one process: parameters that one gradient step adapts, moved by "
    "a clipped surrogate",
    "gaussian_mlp");

}  // namespace
}  // namespace pmeta
