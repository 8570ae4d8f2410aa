// Pendulums of which that of task 1 does what no environment may, for test/package_test.py, which
// compiles this with the package of examples/pmeta_pendulum.
#include <limits>
#include <stdexcept>

#include "pendulum.h"

namespace {

constexpr char kFaulty[] = "pmeta_pendulum/Faulty";
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class Faulty : public pmeta::Env {
 public:
  Faulty(std::string fault, int good_steps)
      : spec_(pendulum_.spec()), fault_(std::move(fault)), good_steps_(good_steps) {
    spec_.name = kFaulty;
    if (fault_ == "other_size") {
      ++spec_.observation_size;
      spec_.observation.clear();
    }
    if (fault_ == "not_described") spec_.observation.pop_back();
  }

  const pmeta::EnvSpec& spec() const override { return spec_; }
  void reset(pmeta::Rng& rng, double* observation) override { pendulum_.reset(rng, observation); }

  pmeta::Step step(const double* action, pmeta::Rng& rng, double* observation) override {
    if (--good_steps_ >= 0) return pendulum_.step(action, rng, observation);
    if (fault_ == "throws") throw std::out_of_range("no such joint");
    if (fault_ == "throws_error") throw pmeta::Error("The motor is off.");
    if (fault_ == "throws_number") throw 42;
    double whole[3];
    pmeta::Step step = pendulum_.step(action, rng, whole);
    for (int k = 0; k < (fault_ == "too_few" ? 2 : 3); ++k) observation[k] = whole[k];
    if (fault_ == "too_many") observation[3] = 0;
    if (fault_ == "no_number") observation[2] = kNan;
    if (fault_ == "no_reward") step.reward = kNan;
    return step;
  }

 private:
  pmeta_pendulum::Pendulum pendulum_{1};
  pmeta::EnvSpec spec_;
  std::string fault_;
  int good_steps_;
};

class FaultyFamily : public pmeta::EnvFamily {
 public:
  void bind(pmeta::Settings& settings) override {
    settings.bind("environment.fault", fault_, "of task 1");
    settings.bind("environment.good_steps", good_steps_, "before it");
  }
  void build(std::uint64_t) override {}
  int numTasks() const override { return 2; }
  std::string taskName(int task) const override { return task == 0 ? "good" : "bad"; }
  std::string taskDescription(int task) const override { return taskName(task) + " one"; }

 private:
  std::unique_ptr<pmeta::Env> create(int task) const override {
    if (task == 1 && fault_ == "not_made") throw std::runtime_error("its port is taken");
    if (task == 1 && fault_ == "none") return nullptr;
    return std::make_unique<Faulty>(task == 1 ? fault_ : "", good_steps_);
  }

  std::string fault_;
  int good_steps_ = 0;
};

const pmeta::RegisteredFamily<FaultyFamily> kFamily(kFaulty);

}  // namespace
