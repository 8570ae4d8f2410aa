#include <algorithm>
#include <chrono>
#include <memory>

#include "pmeta_core/env/cart_pole.h"
#include "pmeta_core/env/remote_family.h"
#include "pmeta_nodes/env_server.h"
#include "remote/service_link.h"
#include "run_over_ros.h"

namespace pmeta_nodes {
namespace {

// the cart-pole itself, in this process: an episode begins from the number that ResetEnv would have
class InProcess : public pmeta::RemoteLink {
 public:
  explicit InProcess(double force) : pole_({force, 0.1, 0.5}) {}

  std::vector<double> reset(std::uint64_t, std::uint64_t seed) override {
    rng_ = pmeta::Rng(seed, 0, pmeta::Stream::kCollect);
    std::vector<double> observation(4);
    pole_.reset(rng_, observation.data());
    return observation;
  }
  pmeta::RemoteAnswer step(std::uint64_t, std::uint32_t,
                           const std::vector<double>& action) override {
    pmeta::RemoteAnswer answer{std::vector<double>(4)};
    const pmeta::Step step = pole_.step(action.data(), rng_, answer.observation.data());
    answer.reward = step.reward;
    answer.terminated = step.terminated;
    answer.truncated = step.truncated;
    return answer;
  }
  void warn(const std::string& sentence) override { ADD_FAILURE() << sentence; }

 private:
  pmeta::CartPole pole_;
  pmeta::Rng rng_{0, 0, pmeta::Stream::kCollect};
};

TEST_F(RunOverRos, EqualsTheSameBodiesInProcessBitForBit) {
  ASSERT_TRUE(waitFor([&] { return finished(); }));
  const auto over_ros = pmeta::RemoteFamily::connector();
  pmeta::RemoteFamily::connector() = [](const std::string& ns, const auto&, const auto&, auto&) {
    return std::make_unique<InProcess>(ns == "/cart_pole_0" ? 10 : 5);
  };
  expectEqualsLocal();
  pmeta::RemoteFamily::connector() = over_ros;
}

class ToTheSpareBody : public RunOverRos {
 protected:
  ToTheSpareBody()
      : expected_(dynamic_cast<const pmeta::RemoteFamily&>(experiment_.family()).description()) {}

  pmeta::RemoteDescription expected_;
  pmeta::RemotePatience patience_;
  pmeta::RemoteFigures figures_;
};

TEST_F(ToTheSpareBody, StepsGoOverOneConnectionThatStays) {
  ServiceLink link("/spare", expected_, patience_, figures_);
  std::vector<double> micros;
  std::uint32_t step = 0;
  std::uint64_t episode = 0;
  for (bool over = true; micros.size() < 2000;) {
    if (over) {
      ++episode;
      link.reset(episode, episode);
      step = 0;
    }
    const auto start = std::chrono::steady_clock::now();
    ++step;
    const pmeta::RemoteAnswer answer = link.step(episode, step, {static_cast<double>(step % 2)});
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
    micros.push_back(took.count());
    over = answer.terminated || answer.truncated;
  }
  EXPECT_EQ(figures_.connections, 3) << "one for each service";
  std::sort(micros.begin(), micros.end());
  std::printf("round trip of a step: median %.0f us, 95 %% within %.0f us\n",
              micros[micros.size() / 2], micros[micros.size() * 95 / 100]);
}

TEST_F(ToTheSpareBody, WhoeverIsNotWhatTheSettingsSayIsRefused) {
  expected_.observation[1].unit = "km/h";
  ServiceLink link("/spare", expected_, patience_, figures_);
  try {
    link.reset(1, 1);
    ADD_FAILURE() << "it was taken";
  } catch (const pmeta::LostEnvironment& error) {
    EXPECT_STREQ(error.what(),
                 "/spare is not what the settings say: observation 'velocity' is in 'm/s' but must "
                 "be in 'km/h'; mend its server or environment in the settings.");
  }
}

TEST_F(ToTheSpareBody, ThePatienceWithWhoeverIsAwayEnds) {
  patience_.patience = 1;
  ServiceLink link("/nobody", expected_, patience_, figures_);
  try {
    link.reset(1, 1);
    ADD_FAILURE() << "nobody answered";
  } catch (const pmeta::LostEnvironment& error) {
    const std::string sentence = error.what();
    EXPECT_EQ(sentence.rfind("the services of /nobody have not answered for 1.", 0), 0u)
        << sentence;
  }
}

// a server that makes its first step so slowly that it is asked again, over another connection
TEST_F(ToTheSpareBody, AStepThatIsAskedForAgainIsMadeOnce) {
  ros::NodeHandle node("/slow");
  ros::CallbackQueue queue;
  node.setCallbackQueue(&queue);
  int steps = 0;
  pmeta_msgs::DescribeEnv::Response described;
  for (const pmeta::Quantity& one : expected_.observation) {
    addObservation(described, one.name, one.unit, one.low, one.high);
  }
  addAction(described, "push", "", 0, 1);
  described.choices = expected_.choices;
  described.step_seconds = expected_.step_seconds;
  const std::vector<double> seen(4, 0.01);
  EnvServer server(
      described, [&](std::uint64_t) { return seen; },
      [&](const std::vector<double>&) {
        if (++steps == 1) ros::WallDuration(0.6).sleep();
        return EnvServer::Result{seen, static_cast<double>(steps)};
      });
  server.advertise(node);
  ros::AsyncSpinner spinner(2, &queue);
  spinner.start();
  patience_.timeout = 0.2;
  ServiceLink link("/slow", expected_, patience_, figures_);
  link.reset(1, 1);
  EXPECT_EQ(link.step(1, 1, {0}).reward, 1);
  EXPECT_EQ(link.step(1, 2, {0}).reward, 2);
  EXPECT_EQ(steps, 2);
  EXPECT_GT(figures_.connections, 3) << "it was asked for again";
}

}  // namespace
}  // namespace pmeta_nodes

PMETA_ROSTEST_MAIN("remote_test")
