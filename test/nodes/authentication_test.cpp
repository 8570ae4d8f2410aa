#include <diagnostic_msgs/DiagnosticArray.h>
#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/TaskReturn.h>
#include <std_srvs/SetBool.h>

#include <algorithm>
#include <map>
#include <random>
#include <regex>
#include <sstream>

#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

constexpr int kForgeries = 10000;

void pause(bool on) {
  std_srvs::SetBool service;
  service.request.data = static_cast<std::uint8_t>(on);
  ASSERT_TRUE(ros::service::waitForService("/pmeta/pause", 20000));
  ASSERT_TRUE(ros::service::call("/pmeta/pause", service));
  EXPECT_TRUE(service.response.success) << service.response.message;
}

// Somebody with everything but the key: what is on the topics, and what was there in other runs.
class Authentication : public RunOverRos {
 protected:
  Authentication()
      : key_(experiment_.settings().key_file),
        other_key_(pmeta::Key{1, 2, 3}),
        aggregator_("pmeta/meta_aggregator: meta aggregator") {
    auxiliary_.pub = nh_.advertise<pmeta_msgs::AuxiliaryUpdate>("auxiliary", 100);
    returns_.pub = nh_.advertise<pmeta_msgs::TaskReturn>("returns", 100);
    meta_policies_.pub = nh_.advertise<pmeta_msgs::MetaPolicy>("meta_policy", 100);
    rounds_.pub = nh_.advertise<pmeta_msgs::RoundSummary>("round", 100);
    auxiliary_.listen(nh_, "auxiliary");
    returns_.listen(nh_, "returns");
    meta_policies_.listen(nh_, "meta_policy");
    rounds_.listen(nh_, "round");
    diagnostics_sub_ = nh_.subscribe("/diagnostics", 200, &Authentication::onDiagnostics, this);
    status_sub_ = nh_.subscribe("agent_status", 100, &Authentication::onStatus, this);
    status_pub_ = nh_.advertise<pmeta_msgs::AgentStatus>("agent_status", 4);
  }

  // One kind of message: what was overheard of it, and what can be made of that.
  template <class Msg>
  struct Kind {
    ros::Publisher pub;
    ros::Subscriber sub;
    std::vector<Msg> heard;

    void listen(ros::NodeHandle& nh, const std::string& topic) {
      sub = nh.subscribe<Msg>(topic, 200,
                              boost::function<void(const ros::MessageEvent<const Msg>&)>(
                                  [this](const ros::MessageEvent<const Msg>& event) {
                                    if (event.getPublisherName() == ros::this_node::getName())
                                      return;
                                    heard.push_back(*event.getMessage());
                                  }));
    }
  };

  static void moveOn(pmeta_msgs::AuxiliaryUpdate& msg) { ++msg.round; }
  static void moveOn(pmeta_msgs::MetaPolicy& msg) { ++msg.round; }
  static void moveOn(pmeta_msgs::TaskReturn& msg) { ++msg.round; }
  static void moveOn(pmeta_msgs::RoundSummary& msg) {
    msg.state = pmeta_msgs::RoundSummary::FINISHED;
    msg.header.stamp = ros::Time::now();
  }

  template <class Msg>
  static std::vector<std::function<void(Msg&)>> blobChanges() {
    return {[](Msg& m) { m.model.float64_values[1] += 1; },
            [](Msg& m) { m.model.float64_values.pop_back(); },
            [](Msg& m) { m.model.present.assign(m.model.float64_values.size(), 1); },
            [](Msg& m) { m.model.layout = "float64\nq_table 1 1\n"; },
            [](Msg& m) { m.model.layout_hash ^= 1; },
            [](Msg& m) { m.model.checksum ^= 1; },
            [](Msg& m) { m.round = 0xffffffffu; }};
  }

  // each changes a field that is acted upon
  static std::vector<std::function<void(pmeta_msgs::AuxiliaryUpdate&)>> changes(
      const pmeta_msgs::AuxiliaryUpdate&) {
    using M = pmeta_msgs::AuxiliaryUpdate;
    auto all = blobChanges<M>();
    all.emplace_back([](M& m) { m.weight = 1e6; });
    all.emplace_back([](M& m) { m.task = (m.task + 1) % 5; });
    all.emplace_back([](M& m) { ++m.round; });
    return all;
  }
  static std::vector<std::function<void(pmeta_msgs::MetaPolicy&)>> changes(
      const pmeta_msgs::MetaPolicy&) {
    using M = pmeta_msgs::MetaPolicy;
    auto all = blobChanges<M>();
    all.emplace_back([](M& m) { m.participants.push_back(0); });
    all.emplace_back([](M& m) { ++m.round; });
    return all;
  }
  static std::vector<std::function<void(pmeta_msgs::TaskReturn&)>> changes(
      const pmeta_msgs::TaskReturn&) {
    using M = pmeta_msgs::TaskReturn;
    return {[](M& m) { ++m.round; },       [](M& m) { m.task = (m.task + 1) % 5; },
            [](M& m) { m.return_mean++; }, [](M& m) { m.env_steps++; },
            [](M& m) { m.policy = 9; },    [](M& m) { m.context_episodes++; }};
  }
  static std::vector<std::function<void(pmeta_msgs::RoundSummary&)>> changes(
      const pmeta_msgs::RoundSummary&) {
    using M = pmeta_msgs::RoundSummary;
    return {[](M& m) { m.state = M::FINISHED; }, [](M& m) { m.state = M::STOPPED; },
            [](M& m) { ++m.round; }, [](M& m) { m.header.stamp += ros::Duration(1); }};
  }

