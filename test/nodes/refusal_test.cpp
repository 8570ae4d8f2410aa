#include <diagnostic_msgs/DiagnosticArray.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>

#include <cmath>
#include <limits>
#include <map>

#include "pmeta_core/run/task_agent.h"
#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

class Refusal : public RunOverRos {
 protected:
  Refusal()
      : pub_(nh_.advertise<pmeta_msgs::AuxiliaryUpdate>("auxiliary", 16)),
        diagnostics_sub_(nh_.subscribe("/diagnostics", 100, &Refusal::onDiagnostics, this)) {}

  void onDiagnostics(const diagnostic_msgs::DiagnosticArray& msg) {
    for (const auto& status : msg.status) {
      for (const auto& value : status.values) health_[status.name + "/" + value.key] = value.value;
    }
  }

  // of task 0 in the aggregator's diagnostics
  std::string health() {
    return health_["pmeta/meta_aggregator: meta aggregator/" + experiment_.family().taskName(0)];
  }

  // an update of task 0 that the aggregator would take, but for what `spoil` does to it
  pmeta_msgs::AuxiliaryUpdate goodUpdate() {
    pmeta::MetaAggregator aggregator(experiment_);
    pmeta::TaskAgent agent(experiment_, 0);
    return toMsg(agent.trainRound(aggregator.metaPolicy())->update);
  }

  void expectRefused(const pmeta_msgs::AuxiliaryUpdate& msg, const std::string& reason) {
    const std::uint32_t before = summary_->refused;
    const std::size_t seen = history_.size();
    pub_.publish(msg);
    ASSERT_TRUE(waitFor([&] { return summary_->refused > before; }, 10)) << reason;
    bool told = false;
    for (std::size_t i = seen; i < history_.size(); ++i) {
      told = told || history_[i].message.find(reason) != std::string::npos;
    }
    EXPECT_TRUE(told) << "wanted '" << reason << "', got '" << history_.back().message << "'";
  }

  ros::Publisher pub_;
  ros::Subscriber diagnostics_sub_;
  std::map<std::string, std::string> health_;
};

TEST_F(Refusal, BadUpdatesAreRefusedWithTheirReasonAndTheRunIsUnharmed) {
  ASSERT_TRUE(waitFor([&] { return summary_ && pub_.getNumSubscribers() > 0; }));

  pmeta_msgs::AuxiliaryUpdate msg = goodUpdate();
  msg.model.layout_hash ^= 1;
  expectRefused(msg, "does not fit its layout");

  msg = goodUpdate();
  msg.model =
      toMsg(pmeta::Model(pmeta::ModelLayout(pmeta::Precision::kFloat64, {{"q_table", {4, 4}}})));
  expectRefused(msg, "start it with the same configuration");

  msg = goodUpdate();
  msg.model.float64_values[5] += 1;
  expectRefused(msg, "damaged on the way");

  msg = goodUpdate();
  msg.model.float64_values.pop_back();
  expectRefused(msg, "values where its layout has");

  msg = goodUpdate();
  pmeta::Model poisoned = fromMsg(msg.model);
  poisoned.doubles()[0] = std::numeric_limits<double>::quiet_NaN();
  msg.model = toMsg(poisoned);
  expectRefused(msg, "not finite");

  msg = goodUpdate();
  msg.run_id = "another";
  expectRefused(msg, "belongs to run 'another'");

  msg = goodUpdate();
  msg.task = 77;
  expectRefused(msg, "is not one of this run's 5 tasks");

  msg = goodUpdate();
  msg.round = 1000;
  expectRefused(msg, "task 0 reports round 1000 but round");

  msg = goodUpdate();
  msg.round = 0xffffffffu;
  expectRefused(msg, "impossible round");

  msg = goodUpdate();
  msg.weight = -1;
  expectRefused(msg, "not a positive number");

  EXPECT_FALSE(finished()) << "the run was over before the last refusal";
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  EXPECT_GE(summary_->refused, 10u);
  expectEqualsLocal();

  // all of them but that of task 77, by the agent they were of
  const std::string reason = "task 0 has weight -1, which is not a positive number.";
  EXPECT_TRUE(waitFor(
      [&] {
        return health().rfind("10 accepted, ", 0) == 0 &&
               health().find(" 9 refused, 0 left out; last reason: " + reason) != std::string::npos;
      },
      10))
      << health();
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("refusal_test")
