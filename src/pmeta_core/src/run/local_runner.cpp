#include "pmeta_core/run/local_runner.h"

#include <chrono>
#include <limits>
#include <stdexcept>

#include "pmeta_core/base/error.h"
#include "pmeta_core/storage/checkpoint.h"
#include "pmeta_core/storage/policy_file.h"

namespace pmeta {
namespace {

/// All parties of a run in one process, round by round.
class LocalRun {
 public:
  explicit LocalRun(const Experiment& experiment)
      : experiment_(experiment),
        aggregator_(experiment),
        book_(experiment),
        keeps_(experiment.settings().fresh_episodes > 0) {
    for (int task = 0; task < experiment.totalTasks(); ++task)
      agents_.emplace_back(experiment, task);
    folders_.emplace_back(experiment, kAggregator, aggregator_.metaPolicy().model.layout);
    for (const TaskAgent& agent : agents_) {
      if (agent.trains()) folders_.emplace_back(experiment, agent.task(), agent.layout());
    }
  }

  int round() const { return aggregator_.metaPolicy().round; }
  bool complete() const { return book_.roundsTaken() == round(); }
  int roundsTaken() const { return book_.roundsTaken(); }
  const std::vector<CheckpointFolder>& folders() const { return folders_; }

  void train() {
    const auto start = std::chrono::steady_clock::now();
    const int round = this->round() + 1;
    for (TaskAgent& agent : agents_) {
      if (!agent.trains()) continue;
      auto trained = agent.trainRound(aggregator_.metaPolicy());
      if (trained->personal) book_.add(*trained->personal);
      const MetaAggregator::Answer answer =
          aggregator_.offer(std::make_shared<AuxiliaryUpdate>(std::move(trained->update)));
      if (answer.verdict != MetaAggregator::Verdict::kAccepted) throw Error(answer.reason);
    }
    const std::vector<int> missing = aggregator_.closeRound();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    book_.closeRound(round, aggregator_.metaPolicy().participants, missing, seconds.count(),
                     aggregator_.excluded());
  }

  // the record of the round that has been trained, once the meta-policy is evaluated
  std::vector<RoundBook::Round> record() {
    for (TaskAgent& agent : agents_) {
      if (!experiment_.evaluatesMeta()) break;
      for (const TaskReturn& result : agent.evaluateMeta(aggregator_.metaPolicy())) {
        book_.add(result);
      }
    }
    std::vector<RoundBook::Round> done = book_.take();
    if (done.empty()) throw std::logic_error("a round without all of its returns");
    for (const RoundBook::Round& round : done) {
      if (keeps_ && !round.rows.empty()) fresh_.offer(round, agents_, aggregator_.metaPolicy());
    }
    return done;
  }

  // the aggregator's last: where it is, all are
  void saveCheckpoints() const {
    for (std::size_t i = 1; i < folders_.size(); ++i) {
      folders_[i].save(round(), agents_[i - 1]);
    }
    folders_[0].save(round(), *this);
  }

  void loadCheckpoints(int round) {
    for (std::size_t i = 1; i < folders_.size(); ++i) folders_[i].load(round, agents_[i - 1]);
    folders_[0].load(round, *this);
    if (this->round() != round || book_.roundsTaken() < round - 1 || book_.roundsTaken() > round) {
      throw Error("the checkpoint " + folders_[0].path(round) +
                  " cannot be used: its rounds contradict each other.");
    }
  }

  std::vector<FreshReturn> evaluateFresh() const {
    return fresh_.evaluate(agents_, experiment_.settings().fresh_episodes,
                           !experiment_.evaluatesMeta());
  }

  void savePolicies() const {
    const MetaPolicy& meta = aggregator_.metaPolicy();
    saveRunPolicy(experiment_, PolicyKind::kMeta, -1, meta.round, meta.model);
    for (const TaskAgent& agent : agents_) {
      if (!agent.trains()) continue;
      saveRunPolicy(experiment_, PolicyKind::kPersonal, agent.task(), meta.round, agent.personal(),
                    agent.taskInput());
    }
  }

  const Model& meta() const { return aggregator_.metaPolicy().model; }

  // what is the aggregator's
  void saveState(StateWriter& writer) const {
    writer.part("aggregator", aggregator_);
    writer.part("book", book_);
    if (keeps_) writer.part("fresh", fresh_);
  }

  void loadState(StateReader& reader) {
    reader.part("aggregator", aggregator_);
    reader.part("book", book_);
    Fresh fresh{fresh_, agents_};
    if (keeps_) reader.part("fresh", fresh);
  }

 private:
  struct Fresh {
    FreshEvaluation& evaluation;
    const std::vector<TaskAgent>& agents;
    void loadState(StateReader& reader) { evaluation.loadState(reader, agents); }
  };

  const Experiment& experiment_;
  MetaAggregator aggregator_;
  RoundBook book_;
  std::vector<TaskAgent> agents_;          // those that train first
  std::vector<CheckpointFolder> folders_;  // the aggregator's, then those of agents that train
  bool keeps_;                             // policies, for fresh episodes
  FreshEvaluation fresh_;
};

LocalResult runRounds(const Experiment& experiment, RunLog* log, const OnRound& on_round,
                      int resumed_round) {
  LocalRun run(experiment);
  if (resumed_round > 0) run.loadCheckpoints(resumed_round);
  const auto save = [&] {
    log->sync();
    run.saveCheckpoints();
  };

  const int rounds = experiment.settings().rounds;
  LocalResult result;
  while ((run.round() < rounds || !run.complete()) && !result.stopped) {
    if (run.complete()) {
      run.train();
      if (log != nullptr && experiment.checkpointsAfter(run.round())) save();
    }
    for (RoundBook::Round& done : run.record()) {
      if (log != nullptr) log->write(done);
      if (on_round && !on_round(done)) result.stopped = run.round() < rounds;
      result.rounds.push_back(std::move(done));
    }
  }
  // so that a run that is stopped goes on from where it stopped
  if (result.stopped && log != nullptr && experiment.settings().checkpoint_interval > 0) save();

  if (experiment.settings().fresh_episodes > 0 && !result.stopped) {
    result.fresh = run.evaluateFresh();
    if (log != nullptr) {
      writeFileAtomically(log->dir() + "/final.csv", FreshEvaluation::csv(result.fresh));
    }
  }
  if (log != nullptr) run.savePolicies();
  result.meta = run.meta();
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
    LocalRun run(experiment);
    point.round = newestCommonRound(run.folders(), point.refused, at_most);
    if (point.round == 0) {
      throw Error("there is no round of which all parties have a good checkpoint in " +
                  experiment.runDir() + ": begin a new run" +
                  (point.refused.empty() ? "." : " (" + point.refused.front() + ")"));
    }
    try {
      run.loadCheckpoints(point.round);
      point.rounds_done = run.roundsTaken();
      return point;
    } catch (const Error& error) {
      // whole and of this run, but of no state that it can be in: the one before may be
      point.refused.emplace_back(error.what());
    }
  }
}

}  // namespace pmeta