  // the i-th attempt; every way of forging comes in its turn
  template <class Msg>
  void attack(Kind<Msg>& kind, int i) {
    if (kind.heard.empty()) return;
    Msg msg = kind.heard.back();
    moveOn(msg);
    switch (i % 8) {
      case 0:
        msg.mac.clear();
        break;
      case 1:
        for (std::uint8_t& byte : msg.mac) byte = static_cast<std::uint8_t>(random_());
        break;
      case 2:
        sign(other_key_, msg);
        break;
      case 3: {
        const auto all = changes(msg);
        msg = kind.heard.back();
        all[static_cast<std::size_t>(i / 8) % all.size()](msg);
        break;
      }
      case 4:
        if (!returns_.heard.empty()) msg.mac = returns_.heard.front().mac;
        break;
      case 5:
        sign(key_, msg);
        msg.mac.resize(i / 8 % 32);
        break;
      case 6:
        msg = kind.heard[random_() % kind.heard.size()];
        break;
      default:
        // authentic, but of another run with the same key
        msg.run_id = "of_yesterday";
        sign(key_, msg);
    }
    kind.pub.publish(msg);
  }

  void attackAll() {
    attack(auxiliary_, attempts_);
    attack(returns_, attempts_);
    attack(meta_policies_, attempts_);
    attack(rounds_, attempts_);
    ++attempts_;
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(attempts_ % 8 == 0 ? 0.01 : 0));
  }

  // of diagnostics' value: "12 accepted, 3 duplicate, ..."
  static int number(const std::string& text, const std::string& what) {
    std::smatch found;
    return std::regex_search(text, found, std::regex("([0-9]+) " + what)) ? std::stoi(found[1])
                                                                          : -1;
  }

  int value(const std::string& node, const std::string& name) const {
    const auto status = health_.find(node);
    if (status == health_.end() || status->second.count(name) == 0) return 0;
    return std::stoi(status->second.at(name));
  }

  std::string agentHealth(int task) const {
    return "pmeta/task_agent_" + std::to_string(task) + ": task agent";
  }

  // messages that were looked at and not taken, by the aggregator and one agent
  int refusals() const {
    const std::string agent = agentHealth(0);
    int total = value(aggregator_, "returns not due") + value(agent, "replayed: a round message");
    for (const std::string what : {"an update", "a return", "a meta-policy", "a round message"}) {
      for (const std::string& node : {aggregator_, agent}) {
        total += value(node, "unsigned: " + what) + value(node, "forged: " + what);
      }
    }
    for (int task = 0; task < experiment_.numTasks(); ++task) {
      const std::string counts = taskCounts(task);
      for (const std::string what : {"duplicate", "stale", "refused"}) {
        total += std::max(0, number(counts, what));
      }
    }
    return total;
  }

  std::string taskCounts(int task) const {
    const auto status = health_.find(aggregator_);
    const std::string name = experiment_.family().taskName(task);
    return status == health_.end() || status->second.count(name) == 0 ? ""
                                                                      : status->second.at(name);
  }

  // a task agent of this run, but for its key
  void startStranger(const std::string& name, const std::string& key_file) {
    const std::string config = experiment_.runDir() + "." + name + ".yaml";
    std::ofstream(config) << std::regex_replace(experiment_.yaml(), std::regex("key_file: .*"),
                                                "key_file: \"" + key_file + "\"");
    output("rosrun pmeta_nodes task_agent __ns:=/pmeta __name:=" + name +
           " _task:=0 _config_file:=" + config + " > /dev/null 2>&1 & true");
  }

  void stopStranger(const std::string& name) {
    const int pid = pidOf("/pmeta/" + name);
    ASSERT_GT(pid, 0);
    kill(pid, SIGINT);
    EXPECT_TRUE(waitFor([&] { return ::kill(pid, 0) != 0; }, 20)) << "it does not stop";
  }

  void onDiagnostics(const diagnostic_msgs::DiagnosticArray& msg) {
    for (const auto& status : msg.status) {
      auto& values = health_[status.name];
      for (const auto& value : status.values) values[value.key] = value.value;
    }
  }

  void onStatus(const ros::MessageEvent<const pmeta_msgs::AgentStatus>& event) {
    status_[event.getPublisherName()] = *event.getMessage();
  }

  const pmeta::Authenticator key_, other_key_;
  const std::string aggregator_;
  std::mt19937 random_{1};
  int attempts_ = 0;
  Kind<pmeta_msgs::AuxiliaryUpdate> auxiliary_;
  Kind<pmeta_msgs::TaskReturn> returns_;
  Kind<pmeta_msgs::MetaPolicy> meta_policies_;
  Kind<pmeta_msgs::RoundSummary> rounds_;
  ros::Subscriber diagnostics_sub_, status_sub_;
  ros::Publisher status_pub_;
  std::map<std::string, std::map<std::string, std::string>> health_;
  std::map<std::string, pmeta_msgs::AgentStatus> status_;

  void letStrangersIn();
  void replayOldNews();
  void expectCounted();
};

