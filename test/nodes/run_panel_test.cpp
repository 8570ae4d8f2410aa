#include <gtest/gtest.h>
#include <pmeta_msgs/AgentStatus.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <ros/ros.h>
#include <rviz/panel.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <pluginlib/class_loader.hpp>

#include <QApplication>
#include <QElapsedTimer>
#include <QLabel>
#include <QProgressBar>
#include <QPushButton>
#include <QScreen>
#include <QShowEvent>
#include <QTableWidget>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "panel/run_state.h"

namespace pmeta_nodes {
namespace {

using pmeta_msgs::AgentStatus;
using pmeta_msgs::RoundSummary;
using pmeta_msgs::TaskReturn;
using Clock = std::chrono::steady_clock;

RoundSummary summaryOf(std::uint32_t round, std::uint8_t state, const std::string& message = "") {
  RoundSummary summary;
  summary.run_id = "run";
  summary.experiment = "grids";
  summary.state = state;
  summary.message = message;
  summary.round = round;
  summary.rounds = 40;
  summary.personal_return = -3.25;
  summary.meta_return = -4.5;
  summary.test_return = std::nan("");
  summary.eta_s = 65;
  return summary;
}

TaskReturn returnOf(std::uint32_t task, std::uint8_t policy, std::uint32_t round, double mean) {
  TaskReturn result;
  result.run_id = "run";
  result.task = task;
  result.task_name = "grid_" + std::to_string(task);
  result.policy = policy;
  result.split = TaskReturn::TRAIN;
  result.round = round;
  result.return_mean = mean;
  return result;
}

AgentStatus statusOf(std::uint32_t task, std::uint8_t state) {
  AgentStatus status;
  status.run_id = "run";
  status.task = task;
  status.task_name = "grid_" + std::to_string(task);
  status.state = state;
  status.update = 30;
  status.updates_per_round = 120;
  status.updates_per_s = 12345;
  return status;
}

TEST(RunState, KeepsTheNewestReturnAndTheOneAfterMostExploration) {
  RunState state;
  state.take(returnOf(0, TaskReturn::META, 3, -5));
  TaskReturn adapted = returnOf(0, TaskReturn::META, 3, -2);
  adapted.context_episodes = 15;
  state.take(adapted);
  TaskReturn less = adapted;
  less.context_episodes = 5;
  less.return_mean = -3;
  state.take(less);
  EXPECT_EQ(state.shown(state.tasks[0].meta).mean, -2);
  state.take(returnOf(0, TaskReturn::META, 2, -9));
  EXPECT_EQ(state.shown(state.tasks[0].meta).mean, -2) << "an older round says nothing new";
  state.take(returnOf(0, TaskReturn::META, 4, -7));
  EXPECT_EQ(state.shown(state.tasks[0].meta).mean, -7);
  EXPECT_TRUE(std::isnan(state.shown(state.tasks[0].personal).mean));
}

TEST(RunState, ShowsReturnsAsOfTheLastCompleteRoundInWhateverOrderTheyCome) {
  RunState state;
  EXPECT_EQ(state.tableText(), "task");
  state.take(returnOf(0, TaskReturn::PERSONAL, 4, -4));
  state.take(returnOf(0, TaskReturn::PERSONAL, 3, -3));
  state.take(summaryOf(3, RoundSummary::PAUSED));
  state.take(returnOf(0, TaskReturn::META, 3, -5));
  EXPECT_EQ(state.shown(state.tasks[0].personal).mean, -3) << "round 4 is not complete";
  EXPECT_EQ(state.tableText(), "task, round 3");
  state.take(summaryOf(4, RoundSummary::RUNNING));
  EXPECT_EQ(state.shown(state.tasks[0].personal).mean, -4);
  EXPECT_EQ(state.shown(state.tasks[0].meta).mean, -5);
  EXPECT_EQ(state.tableText(), "task, rounds 3 to 4");
}

TEST(RunState, AnotherRunBeginsAnew) {
  RunState state;
  state.connected = true;
  state.take(summaryOf(3, RoundSummary::RUNNING));
  state.take(returnOf(0, TaskReturn::PERSONAL, 3, -5));
  TaskReturn foreign = returnOf(1, TaskReturn::PERSONAL, 3, -5);
  foreign.run_id = "other";
  state.take(foreign);
  EXPECT_EQ(state.tasks.count(1), 0u);
  RoundSummary next = summaryOf(0, RoundSummary::RUNNING);
  next.run_id = "other";
  state.take(next);
  EXPECT_TRUE(state.tasks.empty());
  state.take(foreign);
  EXPECT_EQ(state.tasks.count(1), 1u);
}

TEST(RunState, SaysPlainlyWhatIsNotThere) {
  RunState state;
  EXPECT_EQ(state.stateText(), "no run");
  EXPECT_EQ(state.messageText(), "no run on /pmeta: start one with ./pmeta run");
  EXPECT_EQ(state.etaText(), "-");
  state.take(summaryOf(3, RoundSummary::LATE));
  state.summary->missing = {1, 4};
  state.take(statusOf(1, AgentStatus::TRAINING), Clock::now());
  EXPECT_EQ(state.missingText(), "missing: 1 grid_1, 4");
  EXPECT_EQ(state.stateText(), "lost") << "nobody publishes";
  EXPECT_FALSE(state.active());
  state.connected = true;
  EXPECT_EQ(state.stateText(), "late");
  state.take(summaryOf(40, RoundSummary::FINISHED));
  EXPECT_EQ(state.stateText(), "finished");
  EXPECT_FALSE(state.active());
}

TEST(RunState, AnAgentThatFallsSilentIsNoticed) {
  RunState state;
  state.connected = true;
  state.take(summaryOf(3, RoundSummary::RUNNING));
  const Clock::time_point then = Clock::now();
  state.take(statusOf(0, AgentStatus::TRAINING), then);
  EXPECT_EQ(state.agentText(state.tasks[0], then + std::chrono::seconds(4)), "training 25 %");
  EXPECT_EQ(state.agentText(state.tasks[0], then + std::chrono::seconds(12)), "silent for 12 s");
  state.take(summaryOf(40, RoundSummary::FINISHED));
  EXPECT_EQ(state.agentText(state.tasks[0], then + std::chrono::seconds(12)), "training 25 %");
}

/// The panel as rviz loads it, in Qt's event loop, with no window on a screen.
class RunPanelTest : public ::testing::Test {
 protected:
  RunPanelTest()
      : loader_("rviz", "rviz::Panel"),
        panel_(loader_.createUnmanagedInstance("pmeta_nodes/RunPanel")) {
    panel_->show();
    spinner_.start();
  }

