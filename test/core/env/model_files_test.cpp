#include "pmeta_core/env/model_files.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "../support.h"
#include "pmeta_core/base/hash.h"

namespace pmeta {
namespace {

namespace fs = std::filesystem;
using test::errorOf;
using test::readFile;
using test::TempDir;
using test::writeFile;
using Names = std::vector<std::string>;

TEST(ModelFiles, OneAloneHasTheHashOfItsBytes) {
  const TempDir dir;
  writeFile(dir / "a.xml", "<mujoco/>");
  writeFile(dir / "unnamed.xml", "<mujoco/>");
  const ModelFiles files = ModelFiles::find(dir / "a.xml");
  EXPECT_EQ(files.folder, dir.path());
  EXPECT_EQ(files.names, Names{"a.xml"});
  EXPECT_EQ(files.hash, hashText("<mujoco/>"));
}

class ModelOfManyFiles : public ::testing::Test {
 protected:
  ModelOfManyFiles() {
    for (const char* name : {"robots/parts", "meshes", "robots/pictures"}) {
      fs::create_directories(dir_ / name);
    }
    writeFile(main_, R"(<mujoco><compiler meshdir="../meshes" texturedir="pictures"/>
      <!-- <include file="commented.xml"/> -->
      <include file="parts/arm.xml"/><asset><texture fileright="right.png"/></asset></mujoco>)");
    writeFile(dir_ / "robots/commented.xml", "<mujoco/>");
    // what an included file names is looked for from the first one's folder
    writeFile(dir_ / "robots/parts/arm.xml", R"(<mujoco><asset><mesh file="arm.stl"/></asset>
      <include file="parts/arm.xml"/></mujoco>)");
    writeFile(dir_ / "meshes/arm.stl", "mesh");
    writeFile(dir_ / "robots/pictures/right.png", "picture");
  }

  const TempDir dir_;
  const std::string main_ = dir_ / "robots/robot.xml";
};

TEST_F(ModelOfManyFiles, AllThatIsNamedBelongsToIt) {
  const ModelFiles files = ModelFiles::find(main_);
  EXPECT_EQ(files.folder, dir_.path());
  EXPECT_EQ(files.names, (Names{"robots/robot.xml", "meshes/arm.stl", "robots/parts/arm.xml",
                                "robots/pictures/right.png"}));
  for (const std::string& name : files.names) {
    const std::string before = readFile(dir_ / name);
    writeFile(dir_ / name, before + " ");
    EXPECT_NE(ModelFiles::find(main_).hash, files.hash) << name;
    writeFile(dir_ / name, before);
  }
  EXPECT_EQ(ModelFiles::find(main_).hash, files.hash);
}

TEST_F(ModelOfManyFiles, ACopyIsTheSameModel) {
  const ModelFiles files = ModelFiles::find(main_);
  const TempDir other;
  files.copyTo(other / "models");
  const ModelFiles copy = ModelFiles::find(other / "models/robots/robot.xml");
  EXPECT_EQ(copy.folder, other / "models");
  EXPECT_EQ(copy.names, files.names);
  EXPECT_EQ(copy.hash, files.hash);

  writeFile(dir_ / "meshes/arm.stl", "another mesh");
  const TempDir late;
  EXPECT_NE(errorOf([&] { files.copyTo(late / "models"); }).find("has changed since it was read"),
            std::string::npos);
}

TEST(ModelFiles, MeshesOfAUrdfAreWhereMujocoLooks) {
  const TempDir dir;
  for (const char* name : {"meshes", "parts"}) fs::create_directories(dir / name);
  const std::string text = R"(<robot name="arm"><mujoco><compiler meshdir="parts"/></mujoco>
    <link name="a"><visual><geometry><mesh filename="package://arm/meshes/a.stl"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/b.stl"/></geometry></collision></link></robot>)";
  writeFile(dir / "arm.urdf", text);
  for (const char* name : {"parts/a.stl", "parts/b.stl", "parts/c.stl"})
    writeFile(dir / name, "mesh");
  EXPECT_EQ(ModelFiles::find(dir / "arm.urdf").names,
            (Names{"arm.urdf", "parts/a.stl", "parts/b.stl"}));
}

TEST(ModelFiles, WhatCannotBeCopiedIsRefused) {
  const TempDir dir;
  writeFile(dir / "a.xml", R"(<mujoco><asset><mesh file="/meshes/arm.stl"/></asset></mujoco>)");
  EXPECT_EQ(errorOf([&] { ModelFiles::find(dir / "a.xml"); }),
            "the model file " + (dir / "a.xml") +
                " names /meshes/arm.stl with its full path: name it from the model's folder, so "
                "that a run can keep a copy of both.");
  EXPECT_NE(errorOf([&] { ModelFiles::find(dir / "none.xml"); }).find("cannot be read"),
            std::string::npos);
}

}  // namespace
}  // namespace pmeta
