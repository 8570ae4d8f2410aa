#include "common/recent_returns.h"

namespace pmeta_nodes {

using pmeta_msgs::TaskReturn;

void RecentReturns::take(const TaskReturn::ConstPtr& result) {
  forgetOtherRuns(result->run_id);
  if (newest_ && result->round > newest_->round) before_ = newest_;
  TaskReturn::ConstPtr& kept = !newest_ || result->round >= newest_->round ? newest_ : before_;
  const bool same = kept && kept->round == result->round;
  if (same && kept->context_episodes > result->context_episodes) return;
  if (!kept || same || kept->round < result->round) kept = result;
}

TaskReturn::ConstPtr RecentReturns::upTo(std::uint32_t round) const {
  for (const TaskReturn::ConstPtr& result : {newest_, before_}) {
    if (result && result->round <= round) return result;
  }
  return nullptr;
}

std::vector<TaskReturn::ConstPtr> RecentReturns::all() const {
  std::vector<TaskReturn::ConstPtr> results;
  for (const TaskReturn::ConstPtr& result : {before_, newest_}) {
    if (result) results.push_back(result);
  }
  return results;
}

void RecentReturns::forgetOtherRuns(const std::string& run_id) {
  for (TaskReturn::ConstPtr* result : {&newest_, &before_}) {
    if (*result && (*result)->run_id != run_id) result->reset();
  }
}

}  // namespace pmeta_nodes
