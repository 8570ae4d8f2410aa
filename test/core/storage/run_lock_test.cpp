#include "pmeta_core/storage/run_lock.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "../support.h"
#include "pmeta_core/storage/run_log.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::TempDir;
using test::writeFile;

std::string me() { return "process " + std::to_string(::getpid()) + " on host " + hostName(); }

/// A process that takes a folder and waits to be killed, without a word to anybody.
class Other {
 public:
  explicit Other(const std::string& dir) {
    int ready[2];
    EXPECT_EQ(::pipe(ready), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      const RunLock lock(dir);
      if (::write(ready[1], "x", 1) == 1) ::pause();
      ::_exit(1);
    }
    ::close(ready[1]);
    char byte = 0;
    EXPECT_EQ(::read(ready[0], &byte, 1), 1);
    ::close(ready[0]);
  }
  ~Other() { kill(); }

  void kill() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    pid_ = 0;
  }
  std::string text() const { return "process " + std::to_string(pid_) + " on host " + hostName(); }

 private:
  pid_t pid_ = 0;
};

TEST(RunLock, TheSecondOfAProcessIsRefusedToo) {
  const TempDir dir;
  EXPECT_EQ(RunLock::holder(dir.path()), "");
  {
    RunLock first(dir.path());
    const RunLock lock(std::move(first));
    EXPECT_EQ(RunLock::holder(dir.path()), me());
    EXPECT_EQ(errorOf([&] { RunLock second(dir.path()); }),
              "the run folder " + dir.path() + " is being written by " + me() +
                  ": wait until that has ended, or stop it.");
    EXPECT_EQ(RunLock::holder(dir.path()), me());
  }
  EXPECT_EQ(RunLock::holder(dir.path()), "");
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(RunLock, AnotherProcessHasTheFolderUntilItDies) {
  const TempDir dir;
  Other other(dir.path());
  EXPECT_EQ(RunLock::holder(dir.path()), other.text());
  EXPECT_NE(errorOf([&] { RunLock lock(dir.path()); }).find(other.text()), std::string::npos);
  other.kill();
  EXPECT_EQ(RunLock::holder(dir.path()), "");
  const RunLock lock(dir.path());
  EXPECT_EQ(RunLock::holder(dir.path()), me());
}

TEST(RunLock, AFolderThatIsNotThereIsRefused) {
  const TempDir dir;
  EXPECT_EQ(errorOf([&] { RunLock lock(dir / "none"); }),
            "the run folder " + (dir / "none") +
                " cannot be locked (No such file or directory): choose another with "
                "results_dir:=DIR.");
}

// what a process leaves where the file system cannot lock
TEST(RunLock, AFileThatNamesALivingProcessCountsWithoutLocks) {
  const TempDir dir;
  const auto names = [&](const std::string& text) {
    writeFile(dir / "lock.process", text);
    return RunLock::holder(dir.path());
  };
  const std::string host = hostName();
  EXPECT_EQ(names("{\"pid\": " + std::to_string(::getpid()) + ", \"host\": \"" + host + "\"}"),
            me());
  // the number came again
  EXPECT_EQ(names("{\"pid\": " + std::to_string(::getpid()) + ", \"start\": 1, \"host\": \"" +
                  host + "\"}"),
            "");
  EXPECT_EQ(names("{\"pid\": 7, \"host\": \"elsewhere\"}"), "process 7 on host elsewhere");
  EXPECT_EQ(names("{\"pid\": \"x\"}"), "another process");
}

TEST(RunLog, AFolderThatIsBeingWrittenIsNeitherWrittenNorResumed) {
  const TempDir dir;
  const Experiment experiment =
      gridExperiment({"results_dir:=" + dir.path(), "run_id:=a", "rounds:=5"});
  const std::string folder = experiment.runDir();
  {
    const RunLog log(experiment);
    EXPECT_EQ(runStatus(folder), "running");
    EXPECT_NE(errorOf([&] { RunLog second(experiment); }).find(me()), std::string::npos);
    EXPECT_NE(errorOf([&] { RunLog::reopen(experiment, 0); }).find(me()), std::string::npos);
  }
  // as if its process had died
  EXPECT_EQ(runStatus(folder), "interrupted");
  const RunLog log = RunLog::reopen(experiment, 0);
  EXPECT_EQ(runStatus(folder), "running");
}

}  // namespace
}  // namespace pmeta
