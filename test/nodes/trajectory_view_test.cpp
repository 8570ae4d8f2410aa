#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>

#include <functional>
#include <set>

#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

bool waitFor(const std::function<bool()>& condition) {
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(20);
  while (!condition()) {
    if (ros::WallTime::now() > limit) return false;
    ros::spinOnce();
    ros::WallDuration(0.01).sleep();
  }
  return true;
}

/// The cart rolls to the right by 0.01 m a step.
Trajectory roll(int policy) {
  std::vector<double> observations;
  for (int i = 0; i <= 200; ++i) observations.insert(observations.end(), {0.01 * i, 0, 0, 0});
  Trajectory message = episodeOf(1, policy, 4, observations);
  message.run_id = "run";
  return message;
}

/// A viewer of rviz's kind: what it has got of each topic.
struct Watcher {
  explicit Watcher(ros::NodeHandle& nh) {
    using Callback = boost::function<void(const MarkerArray::ConstPtr&)>;
    markers_sub = nh.subscribe<MarkerArray>(
        "/pmeta/markers", 1, Callback([this](const auto& message) { markers = *message; }));
    playback_sub = nh.subscribe<MarkerArray>(
        "/pmeta/playback", 1, Callback([this](const auto& message) { playback = *message; }));
  }
  double cartX(int id) const { return find(playback, "carts", id).pose.position.x; }

  MarkerArray markers;
  MarkerArray playback;
  ros::Subscriber markers_sub;
  ros::Subscriber playback_sub;
};

TEST(TrajectoryViewNode, AWatcherThatComesLateSeesTheLastEpisodesMoving) {
  ros::NodeHandle nh;
  {
    ros::Publisher episodes = nh.advertise<Trajectory>("/pmeta/task_1/trajectory", 4);
    ASSERT_TRUE(waitFor([&] { return episodes.getNumSubscribers() == 1; }));
    episodes.publish(roll(Trajectory::PERSONAL));
    episodes.publish(roll(Trajectory::META));
    Watcher witness(nh);
    ASSERT_TRUE(waitFor([&] {
      return !witness.markers.markers.empty() &&
             find(witness.markers, "traces", 2).action == Marker::ADD &&
             find(witness.markers, "traces", 3).action == Marker::ADD;
    }));
  }  // the agents have gone, and so has the first watcher

  Watcher late(nh);
  ASSERT_TRUE(
      waitFor([&] { return !late.markers.markers.empty() && !late.playback.markers.empty(); }));
  EXPECT_EQ(Marker::ADD, find(late.markers, "traces", 2).action);
  EXPECT_EQ(Marker::ADD, find(late.markers, "traces", 3).action);
  EXPECT_EQ(Marker::ADD, find(late.playback, "carts", 2).action);
  EXPECT_EQ(Marker::DELETE, find(late.playback, "carts", 0).action);
  const auto ids = names(late.playback);

  // both carts move together, to the end and then from the start again
  double before = late.cartX(2);
  EXPECT_TRUE(waitFor([&] { return late.cartX(2) > before; }));
  EXPECT_EQ(late.cartX(2), late.cartX(3));
  EXPECT_TRUE(waitFor([&] {
    const double last = before;
    before = late.cartX(2);
    return before < last;
  }));
  EXPECT_EQ(ids, names(late.playback));

  // every frame that a marker names is there
  std::set<std::string> frames = {kWorldFrame};
  const boost::function<void(const tf2_msgs::TFMessage::ConstPtr&)> take =
      [&](const auto& message) {
        for (const auto& transform : message->transforms) frames.insert(transform.child_frame_id);
      };
  const ros::Subscriber tf = nh.subscribe<tf2_msgs::TFMessage>("/tf_static", 1, take);
  ASSERT_TRUE(waitFor([&] { return frames.size() > 1; }));
  for (const MarkerArray* array : {&late.markers, &late.playback}) {
    for (const Marker& marker : array->markers) {
      EXPECT_EQ(1u, frames.count(marker.header.frame_id)) << marker.header.frame_id;
    }
  }
}

std::string labelOf(const MarkerArray& markers, int id) {
  if (markers.markers.empty()) return "";
  return find(markers, "results", id).text;
}

TEST(TrajectoryViewNode, AllIsShownAsOfTheLastCompleteRound) {
  using pmeta_msgs::RoundSummary;
  using pmeta_msgs::TaskReturn;
  ros::NodeHandle nh;
  ros::Publisher rounds = nh.advertise<RoundSummary>("/pmeta/round", 4);
  ros::Publisher returns = nh.advertise<TaskReturn>("/pmeta/returns", 4);
  Watcher watcher(nh);
  ASSERT_TRUE(
      waitFor([&] { return rounds.getNumSubscribers() == 1 && returns.getNumSubscribers() == 1; }));
  const auto complete = [&](std::uint32_t round) {
    RoundSummary summary;
    summary.run_id = "run";
    summary.round = round;
    rounds.publish(summary);
  };
  const auto result = [&](std::uint32_t round, double mean) {
    TaskReturn message;
    message.run_id = "run";
    message.task = 1;
    message.policy = TaskReturn::PERSONAL;
    message.round = round;
    message.return_mean = mean;
    returns.publish(message);
  };
  complete(4);
  result(4, 40);
  EXPECT_TRUE(waitFor([&] { return labelOf(watcher.markers, 2) == "personal return 40.00"; }));
  result(5, 50);
  // what comes after it on the same topic is there: so was the return of round 5
  TaskReturn meta;
  meta.run_id = "run";
  meta.task = 1;
  meta.policy = TaskReturn::META;
  meta.round = 4;
  meta.return_mean = 39;
  returns.publish(meta);
  EXPECT_TRUE(waitFor([&] { return labelOf(watcher.markers, 3) == "meta return 39.00"; }));
  EXPECT_EQ(labelOf(watcher.markers, 2), "personal return 40.00");
  complete(5);
  EXPECT_TRUE(waitFor([&] { return labelOf(watcher.markers, 2) == "personal return 50.00"; }));
}

}  // namespace
}  // namespace pmeta_nodes

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "trajectory_view_test");
  const ros::NodeHandle nh;
  return RUN_ALL_TESTS();
}
