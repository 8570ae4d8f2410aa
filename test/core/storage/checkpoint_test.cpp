#include "pmeta_core/storage/checkpoint.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <limits>

#include "../memory_state.h"
#include "../support.h"
#include "checkpoint_experiments.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;
using test::checkpointExperiment;
using test::checkpointKinds;
using test::errorOf;
using test::MemoryState;
using test::readFile;
using test::stateOf;
using test::TempDir;
using test::trainedAgent;
using test::writeFile;

struct Numbers {
  std::vector<float> floats = {1.5f, -2, 0};
  std::vector<double> doubles = {0.1};
  std::vector<std::int64_t> none;
  std::vector<std::uint8_t> bytes = {1, 0, 255};
  std::uint64_t big = ~std::uint64_t{0};
  std::string text = "a line\nand \xc3\xa9", empty;

  void saveState(StateWriter& writer) const {
    writer.array("deep/floats", floats);
    writer.array("doubles", doubles);
    writer.array("none", none);
    writer.array("bytes", bytes);
    writer.value("big", big);
    writer.text("text", text);
    writer.text("empty", empty);
  }
  void loadState(StateReader& reader) {
    floats.assign(3, 0);
    doubles.assign(1, 0);
    reader.array("deep/floats", floats);
    reader.array("doubles", doubles);
    none.assign(reader.size<std::int64_t>("none", 5), 9);
    bytes.assign(reader.size<std::uint8_t>("bytes", 3), 9);
    reader.array("bytes", bytes);
    big = reader.value<std::uint64_t>("big");
    text = reader.text("text", 100);
    empty = reader.text("empty", 100);
  }
};

const CheckpointIdentity kIdentity = {
    "run", 3, 12, "float32\nq 2\n", {{"seed", "1"}, {"a", "b=c"}}};

std::string write(const std::string& path, const CheckpointIdentity& identity = kIdentity) {
  writeCheckpoint(path, identity, [](StateWriter& writer) { Numbers().saveState(writer); });
  return readFile(path);
}

TEST(Checkpoint, GivesBackWhatWasWritten) {
  const TempDir dir;
  write(dir / "a.h5");
  CheckpointFile file(dir / "a.h5");
  EXPECT_EQ(file.identity().run_id, "run");
  EXPECT_EQ(file.identity().task, 3);
  EXPECT_EQ(file.identity().round, 12);
  EXPECT_EQ(file.identity().layout, kIdentity.layout);
  EXPECT_EQ(file.identity().settings, kIdentity.settings);
  file.require(kIdentity);
  Numbers found;
  found.floats = {};
  found.big = 0;
  found.text = "";
  file.load([&](StateReader& reader) { found.loadState(reader); });
  EXPECT_TRUE(stateOf(found) == stateOf(Numbers()));
  EXPECT_FALSE(fs::exists(dir / "a.h5.tmp"));
}

TEST(Checkpoint, EqualStatesGiveEqualBytes) {
  const TempDir dir;
  EXPECT_EQ(write(dir / "a.h5"), write(dir / "b.h5"));
  for (const std::string& kind : checkpointKinds()) {
    const Experiment experiment = checkpointExperiment(kind, dir.path());
    const TaskAgent agent = trainedAgent(experiment, 3);
    const CheckpointFolder folder(experiment, 1, agent.layout());
    folder.save(3, agent);
    const std::string bytes = readFile(folder.path(3));
    TaskAgent other(experiment, 1);
    folder.load(3, other);
    folder.save(3, other);
    EXPECT_EQ(readFile(folder.path(3)), bytes) << kind;
    EXPECT_TRUE(stateOf(agent) == stateOf(other)) << kind;
  }
}

TEST(Checkpoint, RefusesWhatIsCutOff) {
  const TempDir dir;
  const std::string path = dir / "a.h5";
  const std::string whole = write(path);
  for (const std::size_t length :
       {std::size_t{0}, std::size_t{5}, std::size_t{8}, std::size_t{100}, std::size_t{511},
        std::size_t{512}, std::size_t{700}, whole.size() / 2, whole.size() - 1}) {
    writeFile(path, whole.substr(0, length));
    const std::string error = errorOf([&] { CheckpointFile file(path); });
    EXPECT_NE(error.find(length < 8 ? "no checkpoint" : "cut off"), std::string::npos)
        << length << ": " << error;
  }
  writeFile(path, whole + '\0');
  EXPECT_NE(errorOf([&] { CheckpointFile file(path); }).find("altered"), std::string::npos);
  EXPECT_NE(errorOf([&] { CheckpointFile file(dir / "none.h5"); }).find("No such file"),
            std::string::npos);
}

