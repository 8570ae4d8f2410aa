#include "pmeta_core/baselines/maml_trpo.h"

namespace pmeta {

void bind(Settings& settings, const std::string& prefix, MamlTrpoSettings& maml) {
  bind(settings, prefix, maml.maml);
  TrustRegionSettings& region = maml.trust_region;
  settings.bind(prefix + "max_kl", region.max_kl,
                "most KL of the adapted policies from those that sampled, a step", Range::above(0));
  settings.bind(prefix + "damping", region.damping, "added to the diagonal of the KL's Hessian",
                Range::atLeast(0));
  settings.bind(prefix + "cg_iterations", region.cg_iterations, "of conjugate gradients",
                Range::between(1, 1000));
  settings.bind(prefix + "backtracks", region.backtracks,
                "step lengths that are tried; if none is good the parameters stay",
                Range::between(1, 100));
  settings.bind(prefix + "backtrack_ratio", region.backtrack_ratio, "from one of them to the next",
                Range{0, 1, true, true});
}

MamlTrpo::MamlTrpo(const MetaTasks& tasks, const MamlTrpoSettings& settings)
    : Maml(tasks, settings.maml), settings_(settings) {}

TrustRegionStep trustRegionStep(InnerStepObjective& objective, const Vector& theta,
                                const TrustRegionSettings& settings) {
  Vector gradient(theta.size());
  objective.gradient(Surrogate::kRatio, gradient.data());
  const auto kl_product = [&](const Vector& v) {
    Vector product(v.size());
    objective.klProduct(v.data(), product.data());
    return product;
  };
  const auto evaluate = [&](const Vector& candidate) {
    objective.at(candidate.data());
    return TriedStep{objective.loss(Surrogate::kRatio), objective.kl()};
  };
  return trustRegionStep(theta, gradient, objective.loss(Surrogate::kRatio), kl_product, evaluate,
                         settings);
}

std::int64_t MamlTrpo::metaStep(InnerStepObjective& objective, std::vector<double>& theta,
                                std::vector<Loss>& losses) {
  const TrustRegionStep step = trustRegionStep(objective, theta, settings_.trust_region);
  theta = step.parameters;
  const TriedStep last = step.accepted ? step.tried.back() : TriedStep{0, 0};
  losses.push_back({"surrogate", last.loss});
  losses.push_back({"kl", last.kl});
  losses.push_back({"step_lengths_tried", static_cast<double>(step.tried.size())});
  return 1;
}

namespace {

struct MamlTrpoKind : MamlKind<MamlTrpo, MamlTrpoSettings> {
  MamlTrpoKind() : MamlKind("maml_trpo.") {}
};

const RegisteredMetaLearner<MamlTrpoKind> kMamlTrpo(
    "maml_trpo", "MAML-TRPO",
    "all tasks in one process: parameters that one gradient step adapts, "
    "moved within a trust region",
    "gaussian_mlp");

}  // namespace
}  // namespace pmeta
