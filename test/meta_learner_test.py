"""Methods that learn all tasks in one process: over ROS as in one process, whatever becomes of it."""
import csv
import os
import signal

import pytest

from faults_test import process, wait_until
from programs import LOCAL, TOP, environment, run

CONFIG = TOP / "config/sparse_point_robot.yaml"
SMALL = ["train_tasks:=2", "test_tasks:=1", "rounds:=3", "evaluation_interval:=1",
         "checkpoint.interval:=1"]
METHODS = {
    "pooled_sac": ["steps_per_round:=500", "pooled_sac.hidden:=[8]", "pooled_sac.warm_up_steps:=60",
                   "pooled_sac.updates_per_iteration:=10"],
    "promp": ["steps_per_round:=500", "promp.hidden:=[8]", "promp.episodes:=4"],
    "maml_trpo": ["steps_per_round:=500", "maml_trpo.hidden:=[8]", "maml_trpo.episodes:=4"],
    "rl2": ["steps_per_round:=500", "rl2.hidden:=8", "rl2.head:=[8]", "rl2.trials:=8"],
    "pearl": ["steps_per_round:=700", "pearl.hidden:=[8]", "pearl.context_hidden:=[8]",
              "pearl.warm_up_steps:=100", "pearl.prior_steps:=40", "pearl.posterior_steps:=40",
              "pearl.updates_per_iteration:=10"],
    "metacure": ["steps_per_round:=700", "metacure.hidden:=[8]", "metacure.recurrent_units:=8",
                 "metacure.warm_up_steps:=100", "metacure.prior_steps:=40",
                 "metacure.posterior_steps:=40", "metacure.tasks_per_iteration:=3",
                 "metacure.updates_per_iteration:=10"],
}


# which have no place for a test task
TOLD = {"pooled_sac"}


def rows_of(results_dir, run_id):
    with open(results_dir / "sparse_point_robot" / run_id / "rounds.csv", newline="") as file:
        return [{key: value for key, value in row.items() if key != "wall_s"}
                for row in csv.DictReader(file)]


def words_of(method, tmp_path, run_id):
    return SMALL + METHODS[method] + ["algorithm:=" + method, "run_id:=" + run_id,
                                      "results_dir:=%s" % tmp_path]


def policy_of(results_dir, run_id):
    path = results_dir / "sparse_point_robot" / run_id / "policies/meta.safetensors"
    data = path.read_bytes()
    return data[8 + int.from_bytes(data[:8], "little"):]  # behind the header, which names the run


@pytest.mark.parametrize("method", METHODS)
def test_a_run_over_ros_is_the_one_in_one_process(method, tmp_path):
    local = run([LOCAL, "run", CONFIG] + words_of(method, tmp_path, "local"))
    assert local.returncode == 0, local.stderr
    expected = rows_of(tmp_path, "local")
    tasks = 2 if method in TOLD else 3
    assert len(expected) == 3 * tasks * len({row["context_episodes"] for row in expected})
    assert {row["policy"] for row in expected} == {"meta"}
    policy = tmp_path / "sparse_point_robot/local/policies/meta.safetensors"
    evaluated = run([LOCAL, "evaluate", policy, "--episodes", "2"])
    assert evaluated.returncode == 0 and evaluated.stdout.count("\ntask ") == tasks, evaluated.stderr

    settings = " ".join(word.replace(":=", "=", 1) for word in SMALL + METHODS[method])
    launch = ["roslaunch", "pmeta_nodes", "sparse_point_robot.launch", "algorithm:=" + method,
              "run_id:=ros", "results_dir:=%s" % tmp_path, "settings:=" + settings]
    env = environment(tmp_path)
    with process(launch, tmp_path / "launch.log", env):
        manifest = tmp_path / "sparse_point_robot/ros/manifest.json"
        assert wait_until(lambda: manifest.exists() and '"finished"' in manifest.read_text(), 60), \
            (tmp_path / "launch.log").read_text()
    assert rows_of(tmp_path, "ros") == expected
    assert policy_of(tmp_path, "ros") == policy_of(tmp_path, "local")


def test_a_meta_learner_that_is_killed_goes_on_as_if_it_had_not_been(tmp_path):
    local = run([LOCAL, "run", CONFIG] + words_of("promp", tmp_path, "local") + ["rounds:=12"])
    assert local.returncode == 0, local.stderr
    settings = " ".join(word.replace(":=", "=", 1) for word in SMALL + METHODS["promp"])
    launch = ["roslaunch", "pmeta_nodes", "sparse_point_robot.launch", "algorithm:=promp",
              "run_id:=ros", "results_dir:=%s" % tmp_path, "pace:=0.5",
              "settings:=" + settings + " rounds=12"]
    env = environment(tmp_path)
    folder = tmp_path / "sparse_point_robot/ros"
    with process(launch, tmp_path / "launch.log", env):
        assert wait_until(lambda: list(folder.glob("checkpoint/task_0.round_*")), 60), \
            (tmp_path / "launch.log").read_text()
        found = run(["rosnode", "info", "/pmeta/meta_learner"], env=env, timeout=30)
        pid = [line for line in found.stdout.splitlines() if line.startswith("Pid:")]
        os.kill(int(pid[0].split()[1]), signal.SIGKILL)
        manifest = folder / "manifest.json"
        assert wait_until(lambda: '"finished"' in manifest.read_text(), 60), \
            (tmp_path / "launch.log").read_text()
    assert rows_of(tmp_path, "ros") == rows_of(tmp_path, "local")
    assert policy_of(tmp_path, "ros") == policy_of(tmp_path, "local")


@pytest.mark.parametrize("node, algorithm, sentence", [
    ("task_agent", "promp", "has no agents: all tasks are learnt by the node meta_learner"),
    ("meta_learner", "pmeta", "has no meta-learner: each task is learnt by a node task_agent")])
def test_a_node_of_the_wrong_kind_says_so(node, algorithm, sentence, tmp_path):
    config = tmp_path / "settings.yaml"
    written = run([LOCAL, "run", CONFIG] + words_of("promp", tmp_path, "r") + ["rounds:=1"])
    assert written.returncode == 0, written.stderr
    text = (tmp_path / "sparse_point_robot/r/config.yaml").read_text()
    if algorithm != "promp":
        text = CONFIG.read_text()
    config.write_text(text)
    env = environment(tmp_path)
    with process(["roscore", "-p", env["ROS_MASTER_URI"].rsplit(":", 1)[1]],
                 tmp_path / "core.log", env):
        assert wait_until(lambda: run(["rosparam", "list"], env=env).returncode == 0, 30)
        failed = run(["rosrun", "pmeta_nodes", node, "_config_file:=%s" % config, "_task:=0"],
                     env=env, timeout=60)
    assert failed.returncode == 1 and sentence in failed.stderr + failed.stdout
