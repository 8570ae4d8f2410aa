#include "pmeta_core/run/roll_call.h"

#include <gtest/gtest.h>

namespace pmeta {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const RollCall::Time kStart{};

RollCall makeCall() { return RollCall(3, milliseconds(1500), seconds(10), kStart); }

TEST(RollCall, GivesAgentsTimeToStart) {
  const RollCall call = makeCall();
  EXPECT_TRUE(call.silent(kStart + seconds(10)).empty());
  EXPECT_EQ(call.silent(kStart + milliseconds(10001)), (std::vector<int>{0, 1, 2}));
  EXPECT_FALSE(call.known(1));
  EXPECT_DOUBLE_EQ(call.silence(1, kStart + seconds(4)), 4);
}

TEST(RollCall, NamesWhoFallsSilentAndWhoIsBack) {
  RollCall call = makeCall();
  for (int agent = 0; agent < 3; ++agent) call.heard(agent, kStart + seconds(1));
  EXPECT_TRUE(call.known(2));
  call.heard(0, kStart + seconds(2));
  call.heard(2, kStart + seconds(2));
  EXPECT_EQ(call.silent(kStart + milliseconds(2501)), (std::vector<int>{1}));
  EXPECT_DOUBLE_EQ(call.silence(1, kStart + seconds(3)), 2);
  call.heard(1, kStart + seconds(3));
  EXPECT_TRUE(call.silent(kStart + seconds(3)).empty());
}

TEST(RollCall, IgnoresAgentsThatDoNotExist) {
  RollCall call = makeCall();
  call.heard(-1, kStart);
  call.heard(3, kStart);
  EXPECT_TRUE(call.silent(kStart).empty());
}

}  // namespace
}  // namespace pmeta
