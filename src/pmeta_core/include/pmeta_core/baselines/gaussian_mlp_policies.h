#pragma once

#include <memory>
#include <vector>

#include "pmeta_core/act/actor.h"
#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/baselines/gaussian_mlp.h"

namespace pmeta {

/// Acts by a GaussianMlp: an environment is given clip(u / scale, -1, 1), u the mean.
class GaussianMlpActor : public Actor {
 public:
  /// In up to `max_batch` environments at once, by parameters of its own.
  GaussianMlpActor(const GaussianMlp& policy, double scale, std::vector<double> parameters,
                   std::size_t max_batch);

  /// Acts by these from now on.
  void use(std::vector<double> parameters) { parameters_ = std::move(parameters); }
  /// That it acts by.
  const std::vector<double>& parameters() const { return parameters_; }

  void look(const float* observations, const std::vector<std::size_t>& envs) override;
  bool act(std::size_t row, Rng& rng, double* action) override;

 protected:
  /// Writes u of the row-th environment looked at into what `u` will be acted by.
  virtual void draw(const double* mean, Rng& rng, double* u);
  /// What the parameters are of.
  const GaussianMlp& policy() const { return policy_; }

 private:
  const GaussianMlp& policy_;
  double scale_;
  std::vector<double> parameters_;
  std::vector<double> observations_;
  std::vector<double> u_;
  GaussianMlp::Pass pass_;
};

/// Policies of a GaussianMlp, which act by its mean.
class GaussianMlpPolicies : public PolicyFamily {
 public:
  /// `log_std`: to begin with. `scale`: see GaussianMlpActor. Throws Error if actions are discrete.
  GaussianMlpPolicies(const EnvSpec& env, const std::vector<int>& hidden, double log_std,
                      double scale);

  /// What the parameters are of.
  const GaussianMlp& network() const { return network_; }
  /// What divides u.
  double scale() const { return scale_; }

  PolicyForm form() const override;
  std::size_t taskInputSize() const override { return 0; }
  void initialise(Model& parameters, Rng& rng) const override;
  std::unique_ptr<Actor> actor(const Model& parameters, std::vector<float> task_input,
                               std::size_t max_batch) const override;

 private:
  GaussianMlp network_;
  double log_std_;
  double scale_;
};

}  // namespace pmeta
