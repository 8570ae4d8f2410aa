#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "pmeta_core/act/policy_family.h"
#include "pmeta_core/adapt/adaptation.h"

namespace pmeta {

/// No adaptation: the policy is told the task, or acts alike on all, and exploring changes nothing.
class Told : public Adaptation {
 public:
  /// `policies` and `policy` must outlive it.
  Told(const PolicyFamily& policies, const Model& policy, std::vector<float> task_input)
      : policies_(policies),
        policy_(policy),
        task_input_(std::move(task_input)),
        acting_(adapted(1)) {}

  void beginEpisode(Rng&) override {}
  void episodeOver() override {}
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    acting_->look(observations, envs);
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    return acting_->act(row, rng, action);
  }
  std::unique_ptr<Actor> adapted(std::size_t max_batch) const override {
    return policies_.actor(policy_, task_input_, max_batch);
  }
  std::vector<float> taskInput() const override { return task_input_; }

 private:
  const PolicyFamily& policies_;
  const Model& policy_;
  std::vector<float> task_input_;
  std::unique_ptr<Actor> acting_;
};

}  // namespace pmeta
