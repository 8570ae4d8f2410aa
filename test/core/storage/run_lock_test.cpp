#include "pmeta_core/storage/run_lock.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <filesystem>

#include "../support.h"
#include "pmeta_core/storage/run_log.h"

namespace {

bool g_can_lock = true;

}  // namespace

// stands before the system's own: a file system that cannot lock, e.g. NFS without its daemon
extern "C" int fcntl(int fd, int command, ...) {
  static const auto own = reinterpret_cast<decltype(&fcntl)>(dlsym(RTLD_NEXT, "fcntl"));
  va_list arguments;
  va_start(arguments, command);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  if (!g_can_lock && (command == F_OFD_SETLK || command == F_OFD_GETLK)) {
    errno = ENOLCK;
    return -1;
  }
  return own(fd, command, argument);
}

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::readFile;
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

class WithoutLocks : public ::testing::Test {
 protected:
  WithoutLocks() { g_can_lock = false; }
  ~WithoutLocks() override { g_can_lock = true; }

  // what a process leaves behind that is killed while it has the folder
  std::string leftBehind() {
    Other other(dir_.path());
    other.kill();
    return readFile(dir_ / "lock.process");
  }

  TempDir dir_;
};

TEST_F(WithoutLocks, TheFileHoldsTheFolderUntilItsProcessHasDied) {
  {
    const RunLock lock(dir_.path());
    EXPECT_EQ(lock.path(), dir_ / "lock.process");
    EXPECT_EQ(RunLock::holder(dir_.path()), me());
    EXPECT_EQ(errorOf([&] { RunLock second(dir_.path()); }),
              "the run folder " + dir_.path() + " is being written by " + me() +
                  ", and its file system cannot lock files: if that process is gone, remove " +
                  (dir_ / "lock.process") + ".");
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir_.path()));
  {
    Other other(dir_.path());
    EXPECT_EQ(RunLock::holder(dir_.path()), other.text());
    EXPECT_NE(errorOf([&] { RunLock lock(dir_.path()); }).find(other.text()), std::string::npos);
  }
  EXPECT_NE(readFile(dir_ / "lock.process"), "") << "nobody removed it";
  EXPECT_EQ(RunLock::holder(dir_.path()), "");
  { const RunLock lock(dir_.path()); }
  EXPECT_TRUE(std::filesystem::is_empty(dir_.path()));
}

TEST_F(WithoutLocks, CountForWhomCanLockToo) {
  Other other(dir_.path());
  g_can_lock = true;
  EXPECT_NE(errorOf([&] { RunLock lock(dir_.path()); }).find(other.text()), std::string::npos);
  other.kill();
  { const RunLock lock(dir_.path()); }
}

// how many of `starters` processes that begin at one moment get the folder; all keep it until each
// has tried
int takers(const std::string& dir, int starters) {
  int begin[2], tried[2], end[2];
  EXPECT_EQ(0, ::pipe(begin) + ::pipe(tried) + ::pipe(end));
  for (int i = 0; i < starters; ++i) {
    if (::fork() != 0) continue;
    ::close(begin[1]);
    ::close(end[1]);
    char byte = 0;
    (void)!::read(begin[0], &byte, 1);  // until the parent closes it
    try {
      const RunLock lock(dir);
      (void)!::write(tried[1], "1", 1);
      (void)!::read(end[0], &byte, 1);
    } catch (const FolderInUse&) {
      (void)!::write(tried[1], "0", 1);
    }
    ::_exit(0);
  }
  ::close(begin[1]);
  int count = 0;
  for (int i = 0; i < starters; ++i) {
    char got = 0;
    EXPECT_EQ(1, ::read(tried[0], &got, 1));
    count += got == '1';
  }
  ::close(end[1]);
  while (::wait(nullptr) > 0) {
  }
  for (const int fd : {begin[0], tried[0], tried[1], end[0]}) ::close(fd);
  return count;
}

TEST(RunLock, OneOfManyThatStartAtOnceHasTheFolder) {
  const TempDir dir;
  for (int k = 0; k < 10; ++k) EXPECT_EQ(takers(dir.path(), 4), 1);
}

TEST_F(WithoutLocks, OneOfManyThatStartAtOnceHasTheFolder) {
  for (int k = 0; k < 10; ++k) EXPECT_EQ(takers(dir_.path(), 4), 1);
  const std::string left = leftBehind();
  for (int k = 0; k < 60; ++k) {
    writeFile(dir_ / "lock.process", left);
    EXPECT_EQ(takers(dir_.path(), 4), 1) << "beside what a dead process left";
  }
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
