#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <topic_tools/shape_shifter.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace pmeta_nodes {

/// A message as it came over the wire, of whatever type.
struct RecordedMessage {
  std::string topic;
  std::string publisher;  ///< name of the node
  std::string type;       ///< e.g. "pmeta_msgs/TaskReturn"
  std::vector<std::uint8_t> bytes;

  /// Throws ros::serialization::StreamOverrunException if it is none of that type.
  template <class Msg>
  Msg as() const {
    Msg msg;
    std::vector<std::uint8_t> copy = bytes;
    ros::serialization::IStream in(copy.data(), static_cast<std::uint32_t>(copy.size()));
    ros::serialization::deserialize(in, msg);
    return msg;
  }
};

template <class Msg>
std::vector<std::uint8_t> serialized(const Msg& msg) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(msg));
  ros::serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(out, msg);
  return bytes;
}

/// Subscribes to every topic that the master knows, also to those that come later.
class Recorder {
 public:
  /// Records until `done` says so; false after `seconds`.
  bool record(const std::function<bool()>& done, double seconds) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(seconds);
    while (!done()) {
      if (ros::WallTime::now() > limit || !ros::ok()) return false;
      subscribeToNew();
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    }
    return true;
  }

  const std::vector<RecordedMessage>& messages() const { return messages_; }

 private:
  using Event = ros::MessageEvent<topic_tools::ShapeShifter const>;

  void subscribeToNew() {
    ros::master::V_TopicInfo topics;
    ros::master::getTopics(topics);
    for (const ros::master::TopicInfo& info : topics) {
      if (subscribers_.count(info.name) != 0) continue;
      ros::SubscribeOptions options;
      const std::string topic = info.name;
      options.initByFullCallbackType<const Event&>(
          topic, 0, [this, topic](const Event& event) { take(topic, event); });
      subscribers_[topic] = nh_.subscribe(options);
    }
  }

  void take(const std::string& topic, const Event& event) {
    const topic_tools::ShapeShifter& message = *event.getConstMessage();
    RecordedMessage one = {topic, event.getPublisherName(), message.getDataType(), {}};
    one.bytes.resize(message.size());
    ros::serialization::OStream out(one.bytes.data(), message.size());
    message.write(out);
    messages_.push_back(std::move(one));
  }

  ros::NodeHandle nh_;
  std::map<std::string, ros::Subscriber> subscribers_;
  std::vector<RecordedMessage> messages_;
};

}  // namespace pmeta_nodes
