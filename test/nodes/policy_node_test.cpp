#include <diagnostic_msgs/DiagnosticArray.h>
#include <spawn.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/storage/policy_file.h"
#include "run_over_ros.h"

extern char** environ;

namespace pmeta_nodes {
namespace {

using std_msgs::Float64MultiArray;

// starts a program of this package, as late_joiner_test does
int start(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), {"rosrun", "pmeta_nodes"});
  arguments.push_back(nullptr);
  pid_t pid = -1;
  posix_spawnp(&pid, "rosrun", nullptr, nullptr, const_cast<char**>(arguments.data()), environ);
  return pid;
}

class PolicyNodeTest : public RunOverRos {
 protected:
  PolicyNodeTest() {
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    observation_pub_ = nh_.advertise<Float64MultiArray>("observation", 1);
    action_sub_ = nh_.subscribe("action", 1, &PolicyNodeTest::onAction, this, hints);
  }

  // sends an observation; the action that comes back within `seconds`
  std::optional<double> ask(const std::vector<double>& observation, double seconds) {
    Float64MultiArray msg;
    msg.data = observation;
    action_.reset();
    observation_pub_.publish(msg);
    const auto limit = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!action_ && std::chrono::steady_clock::now() < limit) {
      ros::getGlobalCallbackQueue()->callOne(ros::WallDuration(0.01));
    }
    return action_;
  }

  // the same run in this process leaves the same policies
  void expectThePoliciesOfALocalRun(const std::string& policies) {
    char folder[] = "/tmp/pmeta_policy_XXXXXX";
    ASSERT_NE(mkdtemp(folder), nullptr);
    const pmeta::Experiment local = pmeta::Experiment::parse(
        experiment_.yaml(), "the run", {"results_dir:=" + std::string(folder)});
    pmeta::RunLog log(local);
    pmeta::runLocally(local, &log);
    for (const std::string file : {"meta", "task_0", "task_1"}) {
      const std::string name = file + ".safetensors";
      const pmeta::PolicyFile mine = pmeta::loadPolicy(log.dir() + "/policies/" + name);
      pmeta::PolicyFile over_ros = pmeta::loadPolicy(policies + name);
      EXPECT_TRUE(over_ros.model == mine.model) << name;
      EXPECT_EQ(over_ros.metadata["round"], "10");
    }
    std::filesystem::remove_all(folder);
  }

  void measureLatency() {
    std::vector<double> microseconds;
    for (int k = 0; k < 1000; ++k) {
      const auto sent = std::chrono::steady_clock::now();
      ASSERT_TRUE(ask({1, 2}, 5).has_value());
      microseconds.push_back(
          std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - sent)
              .count());
    }
    std::sort(microseconds.begin(), microseconds.end());
    std::printf("observation to action: median %.0f us, 99 %% below %.0f us, longest %.0f us\n",
                microseconds[500], microseconds[990], microseconds[999]);
  }

  void onAction(const Float64MultiArray::ConstPtr& msg) {
    ASSERT_EQ(msg->data.size(), 1u);
    action_ = msg->data[0];
  }

  ros::Publisher observation_pub_;
  ros::Subscriber action_sub_;
  std::optional<double> action_;
};

TEST_F(PolicyNodeTest, ARunsPersonalPolicyAnswersObservationsWithItsGreedyAction) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  const std::string policies = experiment_.runDir() + "/policies/";

  expectThePoliciesOfALocalRun(policies);
  const pmeta::Model model = pmeta::loadPolicy(policies + "task_1.safetensors").model;

  const std::string policy = "_policy:=" + policies + "task_1.safetensors";
  const int pid = start({"policy_node", policy.c_str(), "__ns:=/pmeta"});
  ASSERT_TRUE(waitFor(
      [&] {
        return observation_pub_.getNumSubscribers() > 0 && action_sub_.getNumPublishers() > 0;
      },
      20));
  ASSERT_TRUE(waitFor([&] { return ask({0, 0}, 0.1).has_value(); }, 10)) << "connected by now";

  for (int cell = 0; cell < 15; ++cell) {
    const double* values = &model.doubles()[static_cast<std::size_t>(4 * cell)];
    const auto action = ask({static_cast<double>(cell / 4), static_cast<double>(cell % 4)}, 5);
    ASSERT_TRUE(action.has_value());
    EXPECT_EQ(*action, std::max_element(values, values + 4) - values) << "cell " << cell;
  }
  for (const std::vector<double>& bad : std::vector<std::vector<double>>{
           {}, {0}, {0, 0, 0}, {std::nan(""), 0}, {1e300, 0}, {3, 3}}) {
    EXPECT_FALSE(ask(bad, 0.05).has_value());
  }

  measureLatency();

  std::string health;
  const ros::Subscriber diagnostics = nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 16, [&health](const diagnostic_msgs::DiagnosticArray::ConstPtr& msg) {
        for (const auto& status : msg->status) {
          if (status.name.find("policy") == std::string::npos) continue;
          health = status.hardware_id + ": " + status.message + "\n";
          for (const auto& value : status.values) health += value.key + " " + value.value + "\n";
        }
      });
  EXPECT_TRUE(waitFor([&] { return !health.empty(); }, 10));
  std::printf("%s", health.c_str());
  EXPECT_NE(health.find("personal policy of grid_4x4, round 10"), std::string::npos);
  EXPECT_NE(health.find("refused observations 6\n"), std::string::npos);
  EXPECT_NE(health.find("mean latency [us] "), std::string::npos);

  kill(pid, SIGINT);
  int status = -1;
  waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