  template <class Widget>
  Widget* get(const char* name) {
    Widget* widget = panel_->findChild<Widget*>(name);
    if (widget == nullptr) throw std::runtime_error(std::string("no widget ") + name);
    return widget;
  }
  std::string label(const char* name) { return get<QLabel>(name)->text().toStdString(); }
  QPushButton* button(const char* name) { return get<QPushButton>(name); }
  std::string cell(int row, int column) {
    const QTableWidgetItem* item = get<QTableWidget>("tasks")->item(row, column);
    return item == nullptr ? "" : item->text().toStdString();
  }

  /// Lets Qt work until `condition` holds; false after `seconds`.
  bool waitFor(const std::function<bool()>& condition, double seconds = 20) {
    QElapsedTimer timer;
    timer.start();
    while (!condition()) {
      if (timer.elapsed() > 1000 * seconds) return false;
      QApplication::processEvents();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }

  pluginlib::ClassLoader<rviz::Panel> loader_;
  std::unique_ptr<rviz::Panel> panel_;
  ros::NodeHandle nh_{"/pmeta"};
  ros::AsyncSpinner spinner_{2};
};

/// An aggregator that says what the test wants.
struct FakeAggregator {
  explicit FakeAggregator(ros::NodeHandle& nh)
      : round(nh.advertise<RoundSummary>("round", 8, true)),
        returns(nh.advertise<TaskReturn>("returns", 16, true)),
        status(nh.advertise<AgentStatus>("agent_status", 16, true)) {}

