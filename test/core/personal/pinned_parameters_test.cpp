#include <gtest/gtest.h>

#include <string>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

// what some updates make of the first parameters, to the last bit
struct Pinned {
  const char* name;
  const char* settings;
  std::uint32_t personal, auxiliary;  // checksums
};

constexpr char kPull[] = "personal: {learning_rate: 0.003, alpha: 0.01, lambda: 15, eta: 0.01}\n";
constexpr char kSac[] =
    "learner: sac\nenvironment: {name: sparse_point_robot, horizon: 20}\n"
    "sac: {hidden: [16, 12], batch_size: 24, buffer_size: 90, warm_up_steps: 60, "
    "context_hidden: [10, 8], latent_size: 3, context_batch: 20, context_buffer: 80, "
    "reward_scale: 5, ";

class Parameters : public ::testing::TestWithParam<Pinned> {
 protected:
  ~Parameters() override { setKernels(kernelNames().front()); }
};

TEST_P(Parameters, AreThoseOfBeforeWhateverTheKernels) {
  std::string text = GetParam().settings;
  const bool networks = text.find("q_learning") == std::string::npos;
  if (text.find("sac.") == 0) text = kSac + text.substr(4) + "}\n";
  if (networks) text += kPull + std::string("arithmetic: portable\n");
  for (const std::string& name : kernelNames()) {
    setKernels(name);
    const auto learner = Experiment::parse(text, "pinned").makeLearner(1);
    for (int round = 1; round <= 3; ++round) {
      learner->beginRound(round == 1 ? learner->initialModel(3) : Model(learner->auxiliary()),
                          round == 3);
      Rng rng(3, 1, Stream::kSample, static_cast<std::uint64_t>(round));
      for (int r = 0; r < 25; ++r) learner->update(rng);
    }
    EXPECT_EQ(learner->personal().checksum(), GetParam().personal) << name;
    EXPECT_EQ(learner->auxiliary().checksum(), GetParam().auxiliary) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Pinned, Parameters,
    ::testing::Values(
        Pinned{"Table", "learner: q_learning\nenvironment: {name: gridworld}\n", 15162901u,
               204597566u},
        Pinned{"Dqn",
               "learner: dqn\nenvironment: {name: cart_pole}\n"
               "dqn: {hidden: [16, 12], batch_size: 24, buffer_size: 150, num_envs: 3, "
               "target_update_interval: 7, epsilon_start: 0.5}\n",
               509889324u, 2122767579u},
        Pinned{"DqnWithEverything",
               "learner: dqn\nenvironment: {name: mountain_car}\n"
               "dqn: {hidden: [16, 12], batch_size: 24, buffer_size: 150, num_envs: 2, "
               "target_update_interval: 7, epsilon_start: 0.5, double_q: true, dueling: true, "
               "huber: true, averaged_targets: 2, env_steps_per_update: 2, "
               "bootstrap_at_limit: false}\n",
               761306991u, 3040657398u},
        Pinned{"SacOneHot", "sac.task_encoding: one_hot, targets_at_round: meta", 1351253202u,
               1897786678u},
        Pinned{"SacAlone", "sac.task_encoding: none, reset_moments: true, temperature: fixed",
               2054386790u, 1866931286u},
        Pinned{
            "SacModel",
            "sac.task_encoding: model, task_model: {hidden: [6], exploring_interval: 2, dynamics: "
            "true}",
            1400345036u, 3027868810u},
        Pinned{"SacInference", "sac.task_encoding: inference, contexts_per_update: 2", 1422353265u,
               1836010079u},
        Pinned{"SacInferenceWithEverything",
               "sac.task_encoding: inference, context_window: 15, context_symlog: true, "
               "context_next_observation: true, context_posterior: true, prior_interval: 3, "
               "context_explorer: personal",
               3477267000u, 509067688u}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace pmeta
