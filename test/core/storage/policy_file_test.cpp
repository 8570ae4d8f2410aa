#include "pmeta_core/storage/policy_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "../support.h"
#include "pmeta_core/run/local_runner.h"

namespace pmeta {
namespace {

using test::errorOf;
using test::gridExperiment;
using test::readFile;
using test::TempDir;
using test::writeFile;
using testing::HasSubstr;
using Json = nlohmann::json;

Model floatModel() {
  Model model(ModelLayout(Precision::kFloat32, {{"q.layer0.weight", {2, 3}}, {"q.scale", {}}}));
  model.floats() = {1.5f, -0.0f, 3e-39f, 3e38f, 0.1f, -7, 42};
  return model;
}

Model maskedModel() {
  Model model(ModelLayout(Precision::kFloat64, {{"q_table", {3, 2}}, {"other", {1}}}));
  model.doubles() = {0.1, 1e-310, -1e300, 0, 5, 6, 7};
  model.present = {1, 0, 1, 1, 0, 0, 1};
  return model;
}

// the format once more, read byte by byte: header and data
std::pair<Json, std::string> readPlainly(const std::string& path) {
  const std::string bytes = readFile(path);
  std::uint64_t length = 0;
  for (int k = 7; k >= 0; --k) length = length * 256 + static_cast<unsigned char>(bytes.at(k));
  return {Json::parse(bytes.substr(8, length)), bytes.substr(8 + length)};
}

template <class Scalar>
std::vector<double> numbersOf(const std::pair<Json, std::string>& file, const std::string& name) {
  const std::size_t begin = file.first.at(name).at("data_offsets").at(0);
  const std::size_t end = file.first.at(name).at("data_offsets").at(1);
  std::vector<double> numbers;
  for (std::size_t at = begin; at < end; at += sizeof(Scalar)) {
    Scalar value;
    std::memcpy(&value, file.second.substr(at, sizeof value).data(), sizeof value);
    numbers.push_back(value);
  }
  return numbers;
}

std::string fileOf(const std::string& header, const std::string& data) {
  std::string bytes;
  for (int k = 0; k < 8; ++k) bytes += static_cast<char>(header.size() >> (8 * k) & 255);
  return bytes + header + data;
}

// a valid little file, for tests that spoil it
Json goodHeader() {
  return {{"__metadata__", {{"layout", "float32\na 2\nb 1\n"}}},
          {"a", {{"dtype", "F32"}, {"shape", {2}}, {"data_offsets", {0, 8}}}},
          {"b", {{"dtype", "F32"}, {"shape", {1}}, {"data_offsets", {8, 12}}}}};
}

class PolicyFileTest : public testing::Test {
 protected:
  std::string refusal(const std::string& bytes) {
    // a new file: cutting off an old one makes some file systems wait for the disk
    std::filesystem::remove(path_);
    writeFile(path_, bytes);
    return errorOf([&] { loadPolicy(path_); });
  }
  std::string refusal(const Json& header, std::size_t data = 12) {
    return refusal(fileOf(header.dump(), std::string(data, '\0')));
  }

