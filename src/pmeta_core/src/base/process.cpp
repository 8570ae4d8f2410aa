#include "pmeta_core/base/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>

namespace pmeta {
namespace {

constexpr rlim_t kLeastStack = 1 << 20;

constexpr int kStopSignals[] = {SIGINT, SIGTERM, SIGHUP};

std::atomic<bool> g_stop{false};
const char* g_told = "";

void onSignal(int) {
  const int before = errno;
  g_stop = true;
  for (const int stop : kStopSignals) ::signal(stop, SIG_DFL);
  if (::write(STDERR_FILENO, g_told, std::strlen(g_told)) < 0) {
    // nobody to tell
  }
  errno = before;
}

}  // namespace

void prepareProcess() {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0) continue;
    // takes the lowest number that is free: this one
    if (::open("/dev/null", O_RDWR) != descriptor) std::abort();
  }
  rlimit stack{};
  if (::getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < kLeastStack) {
    std::fprintf(stderr,
                 "pmeta: the stack is limited to %llu kB but %llu kB are needed: ulimit -s 8192.\n",
                 static_cast<unsigned long long>(stack.rlim_cur >> 10),
                 static_cast<unsigned long long>(kLeastStack >> 10));
    std::exit(1);
  }
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGXFSZ, SIG_IGN);
}

void heedStopSignals(const char* told) {
  g_told = told;
  for (const int stop : kStopSignals) {
    struct sigaction action {};
    ::sigaction(stop, nullptr, &action);
    // a shell has its background jobs ignore SIGINT, which is no wish of theirs
    if (stop == SIGHUP && action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = onSignal;
    action.sa_flags = SA_RESTART;
    ::sigaction(stop, &action, nullptr);
  }
}

const std::atomic<bool>& stopSignalled() { return g_stop; }

bool standardOutputIsWhole() {
  std::cout.flush();
  const bool whole = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && !std::cout.fail();
  pollfd output = {STDOUT_FILENO, 0, 0};
  return whole || (::poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0);
}

}  // namespace pmeta