  ros::Publisher round;
  ros::Publisher returns;
  ros::Publisher status;
};

TEST_F(RunPanelTest, TakesNothingThatItIsToldForMarkup) {
  for (const QLabel* label : panel_->findChildren<QLabel*>()) {
    EXPECT_EQ(label->textFormat(), Qt::PlainText) << label->objectName().toStdString();
  }
}

TEST_F(RunPanelTest, KeepsAWindowWithinTheScreen) {
  QWidget window;
  window.resize(8000, 6000);
  window.show();
  QShowEvent shown;
  panel_->eventFilter(&window, &shown);
  const QSize screen = QGuiApplication::primaryScreen()->availableSize();
  EXPECT_LE(window.width(), screen.width());
  EXPECT_LE(window.height(), screen.height());
}

TEST_F(RunPanelTest, SaysThatThereIsNoRun) {
  EXPECT_EQ(label("state"), "no run");
  EXPECT_EQ(label("message"), "no run on /pmeta: start one with ./pmeta run");
  EXPECT_FALSE(get<QTableWidget>("tasks")->isVisible());
  for (const char* name : {"pause", "evaluate", "checkpoint"}) {
    EXPECT_FALSE(button(name)->isEnabled()) << name;
    EXPECT_EQ(button(name)->toolTip().toStdString(), "no run goes on");
  }
}

TEST_F(RunPanelTest, ShowsARunWithDotsInItsNumbers) {
  char comma[32];
  std::snprintf(comma, sizeof comma, "%.1f", 0.5);
  if (std::getenv("PMETA_TEST_COMMA") != nullptr) {
    ASSERT_STREQ(comma, "0,5") << "Qt has not taken the locale from the environment";
  }
  FakeAggregator run(nh_);
  RoundSummary summary = summaryOf(12, RoundSummary::LATE, "round 13 has waited");
  summary.missing = {1};
  summary.test_return = -1.5;
  run.round.publish(summary);
  ASSERT_TRUE(waitFor([&] { return label("state") == "late"; }));
  ASSERT_TRUE(waitFor(
      [&] { return run.returns.getNumSubscribers() == 1 && run.status.getNumSubscribers() == 1; }));
  for (std::uint32_t task = 0; task < 5; ++task) {
    run.returns.publish(returnOf(task, TaskReturn::PERSONAL, 12, -1.25 - task));
    run.returns.publish(returnOf(task, TaskReturn::META, 12, -2.75 - task));
    run.status.publish(statusOf(task, task == 1 ? AgentStatus::TRAINING : AgentStatus::WAITING));
  }
  ASSERT_TRUE(waitFor([&] { return cell(4, 3) == "waiting" && cell(4, 2) == "-6.75"; }));
  EXPECT_EQ(label("experiment"), "grids");
  EXPECT_EQ(label("message"), "round 13 has waited");
  EXPECT_EQ(label("missing"), "missing: 1 grid_1");
  EXPECT_EQ(label("pp"), "PP -3.25");
  EXPECT_EQ(label("mp"), "MP -4.50");
  EXPECT_EQ(label("test"), "test -1.50");
  EXPECT_EQ(label("eta"), "ETA 0:01:05");
  EXPECT_EQ(get<QProgressBar>("progress")->value(), 12);
  EXPECT_EQ(get<QProgressBar>("progress")->text().toStdString(), "round 12 of 40");
  ASSERT_EQ(get<QTableWidget>("tasks")->rowCount(), 5);
  const std::vector<std::string> row = {"grid_1", "-2.25", "-3.75", "training 25 %", "12.3k"};
  for (int column = 0; column < 5; ++column) EXPECT_EQ(cell(1, column), row[column]);
  EXPECT_TRUE(get<QTableWidget>("tasks")->isVisible());

  summary = summaryOf(40, RoundSummary::FINISHED, "all rounds are done");
  run.round.publish(summary);
  ASSERT_TRUE(waitFor([&] { return label("state") == "finished"; }));
  EXPECT_FALSE(get<QLabel>("missing")->isVisible());
  EXPECT_FALSE(get<QLabel>("test")->isVisible());
  EXPECT_EQ(label("eta"), "ETA -");
}

TEST_F(RunPanelTest, ButtonsCallTheServicesThatAreThere) {
  FakeAggregator run(nh_);
  std::atomic<int> pauses{0};
  const boost::function<bool(std_srvs::SetBool::Request&, std_srvs::SetBool::Response&)> on_pause =
      [&](std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
        ++pauses;
        run.round.publish(request.data ? summaryOf(3, RoundSummary::PAUSED, "paused: waits")
                                       : summaryOf(3, RoundSummary::RUNNING, "running"));
        response.success = 1;
        return true;
      };
  const ros::ServiceServer pause = nh_.advertiseService("pause", on_pause);
  run.round.publish(summaryOf(3, RoundSummary::RUNNING, "running"));
  ASSERT_TRUE(waitFor([&] { return button("pause")->isEnabled(); }));
  EXPECT_EQ(button("pause")->text().toStdString(), "Pause");
  EXPECT_FALSE(button("evaluate")->isEnabled());
  EXPECT_EQ(button("evaluate")->toolTip().toStdString(),
            "the run does not offer the service /pmeta/evaluate");
  EXPECT_FALSE(button("checkpoint")->isEnabled());

  button("pause")->click();
  EXPECT_FALSE(button("pause")->isEnabled()) << "one request at a time";
  ASSERT_TRUE(waitFor([&] { return label("state") == "paused" && button("pause")->isEnabled(); }));
  EXPECT_EQ(pauses, 1);
  EXPECT_EQ(button("pause")->text().toStdString(), "Resume");
  button("pause")->click();
  ASSERT_TRUE(waitFor([&] { return label("state") == "running" && button("pause")->isEnabled(); }));
  EXPECT_EQ(pauses, 2);
  EXPECT_EQ(label("answer"), "");

  const boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)> on_save =
      [&](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
        response.message = "the disk is full";
        return true;
      };
  const ros::ServiceServer save = nh_.advertiseService("save_checkpoint", on_save);
  ASSERT_TRUE(waitFor([&] { return button("checkpoint")->isEnabled(); }));
  button("checkpoint")->click();
  EXPECT_TRUE(waitFor([&] { return label("answer") == "the disk is full"; }));

