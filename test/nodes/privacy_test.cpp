#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/Scores.h>
#include <rosgraph_msgs/Log.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <set>
#include <unordered_set>

#include "common/conversions.h"
#include "common/run_node.h"
#include "pmeta_core/base/format.h"
#include "recorder.h"

namespace pmeta_nodes {
namespace {

// The launch file starts one experiment twice: below /private with publish_trajectories: false, and
// below /public with true. One seed gives one result, so what the private agents observe and do is
// what the public ones publish.
const std::string kPrivate = "/private/";
const std::string kPublic = "/public/";

bool isBelow(const std::string& name, const std::string& group) {
  return name.rfind(group, 0) == 0;
}

/// What both runs have sent, from when this node was there; recorded once.
class Recording {
 public:
  static const Recording& get() {
    static const Recording kRecording;
    return kRecording;
  }

  bool complete() const { return complete_; }
  const std::vector<RecordedMessage>& ofPrivate() const { return private_; }
  const std::vector<RecordedMessage>& ofPublic() const { return public_; }

 private:
  Recording() {
    Recorder recorder;
    complete_ = recorder.record(
        [&] { return ended(recorder.messages(), kPrivate) && ended(recorder.messages(), kPublic); },
        90);
    for (const RecordedMessage& message : recorder.messages()) {
      (isOfPublic(message) ? public_ : private_).push_back(message);
    }
  }

  // every agent of that run is done, the public ones with what they have to show
  static bool ended(const std::vector<RecordedMessage>& messages, const std::string& group) {
    const pmeta::Experiment experiment = readExperiment(ros::NodeHandle(group + "pmeta"));
    std::set<std::uint32_t> done;
    for (const RecordedMessage& message : messages) {
      if (message.type != "pmeta_msgs/AgentStatus" || !isBelow(message.publisher, group)) continue;
      const auto status = message.as<pmeta_msgs::AgentStatus>();
      if (status.state == pmeta_msgs::AgentStatus::DONE) done.insert(status.task);
    }
    return static_cast<int>(done.size()) == experiment.totalTasks();
  }

  // by sender; a log line that was sent on has its writer's name in it. What cannot be told apart
  // counts as private.
  static bool isOfPublic(const RecordedMessage& message) {
    if (message.type == "rosgraph_msgs/Log") {
      return isBelow(message.as<rosgraph_msgs::Log>().name, kPublic);
    }
    return isBelow(message.publisher, kPublic);
  }

  bool complete_ = false;
  std::vector<RecordedMessage> private_, public_;
};

class Privacy : public ::testing::Test {
 protected:
  Privacy()
      : recording_(Recording::get()),
        experiment_(readExperiment(ros::NodeHandle(kPrivate + "pmeta"))) {}
  void SetUp() override { ASSERT_TRUE(recording_.complete()) << "a run did not end in time"; }

  const Recording& recording_;
  pmeta::Experiment experiment_;
};

template <class Msg>
std::vector<Msg> allOf(const std::vector<RecordedMessage>& messages) {
  std::vector<Msg> found;
  for (const RecordedMessage& message : messages) {
    if (message.type == ros::message_traits::datatype<Msg>()) found.push_back(message.as<Msg>());
  }
  return found;
}

/// The numbers of episodes by which they could be recognised: all but small whole ones.
class EpisodeValues {
 public:
  explicit EpisodeValues(const std::vector<pmeta_msgs::Trajectory>& trajectories) {
    for (const pmeta_msgs::Trajectory& one : trajectories) {
      for (const auto* values : {&one.observations, &one.actions, &one.rewards, &one.positions}) {
        for (const double value : *values) add(value);
      }
    }
  }

  std::size_t size() const { return values_.size(); }
  const std::set<double>& values() const { return values_; }

