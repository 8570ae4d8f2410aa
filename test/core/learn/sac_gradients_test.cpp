#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>
#include <vector>

#include "pmeta_core/learn/sac.h"
#include "sac_trainer.h"

namespace pmeta {
namespace {

using test::outputs;
using test::smallSettings;
using test::Trainer;
using test::Vector;

Vector concatenated(std::initializer_list<Vector> parts) {
  Vector all;
  for (const Vector& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// one update's draws, repeated from the generator as it was before, and its losses by the equations
class Reference {
 public:
  Reference(const SacLearner& learner, Rng rng)
      : learner_(learner),
        networks_(learner.networks()),
        settings_(learner.settings()),
        alpha_(learner.temperature().value()),
        targets_(learner.targets().begin(), learner.targets().end()) {
    for (int k = 0; networks_.hasEncoder() && k < settings_.context.per_update; ++k) {
      rows_.push_back(context(rng));
      latent_noise_.emplace_back();
      for (std::size_t j = 0; j < 3; ++j) latent_noise_.back().push_back(rng.normal());
    }
    for (int b = 0; b < settings_.batch_size; ++b) {
      const Transition t = learner.replay()[rng.below(learner.replay().size())];
      s_.emplace_back(t.observation, t.observation + 3);
      a_.emplace_back(t.action, t.action + 2);
      next_.emplace_back(t.next_observation, t.next_observation + 3);
      rewards_.push_back(t.reward);
    }
    // for the actions in s, then, where critics have targets, for those in s'
    for (int b = 0; b < (networks_.hasValue() ? 1 : 2) * settings_.batch_size; ++b) {
      const double first = rng.normal();
      noise_.push_back({first, rng.normal()});
    }
  }

  // x of every sample by the parameters p: fixed, or by its encoder the z of the sample's context
  std::vector<Vector> inputs(const Vector& p) const {
    std::vector<Vector> z = {Vector(learner_.taskInput().begin(), learner_.taskInput().end())};
    z.resize(std::max<std::size_t>(1, rows_.size()), z[0]);
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const LatentPosterior q = posterior(p, k);
      for (std::size_t j = 0; j < 3; ++j) {
        z[k][j] = q.mean[j] + std::sqrt(q.variance[j]) * latent_noise_[k][j];
      }
    }
    std::vector<Vector> x;
    for (std::size_t b = 0; b < s_.size(); ++b) x.push_back(z[b * z.size() / s_.size()]);
    return x;
  }

  // mean over the contexts
  double kl(const Vector& p) const {
    double sum = 0;
    for (std::size_t k = 0; k < rows_.size(); ++k) sum += klToPrior(posterior(p, k));
    return sum / static_cast<double>(rows_.size());
  }

  LatentPosterior posterior(const Vector& p, std::size_t context) const {
    LatentPosterior q{Vector(3, 0.0), Vector(3, 0.0)};
    for (const Vector& row : rows_[context]) {
      const Vector heads =
          outputs(networks_.encoder().network(), p.data() + networks_.encoderOffset(), row);
      for (std::size_t j = 0; j < 3; ++j) {
        const double precision = 1 / std::log(1 + std::exp(heads[3 + j]));
        q.variance[j] += precision;
        q.mean[j] += precision * heads[j];
      }
    }
    for (std::size_t j = 0; j < 3; ++j) {
      q.variance[j] = 1 / q.variance[j];
      q.mean[j] *= q.variance[j];
    }
    return q;
  }

  double q(int k, const double* theta, const Vector& s, const Vector& x, const Vector& a) const {
    return outputs(networks_.critic(k), theta, concatenated({s, x, a}))[0];
  }

  double v(const double* theta, const Vector& s, const Vector& x) const {
    return outputs(networks_.value(), theta, concatenated({s, x}))[0];
  }

  // a ~ pi with row b's noise, log pi(a), and the squares that the penalty is on
  Vector action(const Vector& p, const Vector& s, const Vector& x, std::size_t b, double& log_prob,
                double* squares = nullptr) const {
    const Vector heads = outputs(networks_.actor(), p.data(), concatenated({s, x}));
    Vector a(2);
    log_prob = 0;
    for (std::size_t j = 0; j < 2; ++j) {
      const double log_std = std::min(std::max(heads[2 + j], settings_.min_log_std), 2.0);
      const double e = noise_[b][j];
      a[j] = std::tanh(heads[j] + std::exp(log_std) * e);
      log_prob += -0.5 * e * e - log_std - 0.5 * std::log(2 * M_PI) - std::log(1 - a[j] * a[j]);
      if (squares != nullptr) *squares += heads[j] * heads[j] + log_std * log_std;
    }
    return a;
  }

  // y of every sample: terminal by what the environment says, never by its horizon
  Vector y(const Vector& p) const {
    const std::vector<Vector> x = inputs(p);
    Vector result;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      const bool terminal = std::abs(next_[b][0]) > 2.5;
      result.push_back(1.5 * rewards_[b] + (terminal ? 0 : 0.9) * nextValue(p, x[b], b));
    }
    return result;
  }

  double nextValue(const Vector& p, const Vector& x, std::size_t b) const {
    if (networks_.hasValue()) return v(targets_.data(), next_[b], x);
    double log_prob = 0;
    const Vector a = action(p, next_[b], x, s_.size() + b, log_prob);
    const double q1 = q(0, targets_.data(), next_[b], x, a);
    const double q2 = q(1, targets_.data() + networks_.critic(0).size(), next_[b], x, a);
    return std::min(q1, q2) - alpha_ * log_prob;
  }

  double criticLoss(int k, const Vector& p, const std::vector<Vector>& x, const Vector& y) const {
    double sum = 0;
    for (std::size_t b = 0; b < y.size(); ++b) {
      const double e = q(k, p.data() + networks_.criticOffset(k), s_[b], x[b], a_[b]) - y[b];
      sum += e * e;
    }
    return sum / static_cast<double>(y.size());
  }

  // min_k Q_k(s, x, a) - alpha log pi(a) of every sample, with the critics of p
  Vector softValues(const Vector& p, const std::vector<Vector>& x) const {
    Vector values;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      double log_prob = 0;
      const Vector a = action(p, s_[b], x[b], b, log_prob);
      const double q1 = q(0, p.data() + networks_.criticOffset(0), s_[b], x[b], a);
      const double q2 = q(1, p.data() + networks_.criticOffset(1), s_[b], x[b], a);
      values.push_back(std::min(q1, q2) - alpha_ * log_prob);
    }
    return values;
  }

