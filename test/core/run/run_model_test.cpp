// what a run depends on is part of it: the model of its robots, wherever the original has gone
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "../support.h"
#include "pmeta_core/base/hash.h"
#include "pmeta_core/env/mujoco_model.h"
#include "pmeta_core/run/loaded_policy.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;
using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;

constexpr char kSettings[] = R"(
experiment: cheetah
run_id: a
results_dir: results
rounds: 2
updates_per_round: 1
learner: sac
checkpoint: {interval: 1}
sac: {hidden: [4], batch_size: 4, buffer_size: 100, warm_up_steps: 5, evaluation_episodes: 1}
environment: {name: half_cheetah_dir, horizon: 5, model_file: robots/mine.xml}
)";

class RunModel : public ::testing::Test {
 protected:
  RunModel() {
    fs::create_directories(dir_ / "robots");
    writeFile(model_, shippedModel("half_cheetah"));
    writeFile(config_, kSettings);
  }

  // one round of two
  Experiment stopped() const {
    const Experiment experiment = Experiment::load(config_);
    RunLog log(experiment);
    runLocally(experiment, &log, [](const RoundBook::Round&) { return false; });
    log.finish("stopped");
    return experiment;
  }

  const TempDir dir_;
  const std::string model_ = dir_ / "robots/mine.xml";
  const std::string config_ = dir_ / "settings.yaml";
  const std::string run_ = dir_ / "results/cheetah/a";
};

TEST_F(RunModel, PathsOfASettingsFileAreRelativeToItsFolder) {
  const Experiment experiment = Experiment::load(config_);
  EXPECT_EQ(experiment.runDir(), run_);
  EXPECT_EQ(experiment.model()->file, model_);
  EXPECT_EQ(experiment.model()->hash, hashText(shippedModel("half_cheetah")));
  // those that are given otherwise, to the working folder
  EXPECT_EQ(Experiment::load(config_, {"results_dir:=x"}).settings().results_dir,
            fs::current_path() / "x");
  EXPECT_EQ(Experiment::load(config_, {"key_file:=k"}).settings().key_file,
            fs::current_path() / "k");
}

TEST_F(RunModel, ARunKeepsACopyThatItsSettingsName) {
  const Experiment experiment = stopped();
  EXPECT_EQ(readFile(run_ + "/models/mine.xml"), readFile(model_));
  const auto manifest = nlohmann::json::parse(readFile(run_ + "/manifest.json"));
  EXPECT_EQ(manifest.at("model_hash"), experiment.model()->hash);
  fs::remove(model_);
  // the folder may move
  fs::rename(dir_ / "results", dir_ / "moved");
  const std::string moved = dir_ / "moved/cheetah/a";
  const Experiment again = Experiment::load(moved + "/config.yaml", {"run_id:=b"});
  EXPECT_EQ(again.model()->file, moved + "/models/mine.xml");
  const Experiment resumed = Experiment::resume(moved);
  EXPECT_EQ(resumed.settingsHash(), experiment.settingsHash());
  EXPECT_EQ(findResumePoint(resumed).round, 1);
  const LoadedPolicy policy(moved + "/policies/meta.safetensors", 0);
  EXPECT_EQ(policy.experiment().model()->file, moved + "/models/mine.xml");
}

TEST_F(RunModel, AnotherModelIsRefused) {
  const Experiment experiment = stopped();
  const std::string hash = experiment.model()->hash;
  // the original does not matter any more
  writeFile(model_, readFile(model_) + "<!-- changed -->");
  Experiment::resume(run_);
  const std::string copy = run_ + "/models/mine.xml";
  writeFile(copy, readFile(copy) + "<!-- changed -->");
  const std::string sentence = "the model " + copy + " has the hash " + hashText(readFile(copy)) +
                               ", but environment.model_hash is " + hash +
                               ": give the model that this was made with, or model_hash:=\"\" to "
                               "take this one.";
  EXPECT_EQ(errorOf([&] { Experiment::resume(run_); }), sentence);
  EXPECT_EQ(errorOf([&] { Experiment::load(run_ + "/config.yaml"); }), sentence);
  EXPECT_EQ(errorOf([&] { LoadedPolicy(run_ + "/policies/meta.safetensors", 0); }), sentence);
}

TEST_F(RunModel, APolicyThatIsElsewhereNeedsTheOriginal) {
  stopped();
  const std::string policy = dir_ / "meta.safetensors";
  fs::rename(run_ + "/policies/meta.safetensors", policy);
  EXPECT_EQ(LoadedPolicy(policy, 0).experiment().model()->file, model_);
  fs::remove(model_);
  EXPECT_NE(errorOf([&] { LoadedPolicy(policy, 0); }).find("leave the policy in the folder"),
            std::string::npos);
}

TEST_F(RunModel, ShippedModelsHaveAHashToo) {
  const Experiment shipped = Experiment::load(config_, {"model_file:=''"});
  EXPECT_EQ(shipped.model()->hash, hashText(shippedModel("half_cheetah")));
  EXPECT_NE(errorOf([&] {
              Experiment::load(config_, {"model_file:=''", "model_hash:=00"});
            }).find("environment.model_hash is 00"),
            std::string::npos);
}

}  // namespace
}  // namespace pmeta
