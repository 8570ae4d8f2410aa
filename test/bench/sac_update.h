#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "bench_util.h"
#include "pmeta_core/learn/sac.h"
#include "pmeta_core/personal/proximal_adam.h"

namespace bench {

/// Costs nothing to step: numbers of the size of a locomotion task's.
class NoiseEnv : public pmeta::Env {
 public:
  NoiseEnv(int observation_size, int action_size) {
    spec_.name = "noise";
    spec_.observation_size = observation_size;
    spec_.action_size = action_size;
    spec_.horizon = 200;
  }
  const pmeta::EnvSpec& spec() const override { return spec_; }
  void reset(pmeta::Rng& rng, double* observation) override {
    steps_ = 0;
    observe(rng, observation);
  }
  pmeta::Step step(const double* action, pmeta::Rng& rng, double* observation) override {
    observe(rng, observation);
    return {action[0] * observation[0], false, ++steps_ == spec_.horizon};
  }

 private:
  void observe(pmeta::Rng& rng, double* observation) const {
    for (int k = 0; k < spec_.observation_size; ++k) observation[k] = 2 * rng.uniform() - 1;
  }
  pmeta::EnvSpec spec_;
  int steps_ = 0;
};

/// Operations in products that no implementation of the update can leave out, without an encoder's:
/// per sample each critic forward three times (target, loss, actor's step) and its weights'
/// gradient, its activations' gradient once for the loss and, for one critic of two, once for the
/// actor; the actor forward twice, and back. Two hidden layers of h units; `in`: the actor's
/// inputs.
inline double sacFlops(double h, double batch, double in, double action) {
  const double first = (in + action) * h, rest = h * h + h;
  const double actor_first = in * h, actor_rest = h * h + 2 * action * h;
  const double critics = 8 * (first + rest) + 3 * rest + action * h;
  const double actor = 3 * (actor_first + actor_rest) + actor_rest;
  return 2 * batch * (critics + actor);
}

/// SacLearner's update by Adam with pull, auxiliary and targets: actor and twin critics of two
/// hidden layers of `units`, 25 observations, 6 actions. peers.py does the same in PyTorch.
class SacUpdate {
 public:
  SacUpdate(std::size_t units, std::size_t batch, const std::string& task_encoding,
            bool portable = false)
      : learner(std::make_unique<NoiseEnv>(25, 6), settings(units, batch, task_encoding, portable)),
        rng(0, 0, pmeta::Stream::kSample),
        phi(learner.networks().size()),
        omega(phi),
        optimizer(phi.data(), omega.data(), phi.size(), pull()) {
    pmeta::Rng initial(0, 0, pmeta::Stream::kInitialise);
    learner.networks().initialise(phi.data(), initial);
    omega = phi;
    learner.resetTargets(phi.data());
    learner.collect(phi.data(), rng);
  }

  void operator()() {
    optimizer.beginUpdate();
    learner.update(phi.data(), optimizer, rng);
  }

  void collect() { learner.collect(phi.data(), rng); }

  double flops() const {
    return sacFlops(static_cast<double>(learner.settings().hidden.front()),
                    static_cast<double>(learner.settings().batch_size),
                    static_cast<double>(learner.networks().actor().inputs()),
                    static_cast<double>(learner.networks().actionSize()));
  }

  /// Floor of the optimiser: critics with targets, the actor without.
  double adamSeconds() const {
    const pmeta::SacNetworks& n = learner.networks();
    return adamFloorSeconds(2 * n.critic(0).size(), 5) + adamFloorSeconds(n.actor().size(), 4);
  }

  pmeta::SacLearner learner;
  pmeta::Rng rng;
  pmeta::AlignedFloats phi, omega;
  pmeta::ProximalAdam optimizer;

 private:
  static pmeta::SacSettings settings(std::size_t units, std::size_t batch,
                                     const std::string& task_encoding, bool portable) {
    pmeta::SacSettings settings;
    settings.portable = portable;
    settings.hidden.assign(2, static_cast<int>(units));
    settings.batch_size = static_cast<int>(batch);
    settings.task_encoding = task_encoding;
    return settings;
  }
  static pmeta::ProximalAdamSettings pull() {
    pmeta::ProximalAdamSettings settings;
    settings.lambda = 15;
    settings.eta = 1e-2;
    return settings;
  }
};

}  // namespace bench
