#include "pmeta_core/experiment/machines.h"

#include <gtest/gtest.h>

#include "../support.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta {
namespace {

using test::errorOf;

// of six tasks
Experiment withMachines(const std::string& machines,
                        const std::vector<std::string>& overrides = {}) {
  return Experiment::parse(
      "{run_id: r, environment: {name: gridworld, sizes: [3, 4, 5, 6, 7, 8]}, "
      "machines: " +
          machines + "}",
      "text", overrides);
}

std::string refused(const std::string& machines, const std::vector<std::string>& overrides = {}) {
  return errorOf([&] { withMachines(machines, overrides); });
}

const char kOne[] = "{one: {host: 10.0.0.2, tasks: [0, 5], env_loader: ~/pmeta/devel/env.sh}}";

TEST(Machines, AreReadByNameAndAsOthersWriteThem) {
  const Experiment e = withMachines(
      "{one: {host: 10.0.0.2, user: pi, tasks: [0, 5], env_loader: /opt/pmeta/env.sh}, "
      "two: {host: robot-2.local, tasks: 3, env_loader: ~/ws/devel/env.sh, ssh_port: 2222}}",
      {"machines.two.timeout:=30"});
  const Experiment again = Experiment::parse(e.yaml(), "its settings");
  EXPECT_EQ(again.yaml(), e.yaml());
  ASSERT_EQ(again.settings().machines.size(), 2u);
  const Machine& one = again.settings().machines[0];
  EXPECT_EQ(one.name, "one");
  EXPECT_EQ(one.user, "pi");
  EXPECT_EQ(one.tasks, (std::vector<int>{0, 5}));
  EXPECT_EQ(one.env_loader, "/opt/pmeta/env.sh");
  const Machine& two = again.settings().machines[1];
  EXPECT_EQ(two.host, "robot-2.local");
  EXPECT_EQ(two.tasks, std::vector<int>{3});
  EXPECT_EQ(two.ssh_port, 2222);
  EXPECT_EQ(two.timeout, 30);
  EXPECT_NE(e.describe().find("machines.two.ssh_port"), std::string::npos);
}

TEST(Machines, AreNotOfWhatIsLearnt) {
  const Experiment with = withMachines(kOne);
  const Experiment without = Experiment::parse(
      "{run_id: r, environment: {name: gridworld, sizes: [3, 4, 5, 6, 7, 8]}}", "text");
  EXPECT_EQ(with.definingSettings(), without.definingSettings());
  EXPECT_EQ(with.settingsHash(), without.settingsHash());
  EXPECT_EQ(without.yaml().find("machines"), std::string::npos);
}

TEST(Machines, OfAMethodThatLearnsAllTasksAtOnceAreLeftAside) {
  const std::string text =
      "{algorithm: pearl, environment: {name: sparse_point_robot}, machines: " + std::string(kOne) +
      "}";
  EXPECT_TRUE(Experiment::parse(text, "text").settings().machines.empty());
}

TEST(Machines, WhatIsWrongWithThemIsSaidInASentence) {
  EXPECT_EQ(refused(kOne), "(no error)");
  EXPECT_EQ(
      refused("{one: {host: a, taks: [0], env_loader: /e}}"),
      "unknown setting 'machines.one.taks' (text line 1): did you mean 'machines.one.tasks'?");
  EXPECT_EQ(refused(kOne, {"machines.one.tasks:=[6]"}),
            "machines.one.tasks holds 6 but the experiment has 6 tasks, from 0 to 5.");
  EXPECT_EQ(refused(kOne, {"machines.one.tasks:=[1, 1]"}),
            "machines.one.tasks holds 1 twice: write it once.");
  EXPECT_EQ(refused("{a: {host: h, tasks: [1, 2], env_loader: /e}, b: {host: i, tasks: [0, 2], "
                    "env_loader: /e}}"),
            "task 2 is both among machines.a.tasks and machines.b.tasks: leave it with one.");
  EXPECT_EQ(refused("{one: {host: h, env_loader: /e}}"),
            "machines.one.tasks is empty: write which tasks are learnt there, e.g. tasks: [0, 1].");
  const std::string loader =
      " but must be the path there, from / or ~/ on, of the env.sh of its build, e.g. "
      "~/pmeta/devel/env.sh.";
  EXPECT_EQ(refused("{one: {host: h, tasks: [0]}}"), "machines.one.env_loader is ''" + loader);
  EXPECT_EQ(refused(kOne, {"machines.one.env_loader:=devel/env.sh"}),
            "machines.one.env_loader is 'devel/env.sh'" + loader);
  const std::string host = " but must be the address or name of the machine, e.g. 192.168.1.7.";
  EXPECT_EQ(refused("{one: {tasks: [0], env_loader: /e}}"), "machines.one.host is ''" + host);
  EXPECT_EQ(refused(kOne, {"machines.one.host:=-oProxyCommand=x"}),
            "machines.one.host is '-oProxyCommand=x'" + host);
  EXPECT_EQ(refused(kOne, {"machines.one.user:=a b"}),
            "machines.one.user is 'a b' but must be the name of a user there, or \"\" for the one "
            "that ssh takes.");
  EXPECT_EQ(refused(kOne, {"machines.one.key_file:=keys/k"}),
            "machines.one.key_file is 'keys/k' but must be a path there, from / on, or \"\" for "
            "that of the run.");
  EXPECT_EQ(refused("{my-robot: {host: h}}"),
            "machines has the name 'my-robot' but must have one of letters, digits and _.");
  EXPECT_EQ(refused("[{host: h}]"),
            "machines must hold machines by name, each with its settings below it, e.g. machines: "
            "{robot_1: {host: 192.168.1.7, tasks: [0], env_loader: ~/pmeta/devel/env.sh}}.");
  EXPECT_EQ(refused("{one: {host: h, password: x}}").rfind("unknown setting", 0), 0u);
}

}  // namespace
}  // namespace pmeta