TEST(Checkpoint, RefusesEveryFlippedBit) {
  const TempDir dir;
  const std::string path = dir / "a.h5";
  const std::string whole = write(path);
  const auto errorAt = [&](std::size_t byte) {
    std::string flipped = whole;
    flipped[byte] = static_cast<char>(flipped[byte] ^ (1 << (byte % 8)));
    writeFile(path, flipped);
    return errorOf([&] { CheckpointFile file(path); });
  };
  EXPECT_NE(errorAt(0).find("no checkpoint of pMeta"), std::string::npos);
  EXPECT_NE(errorAt(8).find("of version 3 of the format, not 2: go on with the pMeta"),
            std::string::npos);
  EXPECT_NE(errorAt(16).find("cut off or altered"), std::string::npos);
  for (std::size_t byte = 0; byte < 600; ++byte) ASSERT_NE(errorAt(byte), "(no error)") << byte;
  for (std::size_t byte = 600; byte < whole.size(); byte += 97) {
    ASSERT_NE(errorAt(byte).find("altered"), std::string::npos) << byte;
  }
  EXPECT_NE(errorAt(whole.size() - 1).find("altered"), std::string::npos);
}

TEST(Checkpoint, RefusesThatOfAnotherRunPartyOrModel) {
  const TempDir dir;
  const std::string path = dir / "a.h5";
  write(path);
  const CheckpointFile file(path);
  const auto errorWith = [&](auto change) {
    CheckpointIdentity expected = kIdentity;
    change(expected);
    return errorOf([&] { file.require(expected); });
  };
  const std::string head = "the checkpoint " + path + " cannot be used: ";
  EXPECT_EQ(errorWith([](auto& e) { e.round = 1; }), "(no error)");
  EXPECT_EQ(errorWith([](auto& e) { e.task = 2; }), head + "it is of task 3, not of task 2.");
  EXPECT_EQ(errorWith([](auto& e) { e.task = kAggregator; }),
            head + "it is of task 3, not of the aggregator.");
  EXPECT_EQ(errorWith([](auto& e) { e.settings["seed"] = "2"; }),
            head + "it is of another experiment, with seed 1 where this run has 2.");
  EXPECT_EQ(errorWith([](auto& e) { e.settings["x"] = "2"; }),
            head + "it is of another experiment, with x not set where this run has 2.");
  EXPECT_EQ(errorWith([](auto& e) { e.run_id = "walk"; }),
            head + "it is of run 'run', not of 'walk'.");
  EXPECT_EQ(errorWith([](auto& e) { e.layout = "float32\nq 3\n"; }),
            head + "its model has another layout than this run's.");
}

TEST(Checkpoint, NamesTheFirstSettingThatDiffers) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  const TaskAgent agent = trainedAgent(experiment, 1);
  CheckpointFolder(experiment, 1, agent.layout()).save(1, agent);
  const auto refused = [&](const std::string& override) {
    std::vector<std::string> sentences;
    const Experiment other = checkpointExperiment("table", dir.path(), {override});
    EXPECT_EQ(CheckpointFolder(other, 1, agent.layout()).newest(9, sentences), 0);
    return sentences.at(0);
  };
  EXPECT_NE(refused("lambda:=5").find("personal.lambda 10 where this run has 5"),
            std::string::npos);
  EXPECT_NE(refused("slip:=0.2").find("environment.slip"), std::string::npos);
  std::vector<std::string> sentences;
  const Experiment same = checkpointExperiment(
      "table", dir.path(), {"pace:=1", "checkpoint.interval:=7", "round_timeout:=3"});
  EXPECT_EQ(CheckpointFolder(same, 1, agent.layout()).newest(9, sentences), 1);
  EXPECT_TRUE(sentences.empty());
}

TEST(CheckpointFolder, KeepsTheLastTwo) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("table", dir.path());
  const ModelLayout layout = TaskAgent(experiment, 0).layout();
  const CheckpointFolder folder(experiment, 1, layout), other(experiment, 11, layout);
  std::vector<std::string> refused;
  EXPECT_EQ(folder.newest(100, refused), 0);
  other.save(2, Numbers());
  for (const int round : {2, 4, 9, 11}) folder.save(round, Numbers());
  EXPECT_FALSE(fs::exists(folder.path(2)));
  EXPECT_FALSE(fs::exists(folder.path(4)));
  EXPECT_EQ(folder.newest(100, refused), 11);
  EXPECT_EQ(folder.newest(10, refused), 9);
  EXPECT_EQ(folder.newest(8, refused), 0);
  EXPECT_EQ(other.newest(8, refused), 2);
  // gone back: what is newer is of a past that is no more
  folder.save(10, Numbers());
  EXPECT_EQ(folder.newest(100, refused), 10);
  EXPECT_EQ(folder.newest(9, refused), 9);
  EXPECT_FALSE(fs::exists(folder.path(11)));

  // of both, what both have
  EXPECT_EQ(newestCommonRound({folder, other}, refused), 0);
  other.save(9, Numbers());
  EXPECT_EQ(newestCommonRound({folder, other}, refused), 9);
  EXPECT_TRUE(refused.empty());
  writeFile(folder.path(9), "damaged");
  EXPECT_EQ(newestCommonRound({folder, other}, refused), 0);
  EXPECT_EQ(refused.size(), 1u);

  // a file that was renamed
  fs::rename(folder.path(10), folder.path(12));
  Numbers numbers;
  EXPECT_NE(errorOf([&] { folder.load(12, numbers); }).find("of round 10"), std::string::npos);
}

