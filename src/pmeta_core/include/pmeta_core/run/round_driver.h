#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "pmeta_core/run/roll_call.h"
#include "pmeta_core/storage/round_book.h"

namespace pmeta {

/// How long rounds take and are waited for, in seconds. By default nobody is ever late.
struct RoundTimes {
  /// For what is never due.
  static constexpr double kForEver = std::numeric_limits<double>::infinity();

  double pace = 0;                  ///< least time from one meta-policy to the next
  double round_timeout = kForEver;  ///< after which a round is late
  double silence = kForEver;        ///< after which an agent is missing
  double start_up = kForEver;       ///< the same before its first word
};

/// How a run stands, for people.
struct RunStanding {
  /// As RoundSummary.msg has them.
  enum class State { kRunning, kLate, kPaused, kBlocked, kFinished, kStopped };

  /// kBlocked where the disk takes nothing, kLate where agents are waited for.
  State state = State::kRunning;
  std::string message;       ///< the state in a sentence
  std::vector<int> missing;  ///< who is waited for or silent, where the message is about them
};

/// Those whom the driver of a run's rounds works for: agents, the disk, and people. Only people may
/// be without.
class RoundOutlet {
 public:
  /// How much a sentence of log() matters.
  enum class Level { kInfo, kWarning, kError };

  virtual ~RoundOutlet() = default;

  /// Agents are to go on from this meta-policy: the next round begins.
  virtual void publish(const MetaPolicy& meta) = 0;
  /// It is to go out once more: somebody may have missed it.
  virtual void repeatMetaPolicy() {}

  /// Both go to the disk, a round's record before the checkpoint of a later round. An Error holds
  /// the run, and the same is asked for again; what has failed must have left nothing behind.
  virtual void write(const RoundBook::Round& round) = 0;
  /// See write(): RoundDriver::saveState() after `round` closed rounds.
  virtual void saveCheckpoint(int round) = 0;

  virtual void showRound(const RoundBook::Round&) {}  ///< it is complete, and yet to be written
  /// How the run stands has changed, or is worth repeating.
  virtual void tell(const RunStanding&) {}
  virtual void log(Level, const std::string&) {}  ///< a sentence for the console
};

/// Drives the rounds of a run: takes what comes in, and says when a round is closed, the next one
/// begins, its record and a checkpoint are written, and what people are told. Knows no ROS, no
/// thread and no clock: `now` is whatever its owner says, and never goes back.
///
/// A round is closed once every participant's update is in, with its personal returns and all that
/// is due of the rounds before, so that whoever is killed and comes back can still send them; or,
/// after RoundTimes::round_timeout, once a quorum of fewer than all updates is. RoundTimes::pace
/// holds it back, and so does a pause, which does not count in its seconds.
///
/// Then, in this order: the records of complete rounds are written, the checkpoint is saved where
/// one is due, and the meta-policy goes out, so that whoever has seen a round can count on what is
/// on the disk. While the disk takes nothing the round in hand is held, and it is tried again every
/// 2 s.
class RoundDriver {
 public:
  using Clock = std::chrono::steady_clock;  ///< of `now`; it is never asked for the time
  using Time = Clock::time_point;           ///< a point of that clock
  /// To somebody who asks something of a run.
  struct Answer {
    bool taken = false;   ///< false: it comes to nothing, and `message` says why
    std::string message;  ///< a clause for whoever asked
  };

  /// All that is referred to must live as long as this.
  RoundDriver(const Experiment& experiment, const RoundTimes& times, RoundOutlet& outlet, Time now);

  // what comes in: the owner's thread

  /// As MetaAggregator::offer().
  MetaAggregator::Answer offer(std::shared_ptr<const AuxiliaryUpdate> update);
  /// Counts an update that could not even be offered, as MetaAggregator does.
  void countRefusal(int task, const std::string& reason) { aggregator_.countRefusal(task, reason); }
  bool add(const TaskReturn& result) { return book_.add(result); }  ///< as RoundBook does
  /// A task has failed for good: `reason` is its TaskFailed. A test task may be among them.
  void giveUp(int task, const std::string& reason);

  // any thread

  void heard(int task, Time now) { roll_call_.heard(task, now); }  ///< a sign of life
  /// The next meta-policy is held back, so that agents wait once the round in hand is done; or the
  /// run goes on.
  Answer pause(bool on);
  /// The next meta-policy goes out with MetaPolicy::evaluate, or with MetaPolicy::checkpoint.
  Answer askForEvaluation();
  Answer askForCheckpoint();  ///< see askForEvaluation()
  /// Nothing can be asked for any more.
  void endRequests() { over_ = true; }

  // what is done with it: the owner's thread

  /// The meta-policy in hand goes out: the initial one, or that of the state which was loaded.
  void begin(Time now) { publish(now); }
  /// Does all that is due; to be called whenever something has come in, and every now and then.
  /// Throws Error, the sentence of the task that failed, once no quorum of fewer than all is left.
  void step(Time now);
  /// Ends the rounds where they are: closed ones are written as they are. True if that was all.
  bool end(Time now);
  /// All rounds are closed, complete and written.
  bool done() const { return book_.roundsTaken() == rounds_ && unwritten_.empty(); }

  /// Tells people this, with whatever keeps the run from going on.
  void say(const std::string& message, Time now);

  /// Updates in hand, and what became of others.
  const MetaAggregator& aggregator() const { return aggregator_; }
  const RoundBook& book() const { return book_; }               ///< returns in hand
  int round() const { return aggregator_.metaPolicy().round; }  ///< closed so far
  /// From 1; the last one once all are closed.
  int roundInHand() const { return std::min(round() + 1, rounds_); }
  const std::string& diskTrouble() const { return disk_trouble_; }  ///< "" while writing works

  /// What a run goes on from: aggregator and book.
  void saveState(StateWriter& writer) const;
  /// Throws Error where one of them does; to be called before begin().
  void loadState(StateReader& reader);

 private:
  using Level = RoundOutlet::Level;

  void collect(bool force, Time now);
  void writeDown(Time now);
  void publish(Time now);
  void closeIfDue(Time now);
  void close(Time due, Time now);
  bool isLate(Time now) const;
  double secondsInRound(Time now) const;

  void tellPause(Time now);
  void tellSilence(Time now);
  void tellLateness(Time now);
  std::string silenceText(Time now) const;
  std::string waitText(Time now) const;
  std::string namesOf(const std::vector<int>& tasks) const;

  const Experiment& experiment_;
  const RoundTimes times_;
  const int rounds_;
  RoundOutlet& outlet_;
  MetaAggregator aggregator_;
  RoundBook book_;
  RollCall roll_call_;

  std::deque<RoundBook::Round> unwritten_;  ///< complete rounds on their way to the disk
  bool unpublished_ = false;                ///< a closed round's meta-policy waits for the disk
  std::string disk_trouble_;
  Time next_attempt_;         ///< to write
  int checkpoint_round_ = 0;  ///< for which a checkpoint was asked

  Time round_start_;
  std::optional<Time> held_since_;  ///< the round is due, but the run is paused
  double next_late_word_ = 0;       ///< in seconds of the round
  bool pause_told_ = false;
  std::vector<int> silent_;  ///< as told

  std::atomic<bool> paused_{false};
  std::atomic<bool> evaluation_wanted_{false};
  std::atomic<bool> checkpoint_wanted_{false};
  std::atomic<bool> last_is_out_{false};  ///< of the meta-policies
  std::atomic<bool> over_{false};
};

}  // namespace pmeta
