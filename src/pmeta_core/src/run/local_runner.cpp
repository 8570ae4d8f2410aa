#include "pmeta_core/run/local_runner.h"

#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/run/meta_keeper.h"
#include "pmeta_core/run/meta_trainer.h"
#include "pmeta_core/run/round_driver.h"
#include "pmeta_core/storage/checkpoint.h"

namespace pmeta {
namespace {

using Clock = RoundDriver::Clock;

/// All parties of a run in one process, round by round.
class LocalRun : private RoundOutlet {
 public:
  /// log: none is written if it is null.
  LocalRun(const Experiment& experiment, RunLog* log)
      : experiment_(experiment),
        log_(log),
        keeps_(experiment.settings().fresh_episodes > 0),
        // nobody is late in one process
        driver_(experiment, RoundTimes(), *this, Clock::now()),
        keeper_(experiment) {
    if (experiment.hasMetaLearner()) {
      meta_trainer_ = std::make_unique<MetaTrainer>(experiment);
      parties_.push_back(meta_trainer_.get());
    } else {
      for (int task = 0; task < experiment.totalTasks(); ++task) {
        agents_.emplace_back(experiment, task);
      }
      for (TaskAgent& agent : agents_) parties_.push_back(&agent);
    }
    folders_.emplace_back(experiment, kAggregator, meta().model.layout);
    for (const Party* party : parties_) {
      if (party->trains()) folders_.emplace_back(experiment, party->number(), party->layout());
    }
  }

  const RoundDriver& rounds() const { return driver_; }
  const MetaPolicy& meta() const { return driver_.aggregator().metaPolicy(); }
  const std::vector<CheckpointFolder>& folders() const { return folders_; }

  void begin() { driver_.begin(Clock::now()); }

  /// Trains a round, unless one was that is not recorded yet, and gives the record.
  RoundBook::Round nextRound() {
    if (driver_.book().roundsTaken() == driver_.round()) train();
    if (experiment_.evaluatesMeta()) evaluateMeta();
    step();
    if (!written_) throw std::logic_error("a round without all of its returns");
    return *std::exchange(written_, std::nullopt);
  }

  // the aggregator's last: where it is, all are
  void saveCheckpoint(int round) override {
    if (log_ == nullptr) return;
    log_->sync();
    for (std::size_t i = 1; i < folders_.size(); ++i) folders_[i].save(round, *parties_[i - 1]);
    folders_[0].save(round, *this);
  }

  void loadCheckpoints(int round) {
    for (std::size_t i = 1; i < folders_.size(); ++i) folders_[i].load(round, *parties_[i - 1]);
    folders_[0].load(round, *this);
    const int taken = driver_.book().roundsTaken();
    if (driver_.round() != round || taken < round - 1 || taken > round) {
      throw Error("the checkpoint " + folders_[0].path(round) +
                  " cannot be used: its rounds contradict each other.");
    }
  }

  std::vector<FreshReturn> evaluateFresh() const {
    return fresh_.evaluate(agents_, experiment_.settings().fresh_episodes,
                           !experiment_.evaluatesMeta());
  }

  void savePolicies() const {
    const int round = driver_.round();
    keeper_.saveLast(meta());
    for (const Party* party : parties_) party->savePersonal(experiment_, round);
  }

  // what is the aggregator's
  void saveState(StateWriter& writer) const {
    driver_.saveState(writer);
    if (keeps_) writer.part("fresh", fresh_);
  }

  void loadState(StateReader& reader) {
    driver_.loadState(reader);
    Fresh fresh{fresh_, agents_};
    if (keeps_) reader.part("fresh", fresh);
  }

 private:
  struct Fresh {
    FreshEvaluation& evaluation;
    const std::deque<TaskAgent>& agents;
    void loadState(StateReader& reader) { evaluation.loadState(reader, agents); }
  };

