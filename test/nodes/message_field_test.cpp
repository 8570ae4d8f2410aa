// A field of a message on its whole way, step by step as docs/adding.md has it: `losses` of
// TaskReturn.
#include <gtest/gtest.h>
#include <ros/serialization.h>

#include <cmath>

#include "../core/memory_state.h"
#include "../core/support.h"
#include "common/conversions.h"
#include "pmeta_core/storage/round_book.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta_nodes {
namespace {

using pmeta::test::errorOf;

pmeta::TaskReturn result() {
  pmeta::TaskReturn result;
  result.run_id = "run";
  result.round = 1;
  result.episodes = 1;
  result.losses = {{"critic", 0.5}, {"kl", std::nan("")}};
  return result;
}

template <class Msg>
Msg overTheWire(const Msg& msg) {
  std::vector<std::uint8_t> buffer(ros::serialization::serializationLength(msg));
  ros::serialization::OStream out(buffer.data(), static_cast<std::uint32_t>(buffer.size()));
  ros::serialization::serialize(out, msg);
  Msg copy;
  ros::serialization::IStream in(buffer.data(), static_cast<std::uint32_t>(buffer.size()));
  ros::serialization::deserialize(in, copy);
  return copy;
}

void expectLosses(const pmeta::TaskReturn& found) {
  ASSERT_EQ(found.losses.size(), 2u);
  EXPECT_EQ(found.losses[0].name, "critic");
  EXPECT_EQ(found.losses[0].value, 0.5);
  EXPECT_EQ(found.losses[1].name, "kl");
  EXPECT_TRUE(std::isnan(found.losses[1].value));
}

TEST(MessageField, StepsTwoAndFourItComesBackAsItWent) {
  expectLosses(fromMsg(overTheWire(toMsg(result(), "grid"))));
}

TEST(MessageField, StepThreeABadFormIsRefusedWhereMessagesComeIn) {
  pmeta_msgs::TaskReturn msg = toMsg(result(), "grid");
  msg.loss_names.pop_back();
  EXPECT_EQ(errorOf([&] { fromMsg(msg); }), "a return has 2 losses of 1 names.");
}

TEST(MessageField, StepThreeWhatIsOfNoRunIsRefusedByTheCore) {
  const auto refused = [](const std::vector<pmeta::Loss>& losses) {
    pmeta::TaskReturn bad = result();
    bad.losses = losses;
    return errorOf(
        [&] { pmeta::RoundBook(pmeta::Experiment::parse("run_id: run", "test")).add(bad); });
  };
  EXPECT_EQ(refused(result().losses), "(no error)");
  EXPECT_EQ(refused({{"a,b\n", 1}}),
            "the return of task 0 in round 1 is no result: it names a loss 'a,b?', which is no "
            "word.");
  EXPECT_EQ(refused({{"", 1}}),
            "the return of task 0 in round 1 is no result: it names a loss '', which is no word.");
  EXPECT_EQ(refused(std::vector<pmeta::Loss>(101, {"td", 1})),
            "the return of task 0 in round 1 is no result: it has 101 losses.");
}

TEST(MessageField, StepFiveItsMacGuardsIt) {
  const pmeta::Authenticator authenticator(pmeta::Key{1});
  const pmeta_msgs::TaskReturn msg = toMsg(result(), "grid");
  pmeta_msgs::TaskReturn other = msg;
  other.losses[0] = 0.25;
  EXPECT_NE(macOf(authenticator, other), macOf(authenticator, msg));
  // the same bytes, divided in another way
  other = msg;
  other.loss_names = {"criti", "ckl"};
  EXPECT_NE(macOf(authenticator, other), macOf(authenticator, msg));
}

TEST(MessageField, StepSixItIsPartOfAState) {
  pmeta::TaskReturn loaded;
  pmeta::test::load(loaded, pmeta::test::stateOf(result()));
  expectLosses(loaded);
}

TEST(MessageField, StepSevenItReachesTheRunFolder) {
  EXPECT_EQ(pmeta::RunLog::lossLines(result()), "1,0,critic,0.5\n1,0,kl,nan\n");
}

}  // namespace
}  // namespace pmeta_nodes