TEST(CheckpointFolder, AFullDiskLeavesTheOlderOnes) {
  const TempDir dir;
  const Experiment experiment = checkpointExperiment("dqn", dir.path());
  const TaskAgent agent = trainedAgent(experiment, 1);
  const CheckpointFolder folder(experiment, 1, agent.layout());
  folder.save(1, agent);
  folder.save(2, agent);
  // no file may grow beyond this: as a disk that fills up in the middle
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 4096;
  setrlimit(RLIMIT_FSIZE, &small);
  const auto openFiles = [] {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  };
  const auto open_before = openFiles();
  const std::string error = errorOf([&] { folder.save(3, agent); });
  EXPECT_EQ(openFiles(), open_before);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_NE(error.find("cannot write the checkpoint"), std::string::npos) << error;

  std::vector<std::string> refused;
  EXPECT_EQ(folder.newest(9, refused), 2);
  EXPECT_EQ(folder.newest(1, refused), 1);
  EXPECT_TRUE(refused.empty());
  EXPECT_FALSE(fs::exists(folder.path(3) + ".tmp"));
  folder.save(3, agent);
  EXPECT_EQ(folder.newest(9, refused), 3);
}

TEST(TaskAgent, TheRoundTrainedLastIsNotTrainedAgain) {
  for (const std::string& kind : checkpointKinds()) {
    const Experiment experiment = checkpointExperiment(kind, "/tmp/pmeta_unused");
    TaskAgent agent(experiment, 1);
    MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
    meta.round = 1;  // so that the next round is evaluated
    const auto first = agent.trainRound(meta);
    const MemoryState after = stateOf(agent);
    TaskAgent loaded(experiment, 1);
    test::load(loaded, after);
    for (TaskAgent* one : {&agent, &loaded}) {
      const auto again = one->trainRound(meta);
      EXPECT_TRUE(again->update.model == first->update.model) << kind;
      EXPECT_EQ(again->update.round, 2);
      EXPECT_EQ(again->update.task, 1);
      EXPECT_EQ(again->update.run_id, "run");
      EXPECT_EQ(again->update.weight, first->update.weight);
      ASSERT_TRUE(again->personal.has_value());
      EXPECT_EQ(again->personal->mean, first->personal->mean);
      EXPECT_EQ(again->personal->std, first->personal->std);
      EXPECT_EQ(again->personal->env_steps, first->personal->env_steps);
      EXPECT_EQ(again->personal->run_id, "run");
      EXPECT_EQ(again->env_steps, first->env_steps);
      EXPECT_EQ(again->distance, first->distance);
      EXPECT_TRUE(stateOf(*one) == after) << kind << ": nothing was trained";
    }
    // and from there both go on alike
    meta.round = 2;
    EXPECT_TRUE(agent.trainRound(meta)->update.model == loaded.trainRound(meta)->update.model);
    EXPECT_TRUE(stateOf(agent) == stateOf(loaded)) << kind;
    EXPECT_FALSE(stateOf(agent) == after);
  }
}

TEST(TaskAgent, SavesBetweenRoundsOnly) {
  const Experiment experiment = checkpointExperiment("dqn", "/tmp/pmeta_unused");
  TaskAgent agent = trainedAgent(experiment, 1);
  MetaPolicy meta = MetaAggregator(experiment).metaPolicy();
  meta.round = 1;
  EXPECT_FALSE(agent.trainRound(meta, [](int done) { return done < 3; }).has_value());
  EXPECT_NE(errorOf([&] { stateOf(agent); }).find("in the middle of a round"), std::string::npos);
  EXPECT_TRUE(agent.trainRound(meta).has_value());
  stateOf(agent);
  const Experiment tests = checkpointExperiment("sac_context", "/tmp/pmeta_unused");
  EXPECT_NE(errorOf([&] { stateOf(TaskAgent(tests, 2)); }).find("is a test task"),
            std::string::npos);
}

}  // namespace
}  // namespace pmeta