  void train() {
    for (Party* party : parties_) {
      if (!party->trains()) continue;
      auto trained = party->trainRound(meta());
      if (trained->personal) {
        if (log_ != nullptr) party->keepBest(experiment_);
        driver_.add(*trained->personal);
      }
      const MetaAggregator::Answer answer =
          driver_.offer(std::make_shared<AuxiliaryUpdate>(std::move(trained->update)));
      if (answer.verdict != MetaAggregator::Verdict::kAccepted) throw Error(answer.reason);
    }
    step();
  }

  void evaluateMeta() {
    for (Party* party : parties_) {
      for (const TaskReturn& result : party->evaluateMeta(meta())) driver_.add(result);
    }
  }

  // nobody would mend the disk and have the run wait for it: it can be resumed
  void step() {
    driver_.step(Clock::now());
    if (!driver_.diskTrouble().empty()) throw Error(driver_.diskTrouble());
  }

  void publish(const MetaPolicy&) override {}  // agents look at meta()

  void write(const RoundBook::Round& round) override {
    if (keeps_ && !round.rows.empty()) fresh_.offer(round, agents_, meta());
    if (log_ != nullptr) {
      keeper_.offer(round, meta());
      log_->write(round);
    }
    written_ = round;
  }

  const Experiment& experiment_;
  RunLog* log_;
  bool keeps_;  // policies, for fresh episodes
  RoundDriver driver_;
  MetaKeeper keeper_;
  std::deque<TaskAgent> agents_;               // those that train first
  std::unique_ptr<MetaTrainer> meta_trainer_;  // in their place
  std::vector<Party*> parties_;                // the ones or the other
  std::vector<CheckpointFolder> folders_;      // the aggregator's, then those of parties that train
  FreshEvaluation fresh_;
  std::optional<RoundBook::Round> written_;  // and not given out yet
};

LocalResult runRounds(const Experiment& experiment, RunLog* log, const OnRound& on_round,
                      int resumed_round) {
  LocalRun run(experiment, log);
  if (resumed_round > 0) run.loadCheckpoints(resumed_round);
  run.begin();
  LocalResult result;
  while (!run.rounds().done() && !result.stopped) {
    result.rounds.push_back(run.nextRound());
    if (on_round && !on_round(result.rounds.back())) result.stopped = !run.rounds().done();
  }
  // so that a run that is stopped goes on from where it stopped
  if (result.stopped && experiment.settings().checkpoint_interval > 0) {
    run.saveCheckpoint(run.rounds().round());
  }

  if (experiment.settings().fresh_episodes > 0 && !result.stopped) {
    result.fresh = run.evaluateFresh();
    if (log != nullptr) {
      writeFileAtomically(log->dir() + "/final.csv", FreshEvaluation::csv(result.fresh));
    }
  }
  if (log != nullptr) run.savePolicies();
  result.meta = run.meta().model;
  return result;
}

}  // namespace

LocalResult runLocally(const Experiment& experiment, RunLog* log, const OnRound& on_round,
                       int resumed_round) {
  try {
    return runRounds(experiment, log, on_round, resumed_round);
  } catch (const std::exception& error) {
    if (log != nullptr) log->fail(error.what());
    throw;
  }
}

ResumePoint findResumePoint(const Experiment& experiment) {
  requireUnfinished(experiment.runDir());
  ResumePoint point;
  for (int at_most = std::numeric_limits<int>::max();; at_most = point.round - 1) {
    LocalRun run(experiment, nullptr);
    point.round = newestCommonRound(run.folders(), point.refused, at_most);
    if (point.round == 0) {
      throw Error("there is no round of which all parties have a good checkpoint in " +
                  experiment.runDir() + ": begin a new run" +
                  (point.refused.empty() ? "." : " (" + point.refused.front() + ")"));
    }
    try {
      run.loadCheckpoints(point.round);
      point.rounds_done = run.rounds().book().roundsTaken();
      return point;
    } catch (const Error& error) {
      // whole and of this run, but of no state that it can be in: the one before may be
      point.refused.emplace_back(error.what());
    }
  }
}

}  // namespace pmeta
