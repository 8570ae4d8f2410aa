#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/security/authentication.h"

namespace pmeta_nodes {

/// What a node did not take, counted by reason, and how much of it is told: a flood of messages
/// must not become one of log lines. One thread's.
class Refusals {
 public:
  /// Counts a message of that kind ("an update") which is not authentic; what is wrong with it, in
  /// a sentence, or "" if nothing is.
  std::string judge(const std::string& kind, pmeta::Authenticity authenticity);

  /// Counts one more under a heading of diagnostics.
  void count(const std::string& heading) { ++counts_[heading]; }

  /// May a refusal be told now? Twenty in ten seconds may.
  bool mayTell();

  /// " (and N more since the last one told)", once after some were not told; or "".
  std::string untold();

  /// The counts, for diagnostics.
  std::vector<std::pair<std::string, std::string>> values() const;

 private:
  using Clock = std::chrono::steady_clock;

  std::map<std::string, std::int64_t> counts_;
  Clock::time_point window_ = Clock::now();
  int told_ = 0;
  std::int64_t untold_ = 0;
};

}  // namespace pmeta_nodes