  TempDir dir_;
  std::string path_ = dir_ / "policy.safetensors";
};

TEST_F(PolicyFileTest, ModelsComeBackBitForBit) {
  for (const Model& model : {floatModel(), maskedModel()}) {
    savePolicy(path_, model, {{"environment", "gridworld"}, {"note", "a\n\"quoted\" \xc3\xa9"}});
    const PolicyFile back = loadPolicy(path_);
    EXPECT_TRUE(back.model == model);
    EXPECT_EQ(back.metadata.at("environment"), "gridworld");
    EXPECT_EQ(back.metadata.at("note"), "a\n\"quoted\" \xc3\xa9");
    EXPECT_EQ(back.metadata.at("layout"), model.layout.text());
  }
  EXPECT_FALSE(std::filesystem::exists(path_ + ".tmp"));
}

TEST_F(PolicyFileTest, AnotherReaderOfTheFormatFindsTheNumbers) {
  savePolicy(path_, floatModel(), {});
  const auto floats = readPlainly(path_);
  EXPECT_EQ(floats.first["q.layer0.weight"]["dtype"], "F32");
  EXPECT_EQ(floats.first["q.layer0.weight"]["shape"], Json({2, 3}));
  EXPECT_EQ(floats.first["q.scale"]["shape"], Json::array());
  EXPECT_EQ(numbersOf<float>(floats, "q.layer0.weight"),
            (std::vector<double>{1.5, -0.0, 3e-39f, 3e38f, 0.1f, -7}));
  EXPECT_EQ(numbersOf<float>(floats, "q.scale"), std::vector<double>{42});

  savePolicy(path_, maskedModel(), {});
  const auto masked = readPlainly(path_);
  EXPECT_EQ(masked.first["q_table"]["dtype"], "F64");
  EXPECT_EQ(masked.first["q_table.present"]["dtype"], "U8");
  EXPECT_EQ(masked.first["q_table.present"]["shape"], Json({3, 2}));
  EXPECT_EQ(numbersOf<double>(masked, "q_table"),
            (std::vector<double>{0.1, 1e-310, -1e300, 0, 5, 6}));
  EXPECT_EQ(numbersOf<std::uint8_t>(masked, "q_table.present"),
            (std::vector<double>{1, 0, 1, 1, 0, 0}));
  EXPECT_EQ(numbersOf<std::uint8_t>(masked, "other.present"), std::vector<double>{1});
  const std::size_t file_size = readFile(path_).size();
  EXPECT_EQ((file_size - masked.second.size()) % 8, 0u) << "the values are aligned";
}

TEST_F(PolicyFileTest, TenLinesOfNumpyReadIt) {
  savePolicy(path_, maskedModel(), {{"learner", "q_learning"}});
  const std::string script = R"(
import json, sys
import numpy as np
data = open(sys.argv[1], "rb").read()
start = 8 + int.from_bytes(data[:8], "little")
header = json.loads(data[8:start].decode())
assert header.pop("__metadata__")["learner"] == "q_learning"
types = {"F32": "<f4", "F64": "<f8", "U8": "u1"}
tensors = {name: np.frombuffer(data[start + t["data_offsets"][0]:start + t["data_offsets"][1]],
                               types[t["dtype"]]).reshape(t["shape"]) for name, t in header.items()}
print(sorted(tensors), tensors["q_table"].tolist(), tensors["q_table.present"].sum())
)";
  writeFile(dir_ / "read.py", script);
  FILE* pipe =
      popen(("/usr/bin/python3 " + (dir_ / "read.py") + " " + path_ + " 2>&1").c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  for (int c = fgetc(pipe); c != EOF; c = fgetc(pipe)) output += static_cast<char>(c);
  pclose(pipe);
  EXPECT_EQ(output,
            "['other', 'other.present', 'q_table', 'q_table.present'] "
            "[[0.1, 1e-310], [-1e+300, 0.0], [5.0, 6.0]] 3\n");
}

TEST_F(PolicyFileTest, OtherProgramsMayReorderTensors) {
  Json header = goodHeader();
  header["a"]["data_offsets"] = {4, 12};
  header["b"]["data_offsets"] = {0, 4};
  const float values[] = {7, 1, 2};
  std::string data(sizeof values, '\0');
  std::memcpy(data.data(), values, sizeof values);
  writeFile(path_, fileOf(header.dump(4) + "   ", data));
  EXPECT_EQ(loadPolicy(path_).model.floats(), (std::vector<float>{1, 2, 7}));
}

TEST_F(PolicyFileTest, EveryTruncationIsRefused) {
  savePolicy(path_, maskedModel(), {{"environment", "gridworld"}});
  const std::string whole = readFile(path_);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    EXPECT_THAT(refusal(whole.substr(0, n)), HasSubstr("is not a policy file of pMeta")) << n;
  }
  EXPECT_THAT(refusal(whole + "x"), HasSubstr("there is more in it than its tensors"));
}

TEST_F(PolicyFileTest, AnyFlippedByteIsReadOrRefusedButNeverCrashes) {
  savePolicy(path_, maskedModel(), {{"environment", "gridworld"}});
  const std::string whole = readFile(path_);
  for (std::size_t k = 0; k < whole.size(); ++k) {
    for (const int flip : {1, 0x10, 0x80}) {
      std::string spoilt = whole;
      spoilt[k] = static_cast<char>(spoilt[k] ^ flip);
      const std::string error = refusal(spoilt);
      EXPECT_TRUE(error == "(no error)" || error.find(path_) != std::string::npos) << error;
    }
  }
}

TEST_F(PolicyFileTest, HostileHeadersAreRefusedInOneSentence) {
  ASSERT_EQ(refusal(goodHeader()), "(no error)");
  const std::string huge_length = std::string(8, '\xff') + "{}";
  EXPECT_THAT(refusal(huge_length), HasSubstr("its header is longer than the file"));
  EXPECT_THAT(refusal(fileOf("{", "")), HasSubstr("its header is not a JSON object"));
  EXPECT_THAT(refusal(fileOf("[]", "")), HasSubstr("its header is not a JSON object"));
  EXPECT_THAT(refusal(fileOf(std::string(500000, '['), "")), HasSubstr("is not a JSON object"));
  EXPECT_THAT(refusal(fileOf(std::string(2000000, ' '), "")), HasSubstr("or than 1 MB"));
  EXPECT_THAT(refusal(fileOf("{}", "")), HasSubstr("it has no __metadata__"));
  EXPECT_THAT(refusal(Json{{"__metadata__", {{"layout", 3}}}}), HasSubstr("is no text"));
  EXPECT_THAT(refusal(Json{{"__metadata__", Json::object()}}), HasSubstr("has no layout"));

  const auto with = [](const char* name, const char* key, const Json& value) {
    Json header = goodHeader();
    header[name][key] = value;
    return header;
  };
  const std::uint64_t huge = std::numeric_limits<std::uint64_t>::max();
  const std::vector<std::pair<Json, std::string>> cases = {
      {with("a", "data_offsets", {0, huge}), "'a' lies outside of the file"},
      {with("a", "data_offsets", {8, 0}), "'a' lies outside of the file"},
      {with("a", "data_offsets", {-8, 0}), "'a' are not whole numbers"},
      {with("a", "data_offsets", {0, 8.5}), "'a' are not whole numbers"},
      {with("a", "data_offsets", {0}), "'a' lacks its dtype, shape or data_offsets"},
      {with("a", "shape", "2"), "'a' lacks its dtype, shape or data_offsets"},
      {with("a", "shape", {huge, huge}), "'a' does not fit in the file"},
      {with("a", "shape", {0}), "'a' does not fit in the file"},
      {with("a", "shape", {1}), "shape and offsets of tensor 'a' contradict each other"},
      {with("a", "shape", {1, 2}), "'a' has another type or shape than its layout says"},
      {with("a", "dtype", "F16"), "'a' is of type 'F16', not F32, F64 or U8"},
      {with("b", "data_offsets", {4, 8}), "overlap or leave gaps"},
      {with("__metadata__", "layout", "float32\na 2\n"), "tensors that are not in its layout"},
      {with("__metadata__", "layout", "float32\na 2\nc 1\n"), "tensor 'c' is missing"},
      {with("__metadata__", "layout", "float64\na 2\nb 1\n"), "'a' has another type or shape"},
      {with("__metadata__", "layout", "float32\na 1099511627776\nb 1\n"), "'a' has another type"},
      {with("__metadata__", "layout", "float16\na 2\n"), "must begin with float32 or float64"},
      {with("__metadata__", "layout", ""), "must begin with float32 or float64"}};
  for (const auto& [header, sentence] : cases) {
    EXPECT_THAT(refusal(header), HasSubstr(sentence)) << header;
  }
  Json without = goodHeader();
  without["a"] = 5;
  EXPECT_THAT(refusal(without), HasSubstr("lacks its dtype"));

  EXPECT_THAT(
      refusal(fileOf(goodHeader().dump(), std::string(8, '\0') + std::string("\0\0\x80\x7f", 4))),
      HasSubstr("not finite"));
}

TEST_F(PolicyFileTest, AMaskHoldsZeroesAndOnes) {
  Model model = maskedModel();
  model.present[2] = 2;
  savePolicy(path_, model, {});
  EXPECT_THAT(errorOf([&] { loadPolicy(path_); }), HasSubstr("other numbers than 0 and 1"));
}

TEST_F(PolicyFileTest, MissingFilesAndFoldersAreNamed) {
  EXPECT_EQ(errorOf([&] { loadPolicy(dir_ / "none"); }),
            "the policy file " + (dir_ / "none") + " cannot be read (No such file or directory).");
  EXPECT_THAT(errorOf([&] { loadPolicy(dir_.path()); }), HasSubstr("cannot be read"));
  EXPECT_THAT(errorOf([&] { loadPolicy("/dev/zero"); }), HasSubstr("cannot be read"));
  EXPECT_THAT(errorOf([&] { savePolicy(dir_ / "none/a", floatModel(), {}); }),
              HasSubstr("cannot write"));
}

TEST_F(PolicyFileTest, ARunLeavesItsPoliciesInItsFolder) {
  const Experiment experiment =
      gridExperiment({"results_dir:=" + dir_.path(), "sizes:=[4, 5]", "rounds:=3"});
  RunLog log(experiment);
  const LocalResult result = runLocally(experiment, &log);
  const PolicyFile meta = loadPolicy(log.dir() + "/policies/meta.safetensors");
  EXPECT_TRUE(meta.model == result.meta);
  EXPECT_EQ(meta.metadata.at("policy"), "meta");
  EXPECT_EQ(meta.metadata.count("task"), 0u);
  for (const std::string task : {"0", "1"}) {
    const PolicyFile personal = loadPolicy(log.dir() + "/policies/task_" + task + ".safetensors");
    EXPECT_EQ(personal.metadata.at("environment"), "gridworld");
    EXPECT_EQ(personal.metadata.at("learner"), "q_learning");
    EXPECT_EQ(personal.metadata.at("policy"), "personal");
    EXPECT_EQ(personal.metadata.at("task"), task);
    EXPECT_EQ(personal.metadata.at("round"), "3");
    EXPECT_EQ(personal.metadata.at("run_id"), "run");
    EXPECT_EQ(personal.metadata.at("observation_size"), "2");
    EXPECT_EQ(personal.metadata.at("num_actions"), "4");
    EXPECT_EQ(personal.metadata.at("settings"), experiment.yaml());
    EXPECT_EQ(personal.model.present.size(), 100u) << "the mask of its own cells";
  }
}

TEST_F(PolicyFileTest, SaysWhatItsNumbersAreAndHowLongAStepTakes) {
  const auto grid =
      policyMetadata(gridExperiment({"sizes:=[4, 5]"}), {PolicyKind::kPersonal, 1, 3});
  const Json rows = {{"name", "row"}, {"unit", "cells"}, {"low", 0}, {"high", 4}};
  EXPECT_EQ(Json::parse(grid.at("observation")).at(0), rows);
  EXPECT_EQ(Json::parse(grid.at("action")).at(0).at("high"), 3);
  EXPECT_EQ(Json::parse(grid.at("choices")), (Json{"up", "down", "left", "right"}));
  EXPECT_EQ(grid.count("step_seconds"), 0u) << "a grid knows no time";

  const Experiment cheetahs = Experiment::parse(
      "environment: {name: half_cheetah_dir}\nlearner: sac\nsac: {task_encoding: one_hot}", "test");
  const auto robot = policyMetadata(cheetahs, {PolicyKind::kMeta, -1, 3});
  const Json observation = Json::parse(robot.at("observation"));
  ASSERT_EQ(observation.size(), 20u);
  const Json height = {{"name", "root_z"}, {"unit", "m"}, {"low", nullptr}, {"high", nullptr}};
  EXPECT_EQ(observation.at(0), height);
  const Json motor = {{"name", "bthigh"}, {"unit", ""}, {"low", -1}, {"high", 1}};
  EXPECT_EQ(Json::parse(robot.at("action")).at(0), motor);
  EXPECT_EQ(robot.count("choices"), 0u);
  EXPECT_EQ(robot.at("step_seconds"), "0.05");
  EXPECT_EQ(robot.at("hidden_activation"), "relu");
  EXPECT_EQ(robot.at("output_squashing"), "tanh");
  EXPECT_EQ(robot.at("output_scaling"), "none");
  EXPECT_EQ(grid.at("hidden_activation"), "none");
}

}  // namespace
}  // namespace pmeta
