#include "pmeta_core/env/remote_env.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"

namespace pmeta {
namespace {

constexpr double kLargest = std::numeric_limits<float>::max();  // of what a replay holds
constexpr auto kAttention = std::chrono::milliseconds(50);      // to signals, while it sleeps

std::string bounds(const Quantity& one) {
  return "from " + formatNumber(one.low) + " to " + formatNumber(one.high);
}

std::string difference(const std::string& what, const std::vector<Quantity>& expected,
                       const std::vector<Quantity>& told) {
  const std::size_t shared = std::min(expected.size(), told.size());
  for (std::size_t i = 0; i < shared; ++i) {
    const Quantity& must = expected[i];
    const Quantity& is = told[i];
    if (is.name != must.name) {
      return what + " " + std::to_string(i) + " is " + shown(is.name) + " but must be " +
             shown(must.name);
    }
    if (is.unit != must.unit) {
      return what + " " + shown(is.name) + " is in " + shown(is.unit) + " but must be in " +
             shown(must.unit);
    }
    if (is.low != must.low || is.high != must.high) {
      return what + " " + shown(is.name) + " is " + bounds(is) + " but must be " + bounds(must);
    }
  }
  if (told.size() == expected.size()) return "";
  return "it has " + std::to_string(told.size()) + " numbers of its " + what + " but must have " +
         std::to_string(expected.size());
}

EnvSpec specOf(const RemoteDescription& description) {
  std::vector<Quantity> action = description.action;
  for (Quantity& one : action) {
    if (description.choices.empty()) one = {one.name, "", -1, 1};
  }
  EnvSpec spec = describedSpec(kRemoteName, description.horizon, description.observation, action,
                               description.choices);
  spec.step_seconds = description.step_seconds;
  return spec;
}

template <class Time>
void sleepUntil(Time due) {
  while (Time::clock::now() < due) {
    if (stopSignalled()) throw Interrupted();
    std::this_thread::sleep_until(std::min(due, Time::clock::now() + kAttention));
  }
}

std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
}

}  // namespace

std::string difference(const RemoteDescription& expected, const RemoteDescription& told) {
  std::string found = difference("observation", expected.observation, told.observation);
  if (found.empty()) found = difference("action", expected.action, told.action);
  if (!found.empty()) return found;
  if (told.choices != expected.choices) {
    return "its choices are " + plain(join(told.choices), 200) + " but must be " +
           join(expected.choices);
  }
  if (told.horizon != expected.horizon && told.horizon != 0) {
    return "its horizon is " + std::to_string(told.horizon) + " but must be " +
           std::to_string(expected.horizon);
  }
  if (told.step_seconds == expected.step_seconds) return "";
  return "its step takes " + formatNumber(told.step_seconds) + " s but must take " +
         formatNumber(expected.step_seconds) + " s";
}

RemoteEnv::RemoteEnv(std::string name, const RemoteDescription& description, const RemotePace& pace,
                     Connect connect, RemoteFigures& figures)
    : name_(std::move(name)),
      description_(description),
      pace_(pace),
      connect_(std::move(connect)),
      figures_(figures),
      spec_(specOf(description)),
      action_(description.action.size()) {}

// what breaks an episode is told: who collects goes on with another
template <class Work>
auto RemoteEnv::breaking(const Work& work) {
  try {
    return work();
  } catch (const BrokenEpisode& episode) {
    ++figures_.lost;
    next_reset_ = Clock::now() + nanoseconds(pace_.pause);
    link_->warn(episode.what());
    throw;
  }
}

void RemoteEnv::reset(Rng& rng, double* observation) {
  // first: draws must not depend on how the body is
  const std::uint64_t seed = rng();
  if (!link_) link_ = connect_();
  sleepUntil(next_reset_);
  ++episode_;
  step_ = 0;
  breaking([&] { take(link_->reset(episode_, seed), observation); });
  next_step_ = Clock::now();
}

Step RemoteEnv::step(const double* action, Rng&, double* observation) {
  if (!link_) throw BrokenEpisode(name_ + " has not begun an episode");
  for (std::size_t i = 0; i < action_.size(); ++i) {
    const Quantity& one = description_.action[i];
    action_[i] = action[i];
    if (!description_.choices.empty()) continue;
    const double share = (std::clamp(action[i], -1.0, 1.0) + 1) / 2;
    action_[i] = one.low + (one.high - one.low) * share;
  }
  keepRate();
  ++step_;
  return breaking([&] {
    const RemoteAnswer answer = link_->step(episode_, step_, action_);
    require(answer.reward, "the reward");
    take(answer.observation, observation);
    Step step{answer.reward, answer.terminated};
    step.truncated =
        !step.terminated && (answer.truncated || static_cast<int>(step_) >= spec_.horizon);
    if (step.terminated || step.truncated) {
      next_reset_ = Clock::now() + nanoseconds(pace_.pause);
    }
    return step;
  });
}

void RemoteEnv::keepRate() {
  if (pace_.rate <= 0) return;
  const Clock::time_point now = Clock::now();
  if (now > next_step_) {
    // the first of an episode is due at once
    if (step_ > 0) ++figures_.late_steps;
    next_step_ = now;
  }
  sleepUntil(next_step_);
  next_step_ += nanoseconds(1 / pace_.rate);
}

void RemoteEnv::take(const std::vector<double>& answer, double* observation) const {
  if (answer.size() != spec_.observation.size()) {
    throw BrokenEpisode(where() + " answered " + std::to_string(answer.size()) +
                        " numbers of an observation, which has " +
                        std::to_string(spec_.observation.size()));
  }
  for (std::size_t i = 0; i < answer.size(); ++i) {
    require(answer[i], "observation " + spec_.observation[i].name);
  }
  std::copy(answer.begin(), answer.end(), observation);
}

// false for NaN, too
void RemoteEnv::require(double number, const std::string& what) const {
  if (std::abs(number) <= kLargest) return;
  throw BrokenEpisode(where() + " answered that " + what + " is " + formatNumber(number) +
                      ", which is no finite number of 32 bits");
}

std::string RemoteEnv::where() const {
  return name_ + (step_ == 0 ? ", at the start of an episode," : ", in step ") +
         (step_ == 0 ? "" : std::to_string(step_) + " of an episode,");
}

}  // namespace pmeta
