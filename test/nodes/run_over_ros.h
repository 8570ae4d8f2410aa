#pragma once

#include <gtest/gtest.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/RoundSummary.h>
#include <ros/callback_queue.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <signal.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cstdio>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/conversions.h"
#include "common/run_node.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta_nodes {

/// Follows a run that a .test file has launched in /pmeta, and compares it with the local runner.
class RunOverRos : public ::testing::Test {
 protected:
  RunOverRos() : nh_("/pmeta"), experiment_(readExperiment(nh_)) {
    meta_sub_ = nh_.subscribe("meta_policy", 8, &RunOverRos::onMeta, this);
    round_sub_ = nh_.subscribe("round", 64, &RunOverRos::onRound, this);
  }

  /// Spins until `condition` holds; false after `seconds`.
  bool waitFor(const std::function<bool()>& condition, double seconds = 60) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(seconds);
    while (!condition()) {
      if (ros::WallTime::now() > limit || !ros::ok()) return false;
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.02));
    }
    return true;
  }

  bool finished() const {
    return summary_ && summary_->state == pmeta_msgs::RoundSummary::FINISHED;
  }

  /// How the names of this run's tasks begin, e.g. "grid_".
  std::string taskPrefix() const {
    const std::string name = experiment_.family().taskName(0);
    return name.substr(0, name.find('_') + 1);
  }

  int roundsDone() const { return summary_ ? static_cast<int>(summary_->round) : 0; }

  /// The run's tables, final meta-policy and status are those of the local runner, bit for bit.
  void expectEqualsLocal() {
    const pmeta::LocalResult local = pmeta::runLocally(experiment_);
    std::vector<std::string> expected = {pmeta::RunLog::csvHeader()};
    std::string losses = "round,task,loss,value\n";
    for (const auto& round : local.rounds) {
      for (const auto& row : round.rows) {
        expected.push_back(pmeta::RunLog::csvLine(row));
        losses += pmeta::RunLog::lossLines(row.result);
      }
    }
    for (std::string& line : expected) line = withoutWallTime(line);
    EXPECT_EQ(readCsv(), expected);
    std::ifstream file(experiment_.runDir() + "/losses.csv");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), losses);
    EXPECT_EQ(pmeta::runStatus(experiment_.runDir()), "finished");
    ASSERT_TRUE(waitFor([&] { return meta_ && meta_->round == meta_->rounds; }, 10));
    EXPECT_TRUE(fromMsg(meta_->model) == local.meta);
  }

  std::vector<std::string> readCsv() const {
    std::ifstream file(experiment_.runDir() + "/rounds.csv");
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(withoutWallTime(line));
    return lines;
  }

  static std::string withoutWallTime(const std::string& line) {
    return line.substr(0, line.rfind(','));
  }

  /// Process id of a node, by asking it.
  int pidOf(const std::string& node) {
    XmlRpc::XmlRpcValue request, response, payload;
    request[0] = ros::this_node::getName();
    request[1] = node;
    if (!ros::master::execute("lookupNode", request, response, payload, false)) return -1;
    std::string host;
    std::uint32_t port = 0;
    if (!ros::network::splitURI(std::string(payload), host, port)) return -1;
    XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
    XmlRpc::XmlRpcValue caller, answer;
    caller[0] = ros::this_node::getName();
    if (!client.execute("getPid", caller, answer) || answer.size() < 3) return -1;
    return static_cast<int>(answer[2]);
  }

  /// What a shell command prints. It sources the workspace anew: the environment that catkin gives
  /// to tests is as old as the first configuration, when there were no Python messages yet.
  static std::string output(const std::string& command) {
    std::string text;
    const std::string source = ". \"${CMAKE_PREFIX_PATH%%:*}/setup.sh\" && ";
    FILE* pipe = popen((source + command + " 2>&1").c_str(), "r");
    char buffer[4096];
    while (pipe != nullptr && fgets(buffer, sizeof buffer, pipe) != nullptr) text += buffer;
    if (pipe != nullptr) pclose(pipe);
    return text;
  }

  ros::NodeHandle nh_;
  pmeta::Experiment experiment_;
  pmeta_msgs::MetaPolicy::ConstPtr meta_;
  pmeta_msgs::RoundSummary::ConstPtr summary_;
  std::vector<pmeta_msgs::RoundSummary> history_;

 private:
  // a test may publish forged ones itself
  template <class Msg>
  static bool isOwn(const ros::MessageEvent<const Msg>& event) {
    return event.getPublisherName() == ros::this_node::getName();
  }

  void onMeta(const ros::MessageEvent<const pmeta_msgs::MetaPolicy>& event) {
    if (!isOwn(event)) meta_ = event.getMessage();
  }
  void onRound(const ros::MessageEvent<const pmeta_msgs::RoundSummary>& event) {
    if (isOwn(event)) return;
    summary_ = event.getMessage();
    history_.push_back(*summary_);
  }

  ros::Subscriber meta_sub_;
  ros::Subscriber round_sub_;
};

}  // namespace pmeta_nodes

#define PMETA_ROSTEST_MAIN(name)            \
  int main(int argc, char** argv) {         \
    testing::InitGoogleTest(&argc, argv);   \
    ros::init(argc, argv, name);            \
    const ros::NodeHandle keep_ros_running; \
    return RUN_ALL_TESTS();                 \
  }
