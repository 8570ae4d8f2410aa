#include <dlfcn.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>

#include <cstdint>
#include <vector>

#include "pmeta_core/nn/gemm.h"
#include "pmeta_core/nn/held_signals.h"

namespace {

bool g_called = false;
sigset_t g_during;

}  // namespace

// stands before oneDNN's own: sees what it is called with, and calls it
extern "C" int dnnl_sgemm(char transpose_a, char transpose_b, std::int64_t m, std::int64_t n,
                          std::int64_t k, float alpha, const float* a, std::int64_t lda,
                          const float* b, std::int64_t ldb, float beta, float* c,
                          std::int64_t ldc) {
  static const auto own = reinterpret_cast<decltype(&dnnl_sgemm)>(dlsym(RTLD_NEXT, "dnnl_sgemm"));
  g_called = true;
  pthread_sigmask(SIG_SETMASK, nullptr, &g_during);
  return own(transpose_a, transpose_b, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc);
}

namespace pmeta {
namespace {

TEST(Gemm, NoSignalFromOutsideArrivesWithinOneDnn) {
  if (gemmName().rfind("oneDNN", 0) != 0) GTEST_SKIP() << "built without oneDNN";
  sigset_t own, before, after;
  sigemptyset(&own);
  sigaddset(&own, SIGUSR2);  // what the caller has blocked stays so
  ASSERT_EQ(0, pthread_sigmask(SIG_BLOCK, &own, &before));
  const std::vector<float> a(64, 1.0f), b(64, 2.0f);
  std::vector<float> c(64);
  g_called = false;
  gemm(Transpose::kNo, Transpose::kNo, 8, 8, 8, 1, a.data(), 8, b.data(), 8, 0, c.data(), 8);
  ASSERT_EQ(0, pthread_sigmask(SIG_SETMASK, &before, &after));
  EXPECT_EQ(c, std::vector<float>(64, 16.0f));
  ASSERT_TRUE(g_called);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2,
                           SIGCHLD, SIGWINCH, SIGTSTP, SIGRTMIN, SIGRTMAX}) {
    EXPECT_EQ(1, sigismember(&g_during, signal)) << signal;
    EXPECT_EQ(signal == SIGUSR2 ? 1 : 0, sigismember(&after, signal)) << signal;
  }
  // a thread that raises one of these cannot go on without its handler
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT}) {
    EXPECT_EQ(0, sigismember(&g_during, signal)) << signal;
  }
}

bool isHeld(int signal) {
  sigset_t now;
  pthread_sigmask(SIG_SETMASK, nullptr, &now);
  return sigismember(&now, signal) == 1;
}

TEST(HeldSignals, WaitForTheEndOfTheOutermostScope) {
  ASSERT_FALSE(isHeld(SIGUSR1));
  {
    const HeldSignals update;
    {
      const HeldSignals product;
      EXPECT_TRUE(isHeld(SIGUSR1));
    }
    EXPECT_TRUE(isHeld(SIGUSR1));
    EXPECT_FALSE(isHeld(SIGSEGV));
  }
  EXPECT_FALSE(isHeld(SIGUSR1));
}

}  // namespace
}  // namespace pmeta