  std::atomic<int> evaluations{0};
  const boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>
      on_evaluate = [&](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
        ++evaluations;
        response.success = 1;
        response.message = "the next meta-policy is evaluated";
        return true;
      };
  const ros::ServiceServer evaluate = nh_.advertiseService("evaluate", on_evaluate);
  ASSERT_TRUE(waitFor([&] { return button("evaluate")->isEnabled(); }));
  button("evaluate")->click();
  EXPECT_TRUE(waitFor([&] { return label("answer") == "the next meta-policy is evaluated"; }));
  EXPECT_EQ(evaluations, 1);
}

TEST_F(RunPanelTest, AServiceThatHangsHoldsUpNothing) {
  FakeAggregator run(nh_);
  std::atomic<bool> leave{false};
  std::atomic<bool> called{false};
  const boost::function<bool(std_srvs::SetBool::Request&, std_srvs::SetBool::Response&)> on_pause =
      [&](std_srvs::SetBool::Request&, std_srvs::SetBool::Response&) {
        called = true;
        while (!leave) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return true;
      };
  const ros::ServiceServer pause = nh_.advertiseService("pause", on_pause);
  run.round.publish(summaryOf(3, RoundSummary::RUNNING, "running"));
  ASSERT_TRUE(waitFor([&] { return button("pause")->isEnabled(); }));
  button("pause")->click();
  ASSERT_TRUE(waitFor([&] { return called.load(); }));
  run.round.publish(summaryOf(4, RoundSummary::RUNNING, "round 4"));
  EXPECT_TRUE(waitFor([&] { return label("message") == "round 4"; })) << "Qt waits for the service";
  EXPECT_FALSE(button("pause")->isEnabled());
  EXPECT_TRUE(waitFor([&] { return !label("answer").empty(); }));
  EXPECT_EQ(label("answer"), "no answer from /pmeta/pause within 5 s");
  leave = true;
  panel_.reset();
}

}  // namespace
}  // namespace pmeta_nodes

/// Makes a locale that writes decimal commas in `folder`, for Qt to take from the environment.
void useDecimalCommas(const std::string& folder) {
  const std::string compile =
      "localedef -i de_DE -f UTF-8 " + folder + "/de_DE.UTF-8 > /dev/null 2>&1";
  if (std::system(compile.c_str()) != 0) return;
  setenv("LOCPATH", folder.c_str(), 1);
  setenv("LC_ALL", "de_DE.UTF-8", 1);
  setenv("PMETA_TEST_COMMA", "1", 1);
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  char folder[] = "/tmp/pmeta_locale_XXXXXX";
  if (mkdtemp(folder) == nullptr) return 1;
  useDecimalCommas(folder);
  QApplication application(argc, argv);
  std::filesystem::remove_all(folder);
  ros::init(argc, argv, "run_panel_test");
  const ros::NodeHandle keep_ros_running;
  return RUN_ALL_TESTS();
}