TEST_F(Authentication, NothingOfAStrangersEntersTheRun) {
  ASSERT_TRUE(key_.hasKey());
  ASSERT_TRUE(waitFor([&] { return roundsDone() >= 1; }));
  pause(true);
  ASSERT_NO_FATAL_FAILURE(letStrangersIn());
  pause(false);
  ASSERT_NO_FATAL_FAILURE(replayOldNews());

  // while rounds pass, and then for as long as it takes
  ASSERT_TRUE(waitFor([&] {
    for (int i = 0; i < 10; ++i) attackAll();
    return roundsDone() >= 6 || finished();
  }));
  ASSERT_FALSE(finished());
  pause(true);
  EXPECT_TRUE(waitFor(
      [&] {
        for (int i = 0; i < 10; ++i) attackAll();
        return refusals() >= kForgeries;
      },
      100))
      << refusals() << " refusals of " << attempts_ << " attempts in each of four ways";
  ASSERT_FALSE(finished());
  pause(false);
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  expectCounted();
  std::printf("%d attempts on each of four topics, %d refusals counted\n", attempts_, refusals());
  expectEqualsLocal();
}

// with another key, and without any
void Authentication::letStrangersIn() {
  // nothing it hears is for it
  const std::string wrong = experiment_.settings().key_file + ".wrong";
  pmeta::createKeyFile(wrong);
  startStranger("wrong_key", wrong);
  ASSERT_TRUE(waitFor([&] {
    return status_["/pmeta/wrong_key"].message.find("another key than this node's key_file") !=
           std::string::npos;
  }));
  EXPECT_EQ(status_["/pmeta/wrong_key"].state, pmeta_msgs::AgentStatus::WAITING);
  EXPECT_EQ(status_["/pmeta/wrong_key"].round, 0u);
  stopStranger("wrong_key");

  // nothing of what it says is taken
  startStranger("no_key", "");
  ASSERT_TRUE(waitFor([&] { return value(aggregator_, "unsigned: an update") > 0; }));
  stopStranger("no_key");
  bool told = false;
  for (const auto& message : history_) {
    told = told || message.message.find(
                       "an update carries no MAC: its sender must use this run's "
                       "key_file.") != std::string::npos;
  }
  EXPECT_TRUE(told);
}

// signed, but recorded before anybody of this run was there: its guard and its agents stay
void Authentication::replayOldNews() {
  pmeta_msgs::RoundSummary old = *summary_;
  old.state = pmeta_msgs::RoundSummary::STOPPED;
  old.header.stamp = ros::Time(1);
  sign(key_, old);
  rounds_.pub.publish(old);
  // no agent has failed
  pmeta_msgs::AgentStatus failure = status_["/pmeta/task_agent_0"];
  ASSERT_EQ(failure.run_id, experiment_.settings().run_id);
  failure.state = pmeta_msgs::AgentStatus::FAILED;
  status_pub_.publish(failure);
  ASSERT_TRUE(waitFor([&] { return value(aggregator_, "forged: an agent's failure") > 0; }));
}

// every refusal is counted where it happened, and nothing else than the run's own came in
void Authentication::expectCounted() {
  EXPECT_GT(value(aggregator_, "forged: an update"), 0);
  EXPECT_GT(value(aggregator_, "unsigned: a return"), 0);
  EXPECT_GT(value(aggregator_, "forged: a return"), 0);
  for (int task = 0; task < experiment_.numTasks(); ++task) {
    EXPECT_GT(value(agentHealth(task), "forged: a meta-policy"), 0);
    EXPECT_GT(value(agentHealth(task), "unsigned: a meta-policy"), 0);
    EXPECT_GT(value(agentHealth(task), "forged: a round message"), 0);
    EXPECT_TRUE(waitFor([&] { return number(taskCounts(task), "accepted") >= 12; }, 10));
    EXPECT_EQ(number(taskCounts(task), "accepted"), 12) << taskCounts(task);
  }
  const int returns = static_cast<int>(readCsv().size()) - 1;
  // diagnostics are up to a second old
  EXPECT_TRUE(waitFor([&] { return value(aggregator_, "returns booked") >= returns; }, 10));
  EXPECT_EQ(value(aggregator_, "returns booked"), returns);
  const auto told_of = [](const auto& message) {
    return message.message.find("refused: ") != std::string::npos;
  };
  EXPECT_LT(std::count_if(history_.begin(), history_.end(), told_of), kForgeries / 20)
      << "not each may be told";
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("authentication_test")
