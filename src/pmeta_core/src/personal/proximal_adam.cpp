#include "pmeta_core/personal/proximal_adam.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

void require(bool holds, const char* name, double value, const char* range) {
  if (holds) return;
  std::ostringstream text;
  text << "Adam's " << name << " is " << value << ", but must be " << range << ".";
  throw Error(text.str());
}

}  // namespace

ProximalAdam::ProximalAdam(float* personal, float* auxiliary, std::size_t size,
                           const ProximalAdamSettings& settings)
    : personal_(personal),
      auxiliary_(auxiliary),
      settings_(settings),
      first_moment_(size),
      second_moment_(size) {
  const ProximalAdamSettings& s = settings_;
  require(s.learning_rate > 0, "learning_rate", s.learning_rate, "positive");
  require(s.beta1 >= 0 && s.beta1 < 1, "beta1", s.beta1, "in [0, 1)");
  require(s.beta2 >= 0 && s.beta2 < 1, "beta2", s.beta2, "in [0, 1)");
  require(s.eps > 0, "eps", s.eps, "positive");
  require(s.alpha >= 0, "alpha", s.alpha, "at least 0");
  require(s.lambda >= 0, "lambda", s.lambda, "at least 0");
  require(s.eta >= 0, "eta", s.eta, "at least 0");
}

void ProximalAdam::setLambda(std::size_t offset, std::size_t n, double lambda) {
  require(lambda >= 0, "lambda", lambda, "at least 0");
  const Range added{offset, offset + n, lambda};
  bool fits = added.end <= size();
  for (const Range& range : ranges_) {
    fits = fits && (added.end <= range.begin || range.end <= added.begin);
  }
  if (!fits) throw Error("ranges of Adam's lambda must not overlap, nor pass the last parameter.");
  ranges_.push_back(added);
}

double ProximalAdam::lambdaAt(std::size_t offset, std::size_t n) const {
  for (const Range& range : ranges_) {
    if (offset + n <= range.begin || range.end <= offset) continue;
    if (offset < range.begin || range.end < offset + n) {
      throw Error("one pass of Adam reaches over the edge of a range with a lambda of its own.");
    }
    return range.lambda;
  }
  return settings_.lambda;
}

void ProximalAdam::beginUpdate() { ++updates_; }

void ProximalAdam::move(std::size_t offset, const float* gradient, std::size_t n, float* target,
                        double tau) {
  if (updates_ == 0) throw Error("call beginUpdate() before Adam's apply().");
  require(target == nullptr || (tau > 0 && tau <= 1), "tau", tau, "in (0, 1]");
  const ProximalAdamSettings& s = settings_;
  const auto t = static_cast<double>(updates_);
  const double lambda = lambdaAt(offset, n);
  AdamPass pass;
  pass.step_size = static_cast<float>(s.learning_rate / (1 - std::pow(s.beta1, t)));
  pass.beta1 = static_cast<float>(s.beta1);
  pass.beta2 = static_cast<float>(s.beta2);
  pass.one_minus_beta1 = static_cast<float>(1 - s.beta1);
  pass.one_minus_beta2 = static_cast<float>(1 - s.beta2);
  pass.root_correction = static_cast<float>(1 / std::sqrt(1 - std::pow(s.beta2, t)));
  pass.eps = static_cast<float>(s.eps);
  pass.pull = static_cast<float>(s.coupled ? lambda : s.alpha * lambda);
  pass.follow = static_cast<float>(s.eta * lambda);
  pass.coupled = s.coupled;
  pass.tau = static_cast<float>(tau);
  kernels().adam(pass, personal_ + offset, first_moment_.data() + offset,
                 second_moment_.data() + offset, gradient,
                 lambda == 0 || auxiliary_ == nullptr ? nullptr : auxiliary_ + offset, target, n);
}

void ProximalAdam::reset() {
  updates_ = 0;
  std::fill(first_moment_.begin(), first_moment_.end(), 0.0f);
  std::fill(second_moment_.begin(), second_moment_.end(), 0.0f);
}

void ProximalAdam::saveState(StateWriter& writer) const {
  writer.count("updates", updates_);
  writer.array("first_moment", first_moment_);
  writer.array("second_moment", second_moment_);
}

void ProximalAdam::loadState(StateReader& reader) {
  updates_ = reader.count("updates");
  reader.array("first_moment", first_moment_);
  reader.array("second_moment", second_moment_);
}

}  // namespace pmeta
