#include "pmeta_core/run/round_driver.h"

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

constexpr std::chrono::seconds kRetryDisk{2};

}  // namespace

RoundDriver::RoundDriver(const Experiment& experiment, const RoundTimes& times, RoundOutlet& outlet,
                         Time now)
    : experiment_(experiment),
      times_(times),
      rounds_(experiment.settings().rounds),
      outlet_(outlet),
      aggregator_(experiment),
      book_(experiment),
      roll_call_(experiment.totalTasks(), RollCall::Seconds(times.silence),
                 RollCall::Seconds(times.start_up), now),
      round_start_(now) {}

MetaAggregator::Answer RoundDriver::offer(std::shared_ptr<const AuxiliaryUpdate> update) {
  return aggregator_.offer(std::move(update));
}

void RoundDriver::giveUp(int task, const std::string& reason) {
  if (aggregator_.giveUp(task, reason)) outlet_.log(Level::kError, reason);
}

RoundDriver::Answer RoundDriver::askForEvaluation() {
  if (last_is_out_ || over_) {
    return {false, "the last meta-policy is out, and is evaluated in any case"};
  }
  evaluation_wanted_ = true;
  return {true, "the next meta-policy is evaluated, and so are the personal policies"};
}

RoundDriver::Answer RoundDriver::askForCheckpoint() {
  if (over_) return {false, "the rounds are over: there is nothing to save"};
  checkpoint_wanted_ = true;
  return {true, "all save a checkpoint when the round after this one is done"};
}

void RoundDriver::step(Time now) {
  const std::string hopeless = aggregator_.hopeless();
  if (!hopeless.empty()) throw Error(hopeless);
  collect(false, now);
  writeDown(now);
  tellPause(now);
  closeIfDue(now);
  tellSilence(now);
  tellLateness(now);
}

bool RoundDriver::end(Time now) {
  endRequests();
  collect(true, now);
  next_attempt_ = now;
  writeDown(now);
  return done();
}

bool RoundDriver::isLate(Time now) const {
  return secondsInRound(now) > times_.round_timeout &&
         aggregator_.quorum() < aggregator_.expected();
}

double RoundDriver::secondsInRound(Time now) const {
  return std::chrono::duration<double>(now - round_start_).count();
}

void RoundDriver::closeIfDue(Time now) {
  if (round() == rounds_) {
    // only returns of the last meta-policy are still out
    if (isLate(now)) collect(true, now);
    return;
  }
  // what is done comes first to the disk
  if (unpublished_ || !unwritten_.empty()) return;
  if (secondsInRound(now) < times_.pace) return;
  const bool complete =
      aggregator_.complete() && book_.roundsTaken() == round() && book_.hasPersonal(round() + 1);
  if (!complete && !(isLate(now) && aggregator_.hasQuorum())) return;
  if (paused_) {
    if (!held_since_) held_since_ = now;
    return;
  }
  close(held_since_.value_or(now), now);
}

void RoundDriver::close(Time due, Time now) {
  const double seconds = secondsInRound(due);
  collect(true, now);
  const std::vector<int> missing = aggregator_.closeRound();
  const std::string name = "round " + std::to_string(round());
  if (!missing.empty()) {
    outlet_.log(Level::kWarning, name + " was closed by quorum without " + namesOf(missing) + ".");
  }
  for (const auto& [task, reason] : aggregator_.exclusions()) {
    outlet_.log(Level::kWarning,
                name + " leaves out the update of " + namesOf({task}) + ": " + reason + ".");
  }
  book_.closeRound(round(), aggregator_.metaPolicy().participants, missing, seconds,
                   aggregator_.excluded());
  unpublished_ = true;
  writeDown(now);
}

void RoundDriver::collect(bool force, Time now) {
  for (RoundBook::Round& round : book_.take(force)) {
    const std::vector<int>& excluded = round.summary.excluded;
    outlet_.showRound(round);
    say("round " + std::to_string(round.summary.round) + " is complete" +
            (excluded.empty() ? "" : "; the updates left out are those of " + namesOf(excluded)),
        now);
    unwritten_.push_back(std::move(round));
  }
}

// what the disk refuses is kept and tried again: nothing goes on without it
void RoundDriver::writeDown(Time now) {
  if (unwritten_.empty() && !unpublished_) return;
  if (!disk_trouble_.empty() && now < next_attempt_) return;
  try {
    for (; !unwritten_.empty(); unwritten_.pop_front()) outlet_.write(unwritten_.front());
    if (unpublished_) {
      if (experiment_.checkpointsAfter(round()) || round() == checkpoint_round_) {
        outlet_.saveCheckpoint(round());
      }
      unpublished_ = false;
      publish(now);
    }
    if (!disk_trouble_.empty()) {
      disk_trouble_.clear();
      outlet_.log(Level::kInfo, "the results can be written again; the run goes on.");
      say("running", now);
    }
  } catch (const Error& error) {
    next_attempt_ = now + kRetryDisk;
    if (disk_trouble_ == error.what()) return;
    disk_trouble_ = error.what();
    outlet_.log(Level::kError,
                disk_trouble_ + " The run is held until that is mended; it is tried again every " +
                    std::to_string(kRetryDisk.count()) + " s.");
    say("", now);
  }
}

void RoundDriver::publish(Time now) {
  // the initial one is never evaluated
  const bool evaluate = round() > 0 && evaluation_wanted_.exchange(false);
  const bool checkpoint = checkpoint_wanted_.exchange(false);
  if (checkpoint) checkpoint_round_ = round() + 1;
  last_is_out_ = round() == rounds_;
  aggregator_.ask(evaluate, checkpoint);
  round_start_ = now;
  held_since_.reset();
  next_late_word_ = times_.round_timeout;
  outlet_.publish(aggregator_.metaPolicy());
}

void RoundDriver::saveState(StateWriter& writer) const {
  writer.part("aggregator", aggregator_);
  writer.part("book", book_);
}

void RoundDriver::loadState(StateReader& reader) {
  reader.part("aggregator", aggregator_);
  reader.part("book", book_);
}

}  // namespace pmeta
