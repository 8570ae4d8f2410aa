#pragma once

#include <array>
#include <cstdint>

namespace pmeta {

/// What a random stream is for. Streams of one seed and task are independent of each other.
enum class Stream : std::uint64_t {
  kTaskDraw = 1,      ///< which tasks a family holds
  kInitialise = 2,    ///< initial parameters
  kCollect = 3,       ///< acting in the environment while training
  kSample = 4,        ///< drawing training samples
  kEvaluate = 5,      ///< evaluation episodes
  kMeasure = 6,       ///< measurements on the side (theory, benchmarks)
  kTestTaskDraw = 7,  ///< which tasks a family holds for test
  kTaskModel = 8,     ///< drawing training samples of a task model
};

/// Seeded generator xoshiro256++ (Blackman and Vigna, 2019), keyed by (seed, task, stream, round).
///
/// The key is all there is to a stream: an agent that restarts in round c draws what it would have
/// drawn, whatever happened before. Its distributions are spelt out here, since those of the
/// standard library differ from one implementation to the next.
class Rng {
 public:
  using result_type = std::uint64_t;  ///< as std::uniform_random_bit_generator wants it

  /// The beginning of the stream with that key.
  Rng(std::uint64_t seed, std::uint64_t task, Stream stream, std::uint64_t round = 0);

  static constexpr result_type min() { return 0; }  ///< least of the values of operator()
  /// Greatest of the values of operator().
  static constexpr result_type max() { return ~std::uint64_t{0}; }

  /// A stream of its own that depends on where this one is, which does not move.
  Rng branch(Stream stream) const;

  /// The next 64 random bits.
  result_type operator()();

  /// Uniform in [0, 1), a multiple of 2^-53.
  double uniform();

  /// Uniform integer in [0, n), without bias (Lemire, 2019). n must be positive.
  std::uint64_t below(std::uint64_t n);

  /// Standard normal (Marsaglia's polar method; no value is kept between calls).
  double normal();

  /// The four words of the state, for checkpoints and tests.
  const std::array<std::uint64_t, 4>& state() const { return state_; }
  /// Goes on from a state(); not all four words may be 0.
  void setState(const std::array<std::uint64_t, 4>& state) { state_ = state; }

 private:
  std::array<std::uint64_t, 4> state_;
};

}  // namespace pmeta
