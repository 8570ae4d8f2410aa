#include "common/refusals.h"

namespace pmeta_nodes {
namespace {

constexpr auto kWindow = std::chrono::seconds(10);
constexpr int kToldInWindow = 20;

}  // namespace

std::string Refusals::judge(const std::string& kind, pmeta::Authenticity authenticity) {
  switch (authenticity) {
    case pmeta::Authenticity::kAuthentic:
      return "";
    case pmeta::Authenticity::kUnsigned:
      count("unsigned: " + kind);
      return kind + " carries no MAC: its sender must use this run's key_file.";
    case pmeta::Authenticity::kForged:
      break;
  }
  count("forged: " + kind);
  return kind +
         " carries a MAC that does not fit: it was changed on the way, or its sender has "
         "another key than this node's key_file.";
}

bool Refusals::mayTell() {
  const Clock::time_point now = Clock::now();
  if (now - window_ > kWindow) {
    window_ = now;
    told_ = 0;
  }
  if (told_ < kToldInWindow) {
    ++told_;
    return true;
  }
  ++untold_;
  return false;
}

std::string Refusals::untold() {
  const std::int64_t count = std::exchange(untold_, 0);
  return count == 0 ? "" : " (and " + std::to_string(count) + " more since the last one told)";
}

std::vector<std::pair<std::string, std::string>> Refusals::values() const {
  std::vector<std::pair<std::string, std::string>> values;
  for (const auto& entry : counts_) values.emplace_back(entry.first, std::to_string(entry.second));
  return values;
}

}  // namespace pmeta_nodes
