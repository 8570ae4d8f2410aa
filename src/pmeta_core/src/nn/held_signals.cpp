#include "pmeta_core/nn/held_signals.h"

#include <pthread.h>

#include <initializer_list>

namespace pmeta {
namespace {

thread_local int t_held = 0;

const sigset_t& asynchronous() {
  static const sigset_t kSignals = [] {
    sigset_t set;
    sigfillset(&set);
    for (const int raised : {SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSEGV, SIGSYS, SIGTRAP}) {
      sigdelset(&set, raised);
    }
    return set;
  }();
  return kSignals;
}

}  // namespace

HeldSignals::HeldSignals() {
  if (t_held++ == 0) pthread_sigmask(SIG_BLOCK, &asynchronous(), &before_);
}

HeldSignals::~HeldSignals() {
  if (--t_held == 0) pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

}  // namespace pmeta
