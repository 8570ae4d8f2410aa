// What the driver of rounds tells people: what holds the run, who is missing, what happens next.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <utility>

#include "pmeta_core/base/format.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/run/round_driver.h"

namespace pmeta {
namespace {

using State = RunStanding::State;

constexpr double kLateAgain = 5;  // seconds between two words about one late round
constexpr char kHeld[] = " The run is held until that is mended.";
constexpr char kPaused[] =
    "paused: agents finish the round in hand, the next meta-policy waits until the service pause "
    "is called with false";

std::string timeOfDay(std::time_t time) {
  std::tm local{};
  localtime_r(&time, &local);
  char text[16];
  std::strftime(text, sizeof text, "%H:%M:%S", &local);
  return text;
}

}  // namespace

RoundDriver::Answer RoundDriver::pause(bool on) {
  if (over_) return {false, "the rounds are over: there is nothing to pause"};
  paused_ = on;
  return {true, on ? kPaused : "running"};
}

void RoundDriver::say(const std::string& message, Time now) {
  if (!disk_trouble_.empty()) {
    outlet_.tell({State::kBlocked, disk_trouble_ + kHeld, {}});
  } else if (pause_told_) {
    outlet_.tell({State::kPaused, kPaused + (message.empty() ? "" : "; " + message), {}});
  } else if (!silent_.empty()) {
    outlet_.tell({State::kLate, silenceText(now) + "; " + message, silent_});
  } else {
    outlet_.tell({State::kRunning, message, {}});
  }
}

void RoundDriver::tellPause(Time now) {
  // past the last aggregation only returns are out, and nothing is held back
  const bool paused = paused_ && round() < rounds_;
  if (paused == pause_told_) return;
  pause_told_ = paused;
  say(paused ? "" : "running", now);
  outlet_.log(Level::kInfo, paused ? kPaused : "the run goes on.");
}

void RoundDriver::tellSilence(Time now) {
  const std::vector<int> silent = roll_call_.silent(now);
  if (silent == silent_) return;
  const std::vector<int> before = std::exchange(silent_, silent);
  std::vector<int> back;
  std::set_difference(before.begin(), before.end(), silent.begin(), silent.end(),
                      std::back_inserter(back));
  if (!back.empty()) outlet_.log(Level::kInfo, namesOf(back) + ": heard of again.");
  if (!silent.empty()) {
    outlet_.log(Level::kWarning, silenceText(now) + "; " + waitText(now));
  }
  say(silent.empty() ? "running" : waitText(now), now);
}

void RoundDriver::tellLateness(Time now) {
  // who is paused waits for nobody
  if (pause_told_ || secondsInRound(now) < next_late_word_) return;
  next_late_word_ = secondsInRound(now) + kLateAgain;
  // an update may be in and only a return missing
  const std::vector<int> missing = aggregator_.complete() ? book_.awaited() : aggregator_.missing();
  if (missing.empty()) return;
  const std::string message = "round " + std::to_string(roundInHand()) + " has waited " +
                              std::to_string(std::lround(secondsInRound(now))) + " s for " +
                              namesOf(missing) + "; " + waitText(now);
  outlet_.tell({State::kLate, message, missing});
  outlet_.repeatMetaPolicy();
  outlet_.log(Level::kWarning, message);
}

// who is missing, since when
std::string RoundDriver::silenceText(Time now) const {
  std::vector<std::string> words;
  for (const int task : silent_) {
    const std::time_t since =
        std::time(nullptr) - static_cast<std::time_t>(std::lround(roll_call_.silence(task, now)));
    words.push_back(namesOf({task}) +
                    (roll_call_.known(task) ? " is silent since " : " has not shown up since ") +
                    timeOfDay(since));
  }
  return join(words);
}

// what happens next
std::string RoundDriver::waitText(Time now) const {
  const std::string round = "round " + std::to_string(roundInHand());
  const std::string all = std::to_string(aggregator_.expected()) + " tasks have reported";
  if (aggregator_.quorum() >= aggregator_.expected()) {
    return round + " waits until all " + all;
  }
  const double left = times_.round_timeout - secondsInRound(now);
  return round + " goes on without them " +
         (left > 0 ? "in " + std::to_string(std::lround(left)) + " s if " : "once ") +
         std::to_string(aggregator_.quorum()) + " of " + all;
}

std::string RoundDriver::namesOf(const std::vector<int>& tasks) const {
  std::vector<std::string> names;
  for (const int task : tasks) {
    const Machine* machine = machineOf(experiment_.settings().machines, task);
    names.push_back("task " + std::to_string(task) + " (" + experiment_.family().taskName(task) +
                    ")" + (machine == nullptr ? "" : " on " + machine->name));
  }
  return join(names);
}

}  // namespace pmeta
