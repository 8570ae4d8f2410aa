#include "pmeta_core/act/rollout.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../memory_state.h"
#include "pmeta_core/env/one_body.h"

namespace pmeta {
namespace {

// its number and the steps of the episode; episodes get longer, and one of them breaks down
class Clock : public Env {
 public:
  Clock(int number, int breaks_in) : number_(number), breaks_in_(breaks_in) {}
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    start_ = rng.uniform();
    ++episode_;
    steps_ = 0;
    observe(observation);
  }
  Step step(const double* action, Rng&, double* observation) override {
    ++steps_;
    observe(observation);
    if (episode_ == breaks_in_ && steps_ == 2) throw BrokenEpisode("clock: it broke");
    return {*action, false, steps_ == number_ + episode_};
  }
  std::vector<double> state() const override { return {start_, double(episode_), double(steps_)}; }
  void setState(const std::vector<double>& state) override {
    start_ = state[0];
    episode_ = static_cast<int>(state[1]);
    steps_ = static_cast<int>(state[2]);
  }

 private:
  void observe(double* observation) const {
    observation[0] = number_ + start_;
    observation[1] = steps_;
  }
  EnvSpec spec_ = [] {
    EnvSpec spec{"clock", 2, 1, 0, 100};
    spec.restorable = true;
    return spec;
  }();
  int number_, breaks_in_;
  double start_ = 0;
  int episode_ = 0;
  int steps_ = 0;
};

std::vector<std::unique_ptr<Env>> clocks(int n, int breaks_in = 0) {
  return makeEnvs([=](int k) { return std::make_unique<Clock>(k, breaks_in); }, n);
}

// writes down what happens, and acts by what it sees
class Scribe : public Actor {
 public:
  void begin(std::size_t env, Rng& rng) override {
    log.push_back("begin " + std::to_string(env));
    drawn.push_back(rng.uniform());
  }
  void look(const float* observations, const std::vector<std::size_t>& envs) override {
    std::string line = "look";
    for (const std::size_t env : envs) line += " " + std::to_string(env);
    log.push_back(line);
    seen_ = observations;
    envs_ = envs;
  }
  bool act(std::size_t row, Rng& rng, double* action) override {
    EXPECT_EQ(static_cast<std::size_t>(seen_[2 * row]), envs_[row]) << "rows stay together";
    drawn.push_back(rng.uniform());
    *action = seen_[2 * row + 1];
    return true;
  }
  void observe(const Experience& e) override {
    EXPECT_EQ(*e.action, e.observation[1]);
    EXPECT_EQ(e.next_observation[0], e.observation[0]) << "within one episode";
    EXPECT_EQ(e.next_observation[1], e.observation[1] + 1);
    log.push_back("saw " + std::to_string(e.env) + (e.step.truncated ? ", the end" : ""));
  }
  std::vector<std::string> log;
  std::vector<double> drawn;