  /// Where one of them stands in the bytes, as float64, text, or `in_a_row` of them as float32; ""
  /// if none does.
  std::string findIn(const std::vector<std::uint8_t>& bytes, std::size_t in_a_row = 1) const {
    for (std::size_t at = 0; at + sizeof(float) <= bytes.size(); ++at) {
      std::size_t n = 0;
      while (n < in_a_row && holds(floats_, bytes, at + n * sizeof(float))) ++n;
      if (n == in_a_row) return "float32 at byte " + std::to_string(at);
      if (holds(doubles_, bytes, at)) return "float64 at byte " + std::to_string(at);
    }
    const std::string text(bytes.begin(), bytes.end());
    for (const std::string& number : texts_) {
      if (text.find(number) != std::string::npos) return "the text " + number;
    }
    return "";
  }

 private:
  void add(double value) {
    const bool trivial = value == std::round(value) && std::abs(value) <= 1000;
    if (trivial || !values_.insert(value).second) return;
    doubles_.insert(bitsOf<std::uint64_t>(value));
    floats_.insert(bitsOf<std::uint32_t>(static_cast<float>(value)));
    addText(pmeta::formatNumber(value));
    addText(pmeta::significant(value, 6));
  }

  // a few digits may stand in any other number by chance
  void addText(const std::string& text) {
    const std::size_t first = text.find_first_of("123456789");
    const auto isDigit = [](unsigned char c) { return std::isdigit(c) != 0; };
    if (first == std::string::npos) return;
    if (std::count_if(text.begin() + first, text.end(), isDigit) >= 5) texts_.push_back(text);
  }

  template <class Bits, class Number>
  static Bits bitsOf(Number value) {
    static_assert(sizeof(Bits) == sizeof(Number), "");
    Bits bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
  }

  template <class Bits>
  static bool holds(const std::unordered_set<Bits>& patterns,
                    const std::vector<std::uint8_t>& bytes, std::size_t at) {
    if (at + sizeof(Bits) > bytes.size()) return false;
    Bits bits;
    std::memcpy(&bits, &bytes[at], sizeof bits);
    return patterns.count(bits) != 0;
  }

