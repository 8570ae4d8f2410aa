#pragma once

#include <memory>
#include <string>

#include "bench_util.h"
#include "pmeta_core/baselines/pearl.h"
#include "sac_update.h"

namespace bench {

/// Two tasks of numbers that have no meaning, of the size of a half-cheetah's.
class NoiseFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int) const override { return "noise"; }
  std::string taskDescription(int) const override { return "noise"; }
  std::unique_ptr<pmeta::Env> create(int) const override {
    return std::make_unique<NoiseEnv>(20, 6);
  }
};

/// PEARL's update with its default settings, after its warm-up.
class PearlUpdate {
 public:
  PearlUpdate()
      : learner_({std::make_shared<NoiseFamily>()}, settings()),
        rng_(0, 0, pmeta::Stream::kSample) {
    pmeta::Model model(learner_.policies().layout());
    pmeta::Rng initial(0, 0, pmeta::Stream::kInitialise);
    learner_.policies().initialise(model, initial);
    learner_.setModel(model);
    learner_.iterate(0, 0);
  }

  void operator()() { learner_.update(rng_); }

  std::size_t rows() const {
    return static_cast<std::size_t>(settings().meta_batch * settings().task_batch);
  }

  /// Products that no implementation can leave out: those of bench::SacUpdate, each critic's
  /// gradient by z, and the encoder forward, its weights' gradient and its activations'.
  double flops() const {
    const pmeta::SacNetworks& n = learner_.networks();
    const auto h = static_cast<double>(settings().sac.hidden.front());
    const auto latent = static_cast<double>(n.taskInputSize());
    const double encoder_rows = settings().meta_batch * settings().sac.context.batch_size;
    const auto encoder = static_cast<double>(n.encoder().network().size());
    const double encoder_first = h * static_cast<double>(n.encoder().rowSize());
    return sacFlops(h, static_cast<double>(rows()), static_cast<double>(n.actor().inputs()),
                    static_cast<double>(n.actionSize())) +
           2 * static_cast<double>(rows()) * 2 * latent * h +
           2 * encoder_rows * (3 * encoder - encoder_first);
  }

  /// Floor of the optimiser: critics with targets, the others without.
  double adamSeconds() const {
    const pmeta::SacNetworks& n = learner_.networks();
    return adamFloorSeconds(2 * n.critic(0).size(), 4) +
           adamFloorSeconds(n.actor().size() + n.encoder().network().size(), 3);
  }

 private:
  static pmeta::PearlSettings settings() {
    pmeta::PearlSettings settings;
    settings.updates_per_iteration = 1;
    return settings;
  }

  pmeta::Pearl learner_;
  pmeta::Rng rng_;
};

}  // namespace bench
