#pragma once

#include <atomic>
#include <stdexcept>

namespace pmeta {

/// What a program does before anything else. /dev/null is opened as whichever of the standard
/// descriptors is closed: the next file opened would get its number, and what is printed would go
/// there. A closed pipe and a limit on file sizes become errors of the write, as a full disk is,
/// instead of an end without a word. Where the stack is too small, the process ends with a
/// sentence.
void prepareProcess();

/// From now on the first SIGINT, SIGTERM or SIGHUP sets stopSignalled() and writes `told` to
/// standard error; a second ends the process at once. A SIGHUP that is ignored, as under nohup,
/// stays so. `told` must live as long as the process.
void heedStopSignals(const char* told = "");

/// Has such a signal come?
const std::atomic<bool>& stopSignalled();

/// What was under way is given up, since the process has been asked to stop: nothing to tell of.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("the process has been asked to stop") {}
};

/// Flushes standard output, of C and of C++. False if anything printed there is lost, but for a
/// reader that has gone, as `head` does: it has seen enough.
bool standardOutputIsWhole();

}  // namespace pmeta
