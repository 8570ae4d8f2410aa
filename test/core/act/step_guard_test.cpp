#include "pmeta_core/act/step_guard.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>

#include "../support.h"
#include "pmeta_core/act/rollout.h"
#include "pmeta_core/env/faulty_env.h"

namespace pmeta {
namespace {

using test::errorOf;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// does in a step what it is told to
class Scripted : public Env {
 public:
  using Script = std::function<Step(double* observation)>;
  explicit Scripted(Script script) : script_(std::move(script)) {}
  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng&, double* observation) override { script_(observation); }
  Step step(const double*, Rng&, double* observation) override { return script_(observation); }

 private:
  EnvSpec spec_ =
      describedSpec("scripted", 10, {{"angle", "rad"}, {"speed", "rad/s"}}, {{"torque", "N m"}});
  Script script_;
};

Step wellDone(double* observation) {
  observation[0] = 1;
  observation[1] = 2;
  return {0.5};
}

std::string errorOfStep(const Scripted::Script& script, double action = 0) {
  return errorOf([&] {
    Scripted env(script);
    Rng rng(1, 0, Stream::kSample);
    double observation[2];
    StepGuard(2, 1).step(env, &action, rng, observation);
  });
}

TEST(StepGuard, HandsOnWhatAnEnvironmentGives) {
  Scripted env(wellDone);
  Rng rng(1, 0, Stream::kSample);
  StepGuard guard(2, 1);
  double observation[2] = {0, 0};
  guard.reset(env, rng, observation);
  EXPECT_EQ(observation[1], 2);
  const double action = 0;
  EXPECT_EQ(guard.step(env, &action, rng, observation).reward, 0.5);
  EXPECT_EQ(observation[0], 1);
}

TEST(StepGuard, NamesWhatIsNoNumberOrOfAnotherSize) {
  EXPECT_EQ(errorOfStep([](double* observation) {
              wellDone(observation);
              return Step{kNan};
            }),
            "the environment 'scripted' gave a reward that is nan: it must be a finite number.");
  EXPECT_EQ(errorOfStep([](double* observation) {
              Step step = wellDone(observation);
              step.sparse_reward = std::numeric_limits<double>::infinity();
              return step;
            }),
            "the environment 'scripted' gave a reward that is inf: it must be a finite number.");
  EXPECT_EQ(errorOfStep([](double* observation) {
              observation[0] = 1;
              return Step{};
            }),
            "the environment 'scripted' gave an observation whose speed (number 1 of 2) is nan or "
            "was not written: each must be a finite number.");
  EXPECT_EQ(
      errorOfStep([](double* observation) {
        observation[2] = 0;
        return wellDone(observation);
      }),
      "the environment 'scripted' wrote more than the 2 numbers of observation that its spec() "
      "says.");
}

TEST(StepGuard, NamesWhatIsThrownButLeavesWhatOthersUnderstand) {
  EXPECT_EQ(errorOfStep([](double*) -> Step { throw std::out_of_range("no such joint."); }),
            "the environment 'scripted' cannot be stepped: no such joint.");
  EXPECT_EQ(errorOfStep([](double*) -> Step { throw 1; }),
            "the environment 'scripted' cannot be stepped: it threw something that is no "
            "std::exception.");
  EXPECT_EQ(errorOfStep([](double*) -> Step { throw Error("One of pMeta's own."); }),
            "One of pMeta's own.");
  Scripted env([](double*) -> Step { throw BrokenEpisode("it fell apart"); });
  Rng rng(1, 0, Stream::kSample);
  double observation[2];
  EXPECT_THROW(StepGuard(2, 1).reset(env, rng, observation), BrokenEpisode);
}

// of a policy that has diverged: its learner says so
TEST(StepGuard, LetsPassWhatComesOfAnActionThatIsNoNumber) {
  EXPECT_EQ(errorOfStep(
                [](double* observation) {
                  wellDone(observation);
                  return Step{kNan};
                },
                kNan),
            "(no error)");
}

class Family : public EnvFamily {
 public:
  explicit Family(std::function<std::unique_ptr<Env>(int)> maker) : maker_(std::move(maker)) {}
  void bind(Settings&) override {}
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int task) const override { return task == 0 ? "good" : "bad"; }
  std::string taskDescription(int task) const override { return taskName(task); }

 private:
  std::unique_ptr<Env> create(int task) const override { return maker_(task); }
  std::function<std::unique_ptr<Env>(int)> maker_;
};

class Sized : public Scripted {
 public:
  explicit Sized(EnvSpec spec) : Scripted(wellDone), sized_(std::move(spec)) {}
  const EnvSpec& spec() const override { return sized_; }

 private:
  EnvSpec sized_;
};

std::string errorOfMake(const std::function<std::unique_ptr<Env>(int)>& maker) {
  return errorOf([&] { Family(maker).make(1); });
}

TEST(EnvFamily, NamesTheTaskWhoseEnvironmentCannotBeMade) {
  EXPECT_EQ(errorOfMake([](int) -> std::unique_ptr<Env> { throw std::runtime_error("no port"); }),
            "the environment of task 1 (bad) cannot be made: no port.");
  EXPECT_EQ(errorOfMake([](int) { return nullptr; }),
            "the environment of task 1 (bad) is none: create() gave null.");
  EXPECT_EQ(
      errorOfMake([](int) {
        return std::make_unique<Sized>(EnvSpec{"sized", 0, 1, 0, 5});
      }),
      "the environment of task 1 (bad) has 0 numbers of observation, 1 of action and a horizon "
      "of 5: each must be at least 1.");
  EXPECT_EQ(errorOfMake([](int task) {
              return std::make_unique<Sized>(EnvSpec{"sized", 2 + task, 1, 0, 5});
            }),
            "the environment of task 1 (bad) has 3 numbers of observation, 1 of action and 0 "
            "discrete actions, but that of task 0 has 2 numbers of observation, 1 of action and 0 "
            "discrete actions: all tasks of a family must have the same.");
  const Family family([](int) { return std::make_unique<Scripted>(wellDone); });
  EXPECT_EQ(family.make(1)->description(), "environment of task 1 (bad)");
}

}  // namespace
}  // namespace pmeta