  double valueLoss(const Vector& p, const std::vector<Vector>& x, const Vector& learnt) const {
    double sum = 0;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      const double e = v(p.data() + networks_.valueOffset(), s_[b], x[b]) - learnt[b];
      sum += e * e;
    }
    return sum / static_cast<double>(s_.size());
  }

  // with the critics of p as well
  double actorLoss(const Vector& p, const std::vector<Vector>& x,
                   double* mean_log_prob = nullptr) const {
    double sum = 0, log_probs = 0, squares = 0;
    for (std::size_t b = 0; b < s_.size(); ++b) {
      double log_prob = 0;
      const Vector a = action(p, s_[b], x[b], b, log_prob, &squares);
      const double q1 = q(0, p.data() + networks_.criticOffset(0), s_[b], x[b], a);
      const double q2 = q(1, p.data() + networks_.criticOffset(1), s_[b], x[b], a);
      sum += alpha_ * log_prob - std::min(q1, q2);
      log_probs += log_prob;
    }
    const auto n = static_cast<double>(s_.size());
    if (mean_log_prob != nullptr) *mean_log_prob = log_probs / n;
    return sum / n + settings_.head_penalty * squares / (2 * n);
  }

 private:
  // the rows of one context: of a window from the oldest kept transition on, or of all
  std::vector<Vector> context(Rng& rng) const {
    const ReplayBuffer& kept = learner_.context().kept();
    std::vector<std::size_t> slots(kept.size());
    std::iota(slots.begin(), slots.end(), 0);
    const auto window = static_cast<std::size_t>(settings_.context.window);
    if (window > 0) {
      std::rotate(slots.begin(),
                  slots.begin() + static_cast<std::ptrdiff_t>(kept.next() % kept.size()),
                  slots.end());
      slots.erase(slots.begin(),
                  slots.begin() + static_cast<std::ptrdiff_t>(rng.below(kept.size() - window + 1)));
      slots.resize(window);
    }
    std::vector<Vector> rows;
    for (int i = 0; i < settings_.context.batch_size; ++i) {
      const Transition t = kept[slots[rng.below(slots.size())]];
      rows.push_back(concatenated({Vector(t.observation, t.observation + 3),
                                   Vector(t.action, t.action + 2), Vector{t.reward}}));
    }
    return rows;
  }