  std::set<double> values_;
  std::unordered_set<std::uint64_t> doubles_;
  std::unordered_set<std::uint32_t> floats_;
  std::vector<std::string> texts_;
};

EpisodeValues episodeValues(const Recording& recording) {
  return EpisodeValues(allOf<pmeta_msgs::Trajectory>(recording.ofPublic()));
}

/// The message without its float32 parameters and with its times set to zero: they differ from run
/// to run, and any four bytes that do will one day be those of some number.
std::vector<std::uint8_t> searchedWhole(const RecordedMessage& message) {
  if (message.type == "pmeta_msgs/MetaPolicy") {
    auto msg = message.as<pmeta_msgs::MetaPolicy>();
    msg.header.stamp = ros::Time();
    msg.model.float32_values.clear();
    return serialized(msg);
  }
  if (message.type == "pmeta_msgs/AuxiliaryUpdate") {
    auto msg = message.as<pmeta_msgs::AuxiliaryUpdate>();
    msg.header.stamp = ros::Time();
    msg.model.float32_values.clear();
    return serialized(msg);
  }
  if (message.type == "pmeta_msgs/TaskReturn") {
    auto msg = message.as<pmeta_msgs::TaskReturn>();
    msg.header.stamp = ros::Time();
    msg.wall_s = 0;
    return serialized(msg);
  }
  if (message.type == "pmeta_msgs/RoundSummary") {
    auto msg = message.as<pmeta_msgs::RoundSummary>();
    msg.header.stamp = ros::Time();
    msg.round_s = msg.eta_s = 0;
    return serialized(msg);
  }
  if (message.type == "pmeta_msgs/AgentStatus") {
    auto msg = message.as<pmeta_msgs::AgentStatus>();
    msg.header.stamp = ros::Time();
    msg.env_steps_per_s = msg.updates_per_s = 0;
    return serialized(msg);
  }
  if (message.type == "rosgraph_msgs/Log") {
    auto msg = message.as<rosgraph_msgs::Log>();
    msg.header.stamp = ros::Time();
    return serialized(msg);
  }
  if (message.type == "diagnostic_msgs/DiagnosticArray") {
    auto msg = message.as<diagnostic_msgs::DiagnosticArray>();
    msg.header.stamp = ros::Time();
    return serialized(msg);
  }
  return message.bytes;
}

std::vector<std::uint8_t> parametersOf(const RecordedMessage& message) {
  pmeta_msgs::ModelBlob parameters;
  if (message.type == "pmeta_msgs/MetaPolicy") {
    parameters.float32_values = message.as<pmeta_msgs::MetaPolicy>().model.float32_values;
  }
  if (message.type == "pmeta_msgs/AuxiliaryUpdate") {
    parameters.float32_values = message.as<pmeta_msgs::AuxiliaryUpdate>().model.float32_values;
  }
  return serialized(parameters);
}

/// Where a message holds a number of the episodes; "" if nowhere. Of thousands of parameters some
/// equal one of thousands of numbers by chance: there, and there only, two in a row are looked for.
std::string findInMessage(const EpisodeValues& values, const RecordedMessage& message) {
  const std::string found = values.findIn(searchedWhole(message));
  return found.empty() ? values.findIn(parametersOf(message), 2) : found;
}

TEST_F(Privacy, BothRunsGiveTheSameResult) {
  const auto last = [&](const std::vector<RecordedMessage>& messages) {
    pmeta::MetaPolicy newest;
    for (const auto& msg : allOf<pmeta_msgs::MetaPolicy>(messages)) {
      if (static_cast<int>(msg.round) >= newest.round) newest = fromMsg(msg);
    }
    return newest;
  };
  const pmeta::MetaPolicy of_private = last(recording_.ofPrivate());
  EXPECT_EQ(of_private.round, experiment_.settings().rounds);
  EXPECT_GT(of_private.model.size(), 0u);
  EXPECT_TRUE(of_private.model == last(recording_.ofPublic()).model);
}

TEST_F(Privacy, OnlyTypesThatAreKnownToBeHarmlessAreSent) {
  const std::set<std::string> harmless = {
      "diagnostic_msgs/DiagnosticArray", "pmeta_msgs/AgentStatus",  "pmeta_msgs/AuxiliaryUpdate",
      "pmeta_msgs/MetaPolicy",           "pmeta_msgs/RoundSummary", "pmeta_msgs/Scores",
      "pmeta_msgs/TaskReturn",           "rosgraph_msgs/Log"};
  std::set<std::string> seen;
  for (const RecordedMessage& message : recording_.ofPrivate()) {
    EXPECT_EQ(harmless.count(message.type), 1u) << message.topic << " carries " << message.type;
    seen.insert(message.type);
  }
  EXPECT_EQ(seen, harmless) << "one of them was not recorded at all";

  ros::master::V_TopicInfo topics;
  ASSERT_TRUE(ros::master::getTopics(topics));
  for (const ros::master::TopicInfo& topic : topics) {
    if (isBelow(topic.name, kPublic)) continue;
    EXPECT_EQ(harmless.count(topic.datatype), 1u) << topic.name << " is of " << topic.datatype;
  }
}

TEST_F(Privacy, EveryArrayHoldsParametersOrNamesTasks) {
  const pmeta::ModelLayout layout = experiment_.makeLearner(0)->initialModel(0).layout;
  const auto tasks = static_cast<std::size_t>(experiment_.totalTasks());
  std::set<std::uint32_t> senders;
  for (const auto& msg : allOf<pmeta_msgs::AuxiliaryUpdate>(recording_.ofPrivate())) {
    EXPECT_EQ(fromMsg(msg.model).layout.text(), layout.text());
    EXPECT_TRUE(msg.mac.empty());  // a run without a key signs nothing
    senders.insert(msg.task);
  }
  EXPECT_EQ(static_cast<int>(senders.size()), experiment_.numTasks());
  for (const auto& msg : allOf<pmeta_msgs::MetaPolicy>(recording_.ofPrivate())) {
    EXPECT_EQ(fromMsg(msg.model).layout.text(), layout.text());
    EXPECT_TRUE(msg.mac.empty());
    EXPECT_LE(msg.participants.size(), tasks);
  }
  for (const auto& msg : allOf<pmeta_msgs::RoundSummary>(recording_.ofPrivate())) {
    EXPECT_LE(msg.participants.size(), tasks);
    EXPECT_LE(msg.missing.size(), tasks);
    EXPECT_LE(msg.excluded.size(), tasks);
    EXPECT_TRUE(msg.mac.empty());
  }
  for (const auto& msg : allOf<pmeta_msgs::Scores>(recording_.ofPrivate())) {
    EXPECT_EQ(msg.tasks.size(), tasks);
    EXPECT_EQ(msg.personal.size(), tasks);
    EXPECT_EQ(msg.meta.size(), tasks);
  }
  for (const auto& msg : allOf<pmeta_msgs::TaskReturn>(recording_.ofPrivate())) {
    EXPECT_TRUE(msg.mac.empty());
  }
  // texts could hold arrays too
  for (const auto& msg : allOf<pmeta_msgs::AgentStatus>(recording_.ofPrivate())) {
    EXPECT_LT(msg.message.size(), 200u) << msg.message;
  }
  for (const auto& msg : allOf<diagnostic_msgs::DiagnosticArray>(recording_.ofPrivate())) {
    for (const auto& status : msg.status) {
      EXPECT_LT(status.message.size(), 200u) << status.message;
      EXPECT_LT(status.values.size(), 20u) << status.name;
      for (const auto& value : status.values) EXPECT_LT(value.value.size(), 100u) << value.key;
    }
  }
}

TEST_F(Privacy, NoNumberOfAnEpisodeOccursInAnyMessage) {
  const EpisodeValues values = episodeValues(recording_);
  ASSERT_GT(values.size(), 100u);
  for (const RecordedMessage& message : recording_.ofPrivate()) {
    EXPECT_EQ(findInMessage(values, message), "") << message.topic << ", " << message.type;
  }
}

TEST_F(Privacy, NoNumberOfAnEpisodeIsAParameterOfTheMaster) {
  XmlRpc::XmlRpcValue parameters;
  ASSERT_TRUE(ros::param::get("/private", parameters));
  const std::string text = parameters.toXml();
  EXPECT_NE(text.find("publish_trajectories: false"), std::string::npos);
  EXPECT_EQ(episodeValues(recording_).findIn({text.begin(), text.end()}), "");
}

// the control: the search does find what is there
TEST_F(Privacy, TheSearchFindsTheEpisodesOfThePublicRun) {
  const EpisodeValues values = episodeValues(recording_);
  std::set<std::string> topics;
  for (const RecordedMessage& message : recording_.ofPublic()) {
    const std::string found = findInMessage(values, message);
    EXPECT_EQ(found.empty(), message.type != "pmeta_msgs/Trajectory") << message.topic << found;
    if (!found.empty()) topics.insert(message.topic);
  }
  EXPECT_EQ(static_cast<int>(topics.size()), experiment_.totalTasks());
}

TEST_F(Privacy, TheSearchFindsEachNumberInWhateverFormItIsHidden) {
  const EpisodeValues values = episodeValues(recording_);
  for (const double value : values.values()) {
    pmeta_msgs::ModelBlob blob;
    blob.layout = "odd";  // the numbers do not lie at multiples of their size
    EXPECT_EQ(values.findIn(serialized(blob)), "");
    blob.float64_values = {0.25, value};
    EXPECT_NE(values.findIn(serialized(blob)), "");
    blob.float64_values.clear();
    blob.float32_values = {0.25f, static_cast<float>(value)};
    EXPECT_NE(values.findIn(serialized(blob)), "");
    blob.float32_values.push_back(static_cast<float>(value));
    EXPECT_NE(values.findIn(serialized(blob), 2), "");
    pmeta_msgs::AgentStatus status;
    status.message = "at " + pmeta::formatNumber(value) + " now";
    EXPECT_NE(values.findIn(serialized(status)), "");
  }
}

}  // namespace
}  // namespace pmeta_nodes

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "privacy_test");
  const ros::NodeHandle keep_ros_running;
  return RUN_ALL_TESTS();
}