 private:
  const float* seen_ = nullptr;
  std::vector<std::size_t> envs_;
};

using Log = std::vector<std::string>;

TEST(Rollout, EachEnvironmentBeginsAnotherEpisodeAtItsEnd) {
  Rollout rollout(clocks(2), Rollout::AtEnd::kBeginAnother, 0);
  Scribe scribe;
  Rng rng(1, 0, Stream::kSample);
  rollout.begin(2, scribe, rng);
  EXPECT_EQ(rollout.step(scribe, rng) + rollout.step(scribe, rng), 4);
  EXPECT_EQ(scribe.log, (Log{"begin 0", "begin 1", "look 0 1", "saw 0, the end", "begin 0", "saw 1",
                             "look 0 1", "saw 0", "saw 1, the end", "begin 1"}));
  EXPECT_TRUE(rollout.running());
}

TEST(Rollout, StopsWithTheLastEpisode) {
  Rollout rollout(clocks(3), Rollout::AtEnd::kStop, 0);
  Scribe scribe;
  Rng rng(1, 0, Stream::kSample);
  rollout.begin(2, scribe, rng);
  EXPECT_EQ(rollout.step(scribe, rng), 2);
  EXPECT_EQ(rollout.step(scribe, rng), 1);
  EXPECT_FALSE(rollout.running());
  EXPECT_EQ(scribe.log, (Log{"begin 0", "begin 1", "look 0 1", "saw 0, the end", "saw 1", "look 1",
                             "saw 1, the end"}));
  EXPECT_EQ(rollout.returned(0), 0);
  EXPECT_EQ(rollout.returned(1), 0 + 1);
  EXPECT_EQ(rollout.observation(1)[1], 2);
}

TEST(Rollout, DrawsInTheOrderOfStartsAndSteps) {
  Rollout rollout(clocks(2), Rollout::AtEnd::kBeginAnother, 0);
  Scribe scribe;
  Rng rng(1, 0, Stream::kSample), same = rng;
  rollout.begin(2, scribe, rng);
  rollout.step(scribe, rng);
  // a start, then what the actor draws for it; after the end in environment 0 once more
  std::vector<double> all;
  for (int k = 0; k < 8; ++k) all.push_back(same.uniform());
  EXPECT_EQ(scribe.drawn, (std::vector<double>{all[1], all[3], all[4], all[6], all[7]}));
}

TEST(Rollout, OfABrokenStepNothingIsSeen) {
  Rollout rollout(clocks(2, 2), Rollout::AtEnd::kBeginAnother, 1);
  Scribe scribe;
  Rng rng(1, 0, Stream::kSample);
  rollout.begin(2, scribe, rng);
  std::int64_t transitions = 0;
  for (int t = 0; t < 3; ++t) transitions += rollout.step(scribe, rng);
  EXPECT_EQ(transitions, 5);
  EXPECT_EQ(rollout.broken().count(), 1);
  EXPECT_EQ(Log(scribe.log.end() - 3, scribe.log.end()), (Log{"look 0 1", "begin 0", "saw 1"}));
  EXPECT_THROW(rollout.step(scribe, rng), BrokenEpisode) << "two running";
}

TEST(Rollout, AnEpisodeThatAnotherHasEndedMakesPlaceForANewOne) {
  const OneBody body(std::make_unique<Clock>(0, 0));
  Rollout training(makeEnvs([&](int) { return body.handle(); }, 1), Rollout::AtEnd::kBeginAnother,
                   0);
  Rollout evaluation(makeEnvs([&](int) { return body.handle(); }, 1), Rollout::AtEnd::kStop, 0);
  Scribe scribe, judge;
  Rng rng(1, 0, Stream::kSample);
  training.begin(1, scribe, rng);
  training.step(scribe, rng);
  training.step(scribe, rng);
  scribe.log.clear();
  for (evaluation.begin(1, judge, rng); evaluation.running();) evaluation.step(judge, rng);
  EXPECT_EQ(judge.log.back(), "saw 0, the end");
  EXPECT_EQ(training.step(scribe, rng), 1);
  EXPECT_EQ(scribe.log, (Log{"begin 0", "look 0", "saw 0"}));
  EXPECT_EQ(training.broken().count(), 0) << "nothing broke";
}

// a component as a learner saves it
struct Saved {
  explicit Saved(std::vector<std::unique_ptr<Env>> envs = clocks(2))
      : rollout(std::move(envs), Rollout::AtEnd::kBeginAnother, 0) {}
  Rollout rollout;
  void saveState(StateWriter& writer) const { rollout.saveEpisodes(writer, "at", {"a", "b"}); }
  void loadState(StateReader& reader) { rollout.loadEpisodes(reader, "at", {"a", "b"}); }
};

TEST(Rollout, GoesOnInTheMiddleOfEpisodes) {
  Saved a, b;
  Scribe one, other;
  Rng rng(1, 0, Stream::kSample);
  a.rollout.begin(2, one, rng);
  for (int t = 0; t < 7; ++t) a.rollout.step(one, rng);
  test::load(b, test::stateOf(a));
  one.log.clear();
  Rng same = rng;
  for (int t = 0; t < 7; ++t) {
    a.rollout.step(one, rng);
    b.rollout.step(other, same);
  }
  EXPECT_EQ(one.log, other.log);
  EXPECT_EQ(a.rollout.observation(1)[0], b.rollout.observation(1)[0]);
}

TEST(Rollout, WhatCannotBeRestoredBeginsAnew) {
  const auto bodies = [] {
    return makeEnvs([](int k) { return OneBody(std::make_unique<Clock>(k, 0)).handle(); }, 2);
  };
  Saved a(bodies()), b(bodies());
  Scribe one, other;
  Rng rng(1, 0, Stream::kSample);
  a.rollout.begin(2, one, rng);
  a.rollout.step(one, rng);
  test::load(b, test::stateOf(a));
  EXPECT_EQ(b.rollout.step(other, rng), 2);
  EXPECT_EQ(other.log,
            (Log{"begin 0", "begin 1", "look 0 1", "saw 0, the end", "begin 0", "saw 1"}));
}

}  // namespace
}  // namespace pmeta