  const SacLearner& learner_;
  const SacNetworks& networks_;
  SacSettings settings_;
  double alpha_;
  Vector targets_;
  std::vector<std::vector<Vector>> rows_;  // of each context
  std::vector<Vector> latent_noise_, s_, a_, next_, noise_;
  Vector rewards_;
};

void expectGradient(const std::vector<float>& gradient, std::size_t offset, std::size_t n, Vector p,
                    const std::function<double(const Vector&)>& loss) {
  double largest = 0;
  for (std::size_t k = offset; k < offset + n; ++k) {
    largest = std::max<double>(largest, std::abs(gradient[k]));
  }
  ASSERT_GT(largest, 1e-3);
  for (std::size_t k = offset; k < offset + n; ++k) {
    const double h = 1e-6, at = p[k];
    p[k] = at + h;
    const double above = loss(p);
    p[k] = at - h;
    const double below = loss(p);
    p[k] = at;
    ASSERT_NEAR(gradient[k], (above - below) / (2 * h), 2e-4 * largest) << k;
  }
}

class SacGradients : public ::testing::TestWithParam<const char*> {};

TEST_P(SacGradients, AreTheLossesByFiniteDifferences) {
  const std::string name = GetParam();
  SacSettings settings = smallSettings(name.find("inference") == 0 ? "inference" : name);
  if (name == "inference_by_windows") {
    settings.context.window = 12;
    settings.context.per_update = 3;
  }
  if (name == "inference_and_value") {
    settings.backbone = "value";
    settings.min_log_std = -20;
    settings.head_penalty = 0.3;
    settings.context.per_update = 4;
  }
  Trainer trainer(settings);
  const SacNetworks& networks = trainer.learner.networks();
  for (int i = 0; i < 30; ++i) trainer.update();  // targets that differ from the critics
  for (int i = 0; i < 3; ++i) {
    trainer.learner.collect(trainer.parameters.data(), trainer.rng);
    const Reference reference(trainer.learner, trainer.rng);
    const Vector before(trainer.parameters.begin(), trainer.parameters.end());
    const SacLosses losses =
        trainer.learner.update(trainer.parameters.data(), trainer.optimizer, trainer.rng);
    const std::vector<float>& gradient = trainer.optimizer.gradient;

    const Vector y = reference.y(before);
    const std::vector<Vector> x = reference.inputs(before);
    double critic_loss = 0;
    for (int k = 0; k < 2; ++k) {
      critic_loss += 0.5 * reference.criticLoss(k, before, x, y);
      expectGradient(gradient, networks.criticOffset(k), networks.critic(k).size(), before,
                     [&](const Vector& p) { return reference.criticLoss(k, p, x, y); });
    }
    EXPECT_NEAR(losses.critic, critic_loss, 1e-4 * critic_loss);

    if (networks.hasEncoder()) {
      expectGradient(gradient, networks.encoderOffset(), networks.encoder().network().size(),
                     before, [&](const Vector& p) {
                       const std::vector<Vector> z = reference.inputs(p);
                       return reference.criticLoss(0, p, z, y) + reference.criticLoss(1, p, z, y) +
                              0.1 * reference.kl(p);
                     });
      EXPECT_NEAR(losses.kl, reference.kl(before), 1e-4 * losses.kl);
    }

    // the steps of value network and actor see the critics that have moved
    Vector moved(trainer.parameters.begin(), trainer.parameters.end());
    std::copy_n(before.begin(), networks.actor().size(), moved.begin());
    if (networks.hasValue()) {
      const Vector learnt = reference.softValues(moved, x);
      EXPECT_NEAR(losses.value, reference.valueLoss(before, x, learnt), 1e-4 * losses.value);
      expectGradient(gradient, networks.valueOffset(), networks.value().size(), before,
                     [&](const Vector& p) { return reference.valueLoss(p, x, learnt); });
    }
    double mean_log_prob = 0;
    EXPECT_NEAR(losses.actor, reference.actorLoss(moved, x, &mean_log_prob), 1e-4);
    EXPECT_NEAR(losses.entropy, -mean_log_prob, 1e-4);
    expectGradient(gradient, 0, networks.actor().size(), moved,
                   [&](const Vector& p) { return reference.actorLoss(p, x); });
  }
}

INSTANTIATE_TEST_SUITE_P(Encodings, SacGradients,
                         ::testing::Values("none", "one_hot", "inference", "inference_by_windows",
                                           "inference_and_value"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace pmeta
