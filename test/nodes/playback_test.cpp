#include "view/playback.h"

#include <gtest/gtest.h>

#include "pmeta_nodes/card.h"
#include "scene_support.h"

namespace pmeta_nodes {
namespace {

using namespace test;

Trajectory::ConstPtr episode(int policy, int steps, const std::string& run_id = "run") {
  Trajectory message = episodeOf(0, policy, 1, std::vector<double>(steps + 1, 0.0));
  message.run_id = run_id;
  return shared(message);
}

TEST(Playback, PlaysToTheEndOfTheLongerEpisodeAndBeginsAnew) {
  Playback playback(0.1);
  EXPECT_TRUE(playback.offer(episode(Trajectory::PERSONAL, 10)));
  EXPECT_TRUE(playback.offer(episode(Trajectory::META, 30)));
  EXPECT_FALSE(playback.advance(3 + Playback::kPause - 0.01));
  EXPECT_DOUBLE_EQ(3 + Playback::kPause - 0.01, playback.seconds());
  EXPECT_FALSE(playback.advance(0.02));
  EXPECT_EQ(0, playback.seconds());
}

TEST(Playback, ANewEpisodeWaitsForTheEndAndTheLastOneWins) {
  Playback playback(0.1);
  const auto first = episode(Trajectory::META, 10);
  const auto last = episode(Trajectory::META, 20);
  playback.offer(first);
  playback.advance(0.5);
  EXPECT_FALSE(playback.offer(episode(Trajectory::META, 5)));
  EXPECT_FALSE(playback.offer(last));
  EXPECT_FALSE(playback.advance(0.5));
  EXPECT_EQ(first, playback.meta());
  EXPECT_TRUE(playback.advance(Playback::kPause));
  EXPECT_EQ(last, playback.meta());
  EXPECT_EQ(nullptr, playback.personal());
}

TEST(Playback, ALongEpisodeKeepsANewOneWaitingForAMinuteAtMost) {
  Playback playback(0.1);
  const auto last = episode(Trajectory::META, 20);
  playback.offer(episode(Trajectory::PERSONAL, 50000));
  EXPECT_FALSE(playback.advance(1000)) << "nobody waits";
  playback.offer(last);
  playback.offer(episode(Trajectory::PERSONAL, 10));
  EXPECT_FALSE(playback.advance(Playback::kLongestWait - 1));
  EXPECT_TRUE(playback.advance(1));
  EXPECT_EQ(10u, playback.personal()->rewards.size());
  EXPECT_EQ(last, playback.meta());
  EXPECT_EQ(0, playback.seconds());
}

TEST(Playback, WithoutPlayingANewEpisodeIsShownAtOnce) {
  Playback playback(0);
  const auto last = episode(Trajectory::PERSONAL, 2);
  EXPECT_TRUE(playback.offer(episode(Trajectory::PERSONAL, 1)));
  EXPECT_TRUE(playback.offer(last));
  EXPECT_EQ(last, playback.personal());
}

TEST(Playback, ForgetsOtherRuns) {
  Playback playback(0.1);
  playback.offer(episode(Trajectory::PERSONAL, 2, "old"));
  playback.offer(episode(Trajectory::META, 2, "new"));
  playback.forgetOtherRuns("new");
  EXPECT_EQ(nullptr, playback.personal());
  EXPECT_NE(nullptr, playback.meta());
}

TEST(StepAt, IsTheLastStepThatWasMade) {
  const auto five = episode(Trajectory::META, 5);
  EXPECT_EQ(0u, stepAt(*five, 0, 0.02));
  EXPECT_EQ(0u, stepAt(*five, 0.019, 0.02));
  EXPECT_EQ(3u, stepAt(*five, 3 * 0.02, 0.02));
  EXPECT_EQ(5u, stepAt(*five, 1, 0.02));
}

TEST(Cards, KeepApartInsideTheSceneWhateverTheirNumber) {
  for (const int tasks : {1, 2, 4, 5, 13, 50}) {
    for (const int lanes : {1, 2}) {
      const Cards cards = layoutCards(tasks, tasks - tasks / 4, lanes, 3, 2);
      const auto frames = cardFrames(cards);
      ASSERT_EQ(static_cast<std::size_t>(tasks), frames.size());
      EXPECT_GT(cards.scale, 0);
      for (std::size_t i = 0; i < frames.size(); ++i) {
        const auto& a = frames[i].transform.translation;
        EXPECT_EQ(taskFrame(static_cast<int>(i)), frames[i].child_frame_id);
        EXPECT_LE(std::abs(a.x) + cards.width() / 2, kSceneWidth / 2);
        EXPECT_LE(a.y + cards.height() / 2, kSceneHeight / 2 - kTitleHeight);
        EXPECT_GE(a.y - cards.height() / 2, -kSceneHeight / 2 + kLegendHeight);
        for (std::size_t j = 0; j < i; ++j) {
          const auto& b = frames[j].transform.translation;
          EXPECT_TRUE(std::abs(a.x - b.x) > cards.width() || std::abs(a.y - b.y) > cards.height());
        }
      }
    }
  }
}

TEST(Cards, LanesKeepApartOnTheirCard) {
  for (const auto& [width, height] : {std::pair(5.0, 1.0), std::pair(1.0, 1.0)}) {
    const Cards cards = layoutCards(4, 2, 2, width, height);
    const Point personal = cards.laneBottom(0, Trajectory::PERSONAL);
    const Point meta = cards.laneBottom(0, Trajectory::META);
    EXPECT_TRUE(std::abs(personal.x - meta.x) > cards.lane_width ||
                std::abs(personal.y - meta.y) > cards.lane_height);
    for (const Point& bottom : {personal, meta, cards.laneBottom(3, Trajectory::META)}) {
      EXPECT_LE(std::abs(bottom.x) + cards.lane_width / 2, cards.width() / 2);
      EXPECT_GE(bottom.y, -cards.height() / 2);
      EXPECT_LE(bottom.y + cards.lane_height, cards.height() / 2);
    }
    EXPECT_LE(cards.scale * width, cards.lane_width + 1e-12);
    EXPECT_LE(cards.scale * height, cards.lane_height + 1e-12);
  }
}

TEST(Cards, SayReturnsAndTheRoundWhereItIsNotTheTitles) {
  const pmeta::Experiment cheetahs =
      experiment("environment: {name: half_cheetah_vel, velocities: [1.2345678, 2]}\nlearner: sac");
  const Cards cards = layoutCards(2, 2, 2, 3, 2);
  SceneContent content = contentOf(2);
  pmeta_msgs::TaskReturn result;
  result.round = 7;
  result.return_mean = -0.001;
  content.tasks[1].meta.result = boost::make_shared<pmeta_msgs::TaskReturn>(result);
  const auto draw = [&] {
    MarkerArray scene;
    drawCards(cards, cheetahs.family(), content, scene);
    return scene;
  };
  EXPECT_EQ("meta: round 7, return 0.00", find(draw(), "results", 3).text);
  EXPECT_EQ("personal: no round yet", find(draw(), "results", 2).text);
  pmeta_msgs::RoundSummary summary;
  summary.round = 7;
  content.summary = boost::make_shared<pmeta_msgs::RoundSummary>(summary);
  EXPECT_EQ("meta return 0.00", find(draw(), "results", 3).text);
  pmeta_msgs::Trajectory explored;
  explored.task_weights = {0.034, 0.966};
  content.tasks[1].meta.episode = boost::make_shared<pmeta_msgs::Trajectory>(explored);
  EXPECT_EQ("meta return 0.00, takes it for task 1 (97 %)", find(draw(), "results", 3).text);
  explored.task_weights = {1};  // of another set of tasks
  content.tasks[1].meta.episode = boost::make_shared<pmeta_msgs::Trajectory>(explored);
  EXPECT_EQ("meta return 0.00", find(draw(), "results", 3).text);
  content.tasks[1].meta.episode.reset();
  content.has_personal = content.has_meta = false;
  EXPECT_EQ("personal: no personal policy here", find(draw(), "results", 2).text);
  content.tasks[1].meta.result.reset();
  EXPECT_EQ("meta: no meta-policy here", find(draw(), "results", 3).text);
  EXPECT_EQ("half_cheetah_vel_0", find(draw(), "names", 0).text);
  EXPECT_EQ("run at 1.235 m/s", find(draw(), "descriptions", 0).text);
  EXPECT_EQ("run at 2 m/s", find(draw(), "descriptions", 1).text);
}

TEST(Cards, LeaveOutWhatStandsBeforeAColonWhereADescriptionIsTooLong) {
  const pmeta::Experiment walkers =
      experiment("environment: {name: walker_2d_params, task_seeds: [1234567]}\nlearner: sac");
  const std::string whole = walkers.family().taskDescription(0);
  const auto description = [&](int tasks) {
    MarkerArray scene;
    Cards cards = layoutCards(tasks, tasks, 2, 3, 2);
    cards.num_tasks = 1;
    drawCards(cards, walkers.family(), contentOf(tasks), scene);
    return find(scene, "descriptions", 0).text;
  };
  ASSERT_NE(std::string::npos, whole.find("1234567: ")) << whole;
  EXPECT_EQ(whole, description(1));
  EXPECT_EQ(whole.substr(whole.find(": ") + 2), description(40));
}

TEST(Cards, TestTasksHaveOnlyTheMetaPolicy) {
  const Cards cards = layoutCards(3, 2, 2, 1, 1);
  EXPECT_EQ(2u, policiesOf(cards, 1).size());
  EXPECT_EQ(std::vector<int>{Trajectory::META}, policiesOf(cards, 2));
}

}  // namespace
}  // namespace pmeta_nodes
