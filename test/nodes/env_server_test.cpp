#include "pmeta_nodes/env_server.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "pmeta_core/base/error.h"
#include "remote/service_link.h"

namespace pmeta_nodes {
namespace {

// counts what is done to it
class EnvServerTest : public ::testing::Test {
 protected:
  static pmeta_msgs::DescribeEnv::Response description() {
    pmeta_msgs::DescribeEnv::Response described;
    addObservation(described, "x", "m");
    addAction(described, "speed", "m/s", -1, 1);
    return described;
  }

  pmeta_msgs::ResetEnv::Response reset(std::uint64_t session, std::uint64_t episode,
                                       std::uint64_t seed = 7) {
    pmeta_msgs::ResetEnv service;
    service.request.session = session;
    service.request.episode = episode;
    service.request.seed = seed;
    EXPECT_TRUE(server_.reset(service.request, service.response));
    return service.response;
  }
  pmeta_msgs::StepEnv::Response step(std::uint64_t session, std::uint64_t episode,
                                     std::uint32_t number, std::vector<double> action = {0.5}) {
    pmeta_msgs::StepEnv service;
    service.request.session = session;
    service.request.episode = episode;
    service.request.step = number;
    service.request.action = std::move(action);
    EXPECT_TRUE(server_.step(service.request, service.response));
    return service.response;
  }

  bool jammed_ = false;
  int resets_ = 0;
  double x_ = 0;
  EnvServer server_{description(),
                    [this](std::uint64_t seed) {
                      if (jammed_) throw std::runtime_error("the wheel is jammed");
                      ++resets_;
                      x_ = static_cast<double>(seed);
                      return std::vector<double>{x_};
                    },
                    [this](const std::vector<double>& action) {
                      if (jammed_) throw std::runtime_error("the wheel is jammed");
                      x_ += action[0];
                      return EnvServer::Result{{x_}, -x_, x_ > 8};
                    }};
};

TEST_F(EnvServerTest, WhatIsAskedForAgainIsDoneOnce) {
  EXPECT_EQ(reset(1, 1).observation, (std::vector<double>{7}));
  EXPECT_EQ(reset(1, 1).observation, (std::vector<double>{7}));
  EXPECT_EQ(resets_, 1);
  for (int k = 0; k < 3; ++k) {
    const auto answer = step(1, 1, 1);
    EXPECT_EQ(answer.error, "");
    EXPECT_EQ(answer.observation, (std::vector<double>{7.5}));
    EXPECT_EQ(answer.reward, -7.5);
  }
  step(1, 1, 2);
  EXPECT_TRUE(step(1, 1, 3).terminated);
  EXPECT_TRUE(step(1, 1, 3).terminated) << "the last answer may have been lost, too";
  EXPECT_EQ(x_, 8.5);
}

TEST_F(EnvServerTest, ALateRequestChangesNothing) {
  EXPECT_EQ(step(1, 1, 1).error,
            "there is no such episode: it was begun before this server was, or another agent has "
            "begun one since.");
  reset(1, 1);
  step(1, 1, 1);
  step(1, 1, 2);
  EXPECT_EQ(step(1, 1, 1).error, "step 1 cannot be made after step 2.");
  EXPECT_EQ(step(1, 1, 4).error, "step 4 cannot be made after step 2.");
  reset(1, 2);
  EXPECT_EQ(reset(1, 1).error, "episode 1 is over: episode 2 has begun.");
  EXPECT_NE(step(1, 1, 3).error, "");
  EXPECT_EQ(step(1, 2, 0).error, "step 0 cannot be made after step 0.");
  EXPECT_EQ(resets_, 2);
  EXPECT_EQ(x_, 7);
}

TEST_F(EnvServerTest, AnAgentThatHasStartedAgainTakesOver) {
  reset(1, 5);
  EXPECT_EQ(reset(2, 1, 3).observation, (std::vector<double>{3}));
  EXPECT_NE(step(1, 5, 1).error, "");
  EXPECT_EQ(step(2, 1, 1).observation, (std::vector<double>{3.5}));
}

TEST_F(EnvServerTest, AnEpisodeThatIsOverIsNotActedIn) {
  reset(1, 1, 8);
  EXPECT_TRUE(step(1, 1, 1).terminated);
  EXPECT_EQ(step(1, 1, 2).error, "step 2 cannot be made after step 1, which ended the episode.");
}

TEST_F(EnvServerTest, WhatIsThrownIsTheAnswer) {
  jammed_ = true;
  EXPECT_EQ(reset(1, 1).error, "the wheel is jammed");
  jammed_ = false;
  EXPECT_EQ(reset(1, 1).error, "the wheel is jammed") << "as it was answered";
  EXPECT_EQ(step(1, 1, 1).error, "step 1 cannot be made after step 0, which ended the episode.");
  EXPECT_EQ(reset(1, 2).error, "");
  jammed_ = true;
  EXPECT_EQ(step(1, 2, 1).error, "the wheel is jammed");
}

TEST_F(EnvServerTest, TheRobotIsGivenNoActionThatItDoesNotTake) {
  reset(1, 1);
  EXPECT_EQ(step(1, 1, 1, {}).error, "an action of 0 numbers is not one of 1.");
  EXPECT_EQ(step(1, 1, 1, {1.5}).error,
            "speed of an action is 1.500000, which is out of its limits.");
  EXPECT_NE(step(1, 1, 1, {std::numeric_limits<double>::quiet_NaN()}).error, "");
  EXPECT_EQ(x_, 7);
  EXPECT_EQ(step(1, 1, 1).error, "");
}

TEST_F(EnvServerTest, ItsDescriptionIsReadAsItWasGiven) {
  pmeta_msgs::DescribeEnv service;
  server_.describe(service.request, service.response);
  const pmeta::RemoteDescription told = fromMsg(service.response, "/robot");
  EXPECT_EQ(told.observation.at(0).unit, "m");
  EXPECT_EQ(told.action.at(0).high, 1);
  service.response.action_units.clear();
  try {
    fromMsg(service.response, "/robot");
    ADD_FAILURE() << "half a description was taken";
  } catch (const pmeta::LostEnvironment& error) {
    EXPECT_STREQ(error.what(),
                 "/robot/describe names 1 numbers of an action but has other numbers of units or "
                 "limits: mend the server.");
  }
}

}  // namespace
}  // namespace pmeta_nodes