// a run of the point robot in this process, whose meta-policy finds out its task
std::string exploringPolicy(const std::string& folder) {
  const pmeta::Experiment experiment = pmeta::Experiment::parse(
      "experiment: point\nrun_id: run\nrounds: 2\nupdates_per_round: 20\nlearner: sac\n"
      "personal: {alpha: 0.001, lambda: 15, eta: 0.01}\n"
      "sac: {hidden: [12, 10], batch_size: 16, buffer_size: 500, warm_up_steps: 40, "
      "task_encoding: model, evaluation_episodes: 2}\n"
      "environment: {name: sparse_point_robot}\n",
      "point.yaml", {"results_dir:=" + folder});
  pmeta::RunLog log(experiment);
  pmeta::runLocally(experiment, &log);
  return log.dir() + "/policies/meta.safetensors";
}

// a policy_node that explores, and who drives it, in a namespace of their own
class Explorer {
 public:
  explicit Explorer(const std::string& path) : expected(path) {
    const std::string policy = "_policy:=" + path;
    pid_ = start({"policy_node", policy.c_str(), "_seed:=5", "__ns:=explorer", "__name:=explorer"});
    EXPECT_TRUE(expected.explore(5));
  }

  bool connected() {
    return observations_.getNumSubscribers() > 0 && rewards_.getNumSubscribers() > 0 &&
           actions_.getNumPublishers() > 0 && ros::service::exists("explorer/begin_episode", false);
  }
  void send(double x) {
    Float64MultiArray msg;
    msg.data = {x, 0.2};
    observations_.publish(msg);
  }
  void sendReward(double value) {
    std_msgs::Float64 msg;
    msg.data = value;
    rewards_.publish(msg);
  }
  // what it says of itself
  std::string beginEpisode() {
    std_srvs::Trigger begin;
    EXPECT_TRUE(ros::service::call("explorer/begin_episode", begin));
    expected.beginEpisode();
    return begin.response.message;
  }
  int end() const {
    kill(pid_, SIGINT);
    int status = -1;
    waitpid(pid_, &status, 0);
    return status;
  }

  pmeta::LoadedPolicy expected;               // does the same in this process
  std::optional<std::vector<double>> action;  // the last answer

 private:
  ros::NodeHandle nh_{"explorer"};
  ros::Publisher observations_ = nh_.advertise<Float64MultiArray>("observation", 1);
  ros::Publisher rewards_ = nh_.advertise<std_msgs::Float64>("reward", 1);
  ros::Subscriber actions_ = nh_.subscribe<Float64MultiArray>(
      "action", 1, [this](const Float64MultiArray::ConstPtr& msg) { action = msg->data; });
  int pid_ = -1;
};

TEST_F(PolicyNodeTest, AMetaPolicyFindsOutItsTaskBeforeItActs) {
  char folder[] = "/tmp/pmeta_policy_XXXXXX";
  ASSERT_NE(mkdtemp(folder), nullptr);
  Explorer explorer(exploringPolicy(folder));
  ASSERT_TRUE(waitFor([&] { return explorer.connected(); }, 20));
  const auto answered = [&] { return explorer.action.has_value(); };
  for (int episode = 1; episode <= 3; ++episode) {
    const bool explores = episode < 3;
    EXPECT_EQ(explorer.beginEpisode(),
              explores ? "exploring, episode " + std::to_string(episode) + " of 2" : "acting");
    double x = 0.1 * episode;
    explorer.send(x);
    for (int t = 0; t < 6; ++t) {
      std::vector<double> expected(2);
      const double here[] = {x, 0.2};
      ASSERT_TRUE(explorer.expected.act(here, expected.data()));
      ASSERT_TRUE(waitFor(answered, 5)) << "episode " << episode << ", step " << t;
      EXPECT_EQ(*explorer.action, expected) << "episode " << episode << ", step " << t;
      explorer.action.reset();
      x += 0.1 * expected[0];
      const double next[] = {x, 0.2};
      explorer.expected.observe(t % 2, next);
      // in either order; a policy that knows its task needs no reward
      const bool reward_first = t % 2 == 1;
      if (!reward_first) explorer.send(x);
      if (explores && !reward_first) {
        EXPECT_FALSE(waitFor(answered, 0.05)) << "half of it is known";
      }
      if (explores) explorer.sendReward(t % 2);
      if (reward_first) explorer.send(x);
    }
    ASSERT_TRUE(waitFor(answered, 5));
    explorer.action.reset();
  }
  const int status = explorer.end();
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  std::filesystem::remove_all(folder);
}

TEST_F(PolicyNodeTest, SaysInOneSentenceWhatIsWrong) {
  // names of their own: a second node of this test's name would end it
  const std::string text = output(
      "{ rosrun pmeta_nodes policy_node --help;"
      " rosrun pmeta_nodes policy_node __name:=a & rosrun pmeta_nodes policy_node __name:=b "
      "_policy:=/none & rosrun pmeta_nodes policy_node __name:=c _policy:=/none _task:=abc & "
      "rosrun pmeta_nodes policy_node __name:=d _task:=7 _policy:=" +
      experiment_.runDir() + "/policies/task_0.safetensors" + "; wait; }");
  EXPECT_EQ(text.find("policy_node: acts with a trained policy from a file."), 0u) << text;
  EXPECT_NE(text.find("which policy? Give the private parameter policy, e.g."), std::string::npos)
      << text;
  EXPECT_NE(text.find("the policy file /none cannot be read (No such file or directory)."),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("the private parameter task is 'abc' but must be a whole number from 0 to"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("is the personal policy of task 0: leave the parameter out."),
            std::string::npos)
      << text;
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("policy_node_test")
