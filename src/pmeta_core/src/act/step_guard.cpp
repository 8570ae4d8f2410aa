#include "pmeta_core/act/step_guard.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "pmeta_core/env/faulty_env.h"

namespace pmeta {
namespace {

constexpr std::size_t kRoom = 256;  // for numbers that are too many
constexpr double kUnwritten = std::numeric_limits<double>::quiet_NaN();

bool allFinite(const double* numbers, std::size_t count) {
  return std::all_of(numbers, numbers + count, [](double x) { return std::isfinite(x); });
}

}  // namespace

StepGuard::StepGuard(std::size_t observation_size, std::size_t action_size)
    : size_(observation_size),
      action_size_(action_size),
      written_(observation_size + kRoom, kUnwritten) {}

void StepGuard::prepare() { std::fill_n(written_.begin(), size_ + 1, kUnwritten); }

void StepGuard::take(const Env& env, double* observation) const {
  const auto end = written_.begin() + static_cast<std::ptrdiff_t>(size_);
  // the first behind the end shows it, since they are written one after the other
  if (!std::isnan(*end)) {
    throw FaultyEnv("the " + env.description() + " wrote more than the " + std::to_string(size_) +
                    " numbers of observation that its spec() says.");
  }
  if (!allFinite(written_.data(), size_)) {
    const auto bad =
        std::find_if(written_.begin(), end, [](double x) { return !std::isfinite(x); });
    const auto k = static_cast<std::size_t>(bad - written_.begin());
    throw FaultyEnv("the " + env.description() + " gave an observation whose " +
                    observationsOf(env.spec())[k].name + " (number " + std::to_string(k) + " of " +
                    std::to_string(size_) + ") is " +
                    (std::isnan(*bad) ? "nan or was not written" : formatNumber(*bad)) +
                    ": each must be a finite number.");
  }
  std::copy(written_.begin(), end, observation);
}

void StepGuard::reset(Env& env, Rng& rng, double* observation) {
  prepare();
  try {
    env.reset(rng, written_.data());
  } catch (...) {
    rethrowFault("the " + env.description() + " cannot be reset", env.isForeign());
  }
  take(env, observation);
}

Step StepGuard::step(Env& env, const double* action, Rng& rng, double* observation) {
  if (!allFinite(action, action_size_)) return env.step(action, rng, observation);
  prepare();
  Step step;
  try {
    step = env.step(action, rng, written_.data());
  } catch (...) {
    rethrowFault("the " + env.description() + " cannot be stepped", env.isForeign());
  }
  if (!std::isfinite(step.reward) || !std::isfinite(step.evaluatedReward())) {
    throw FaultyEnv(
        "the " + env.description() + " gave a reward that is " +
        formatNumber(std::isfinite(step.reward) ? step.evaluatedReward() : step.reward) +
        ": it must be a finite number.");
  }
  take(env, observation);
  return step;
}

}  // namespace pmeta
