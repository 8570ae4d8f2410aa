#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"

namespace pmeta {

/// Name of the family.
constexpr char kRemoteName[] = "remote";

/// What a body in another process tells of itself, as DescribeEnv.srv has it.
struct RemoteDescription {
  std::vector<Quantity> observation{};  ///< in its own units; infinite bounds where it has none
  std::vector<Quantity> action{};       ///< the same: what it takes
  std::vector<std::string> choices{};  ///< of the one discrete action; none: actions are continuous
  int horizon = 0;                     ///< steps of an episode; 0: it sets no limit
  double step_seconds = 0;             ///< how long a step takes, s; 0: there is no such time
};

/// What `told` has other than `expected`, as a clause that names it: "observation 2 is 'speed' but
/// must be 'velocity'"; "" if nothing. A horizon of 0 that is told fits any.
std::string difference(const RemoteDescription& expected, const RemoteDescription& told);

/// What a step of such a body gave.
struct RemoteAnswer {
  std::vector<double> observation;  ///< after the step
  double reward = 0;                ///< of it
  bool terminated = false;          ///< see Step
  bool truncated = false;           ///< see Step
};

/// The way to a body in another process. Every call returns when the body has done it, and throws
/// BrokenEpisode where the episode is lost, LostEnvironment where the body is, and Interrupted.
class RemoteLink {
 public:
  virtual ~RemoteLink() = default;

  /// Begins an episode, numbered from 1. All that is random in it shall follow from `seed`. Waits
  /// for a body that has gone.
  virtual std::vector<double> reset(std::uint64_t episode, std::uint64_t seed) = 0;

  /// The step of that number, from 1, of the episode begun last; never done twice.
  virtual RemoteAnswer step(std::uint64_t episode, std::uint32_t step,
                            const std::vector<double>& action) = 0;

  /// Tells people what is wrong.
  virtual void warn(const std::string& sentence) = 0;
};

/// When a body is asked to act.
struct RemotePace {
  double pause = 0;  ///< least seconds from an episode's end to the next reset
  double rate = 0;   ///< most steps in a second; 0: as fast as they are done
};

/// What bodies have met with, in all.
struct RemoteFigures {
  std::atomic<std::int64_t> late_steps{0};   ///< that were to be made sooner by the rate
  std::atomic<std::int64_t> lost{0};         ///< episodes that broke down
  std::atomic<std::int64_t> connections{0};  ///< to services, made or made anew
};

/// A robot or simulator in another process, of which there is one and which cannot be restored.
///
/// The one random number it draws is the seed of each episode. A continuous action of [-1, 1] is
/// clipped and scaled to the bounds that the description gives. An answer of a wrong size, or with
/// numbers that are not finite in 32 bits, breaks the episode. Truncated at the horizon, whatever
/// the body says.
class RemoteEnv : public Env {
 public:
  /// How the body is reached, when it is needed first.
  using Connect = std::function<std::unique_ptr<RemoteLink>()>;

  /// `name`: of the body, for errors. The description's horizon must be positive, its continuous
  /// actions bounded; `figures` must outlive this.
  RemoteEnv(std::string name, const RemoteDescription& description, const RemotePace& pace,
            Connect connect, RemoteFigures& figures);

  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override;
  Step step(const double* action, Rng& rng, double* observation) override;

 private:
  using Clock = std::chrono::steady_clock;

  template <class Work>
  auto breaking(const Work& work);
  void take(const std::vector<double>& answer, double* observation) const;
  void require(double number, const std::string& what) const;
  void keepRate();
  std::string where() const;

  std::string name_;
  RemoteDescription description_;
  RemotePace pace_;
  Connect connect_;
  RemoteFigures& figures_;
  EnvSpec spec_;
  std::unique_ptr<RemoteLink> link_;
  std::vector<double> action_;
  std::uint64_t episode_ = 0;
  std::uint32_t step_ = 0;
  Clock::time_point next_reset_{};
  Clock::time_point next_step_{};
};

}  // namespace pmeta
