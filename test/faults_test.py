"""What happens to a run when things around it die."""
import contextlib
import json
import os
import re
import signal
import subprocess
import time

import pytest

from programs import CONFIG, LOCAL, TOP, environment, rows, run

SETTINGS = ["rounds:=1000", "pace:=0.05", "run_id:=faults"]


def wait_until(condition, seconds=60):
    """Whether the condition has come true in that time."""
    limit = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > limit:
            return False
        time.sleep(0.1)
    return True


@contextlib.contextmanager
def process(command, log, env):
    """A program in a group of its own, its output in a file; ended at the end.

    A launch that is only killed would leave its nodes behind.
    """
    with open(str(log), "w") as out:
        started = subprocess.Popen([str(word) for word in command], stdout=out,
                                   stderr=subprocess.STDOUT, env=env, preexec_fn=os.setsid)
    try:
        yield started
    finally:
        started.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            started.wait(60)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGKILL)
        started.wait()


def master(port):
    # roscore would leave it behind when killed
    return ["rosmaster", "--core", "-p", port]


@contextlib.contextmanager
def run_without_roslaunch(tmp_path, env):
    """A master, an aggregator and the agents, each started by hand; gives the processes by name."""
    config = tmp_path / "config.yaml"
    prepared = run(["rosrun", "pmeta_nodes", "prepare_run", CONFIG, tmp_path / "agents.launch",
                    "results_dir:=%s" % (tmp_path / "results")] + SETTINGS, env=env)
    assert prepared.returncode == 0, prepared.stderr
    config.write_text(prepared.stdout)
    with contextlib.ExitStack() as stack:
        def start(name, *command):
            return stack.enter_context(process(command, tmp_path / (name + ".log"), env))
        port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
        nodes = {"master": start("master", *master(port))}
        assert wait_until(lambda: run(["rosparam", "list"], env=env).returncode == 0)
        for task in range(5):
            name = "task_agent_%d" % task
            nodes[name] = start(name, "rosrun", "pmeta_nodes", "task_agent", "__ns:=/pmeta",
                                "__name:=" + name, "_task:=%d" % task,
                                "_config_file:=%s" % config)
        nodes["meta_aggregator"] = start("meta_aggregator", "rosrun", "pmeta_nodes",
                                         "meta_aggregator", "__ns:=/pmeta",
                                         "_config_file:=%s" % config)
        yield nodes


def rounds_written(folder):
    file = folder / "rounds.csv"
    return len(file.read_text().splitlines()) // 10 if file.exists() else 0


@pytest.mark.parametrize("node, end", [
    ("task_agent", signal.SIGINT), ("meta_aggregator", signal.SIGTERM),
    ("trajectory_view", signal.SIGTERM), ("policy_node", signal.SIGINT),
    ("run_guard", signal.SIGINT)])
def test_a_node_that_waits_for_a_master_says_so_and_ends_at_once_when_told(tmp_path, node, end):
    env = environment(tmp_path)
    log = tmp_path / "log"
    with process([TOP / "devel/lib/pmeta_nodes" / node], log, env) as waiting:
        assert wait_until(lambda: "waiting for the ROS master" in log.read_text())
        assert env["ROS_MASTER_URI"] in log.read_text()
        os.kill(waiting.pid, end)
        assert waiting.wait(timeout=20) == -end


@pytest.mark.parametrize("restarted", [False, True])
def test_nodes_stop_and_say_so_when_the_master_is_gone(tmp_path, restarted):
    env = environment(tmp_path)
    folder = tmp_path / "results/gridworld/faults"
    with run_without_roslaunch(tmp_path, env) as nodes:
        assert wait_until(lambda: rounds_written(folder) >= 3)
        first = nodes.pop("master")
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
        port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
        with contextlib.ExitStack() as stack:
            if restarted:
                stack.enter_context(process(master(port), tmp_path / "master2.log", env))
            for name, node in nodes.items():
                node.wait(timeout=60)
                said = (tmp_path / (name + ".log")).read_text()
                assert node.returncode == 1, name
                assert ("was restarted and does not know this node" if restarted
                        else "has been out of reach for 10 s") in said, name
                assert "Start the run again with resume:=%s." % folder in said, name
    assert '"status": "stopped"' in (folder / "manifest.json").read_text()


SHORT = ["rounds:=20", "pace:=0.1", "seed:=3"]


def undisturbed(tmp_path):
    """The rows of the same run in one process."""
    done = run([LOCAL, "run", CONFIG, "run_id:=local", "results_dir:=%s" % (tmp_path / "local")] +
               [word for word in SHORT if not word.startswith("pace")])
    assert done.returncode == 0, done.stderr
    return rows(tmp_path / "local/gridworld/local")


def launch(*arguments):
    return ["roslaunch", "pmeta_nodes", "gridworld.launch"] + list(arguments)


def kill_all(env):
    """SIGKILL to everything that belongs to that master, roslaunch first."""
    for name in ("roslaunch", "rosmaster", "task_agent", "meta_aggregator", "run_guard", "rosout"):
        for entry in os.listdir("/proc"):
            with contextlib.suppress(OSError, ValueError):
                with open("/proc/%d/environ" % int(entry), "rb") as file:
                    mine = env["ROS_HOME"].encode() in file.read()
                with open("/proc/%s/cmdline" % entry, "rb") as file:
                    named = name.encode() in file.read()
                if mine and named:
                    os.kill(int(entry), signal.SIGKILL)


def test_a_run_whose_every_process_was_killed_goes_on_with_the_same_result(tmp_path):
    folder = tmp_path / "results/gridworld/cut"
    env = environment(tmp_path)
    with process(launch("run_id:=cut", "results_dir:=%s" % (tmp_path / "results"), *SHORT),
                 tmp_path / "first.log", env):
        assert wait_until(lambda: rounds_written(folder) >= 6)
        kill_all(env)
    assert json.loads((folder / "manifest.json").read_text())["status"] == "running"
    # another settings file, or another setting, is refused before anything starts
    other = run(launch("resume:=%s" % folder, "lambda:=3"), env=environment(tmp_path))
    assert other.returncode == 1
    assert "personal.lambda cannot be changed in a run that goes on" in other.stderr
    other = run(["roslaunch", "pmeta_nodes", "cart_pole.launch", "resume:=%s" % folder],
                env=environment(tmp_path))
    assert other.returncode == 1
    assert "is of experiment 'gridworld'" in other.stderr

    again = run(launch("resume:=%s" % folder, "pace:=0"), env=environment(tmp_path))
    assert rows(folder) == undisturbed(tmp_path), again.stdout
    assert json.loads((folder / "manifest.json").read_text())["status"] == "finished"
    # and a finished one is not begun again
    over = run(launch("resume:=%s" % folder), env=environment(tmp_path))
    assert over.returncode == 1
    assert "finished" in over.stderr


def test_while_checkpoints_cannot_be_written_the_run_is_held_and_says_why(tmp_path):
    folder = tmp_path / "results/gridworld/held"
    env = environment(tmp_path)
    log = tmp_path / "launch.log"
    with process(launch("run_id:=held", "results_dir:=%s" % (tmp_path / "results"), *SHORT),
                 log, env) as launched:
        assert wait_until(lambda: rounds_written(folder) >= 4)
        (folder / "checkpoint").rename(folder / "away")
        (folder / "checkpoint").write_text("in the way")
        assert wait_until(lambda: "The run is held until that is mended" in log.read_text())
        told = run(["rostopic", "echo", "-n", "1", "/pmeta/round"], env=env, timeout=30).stdout
        assert "state: 6" in told and "checkpoint" in told, told
        held = rounds_written(folder)
        time.sleep(3)
        assert rounds_written(folder) <= held + 1, "it goes on"
        (folder / "checkpoint").unlink()
        (folder / "away").rename(folder / "checkpoint")
        launched.wait(timeout=60)
    assert "the results can be written again; the run goes on." in log.read_text()
    assert rows(folder) == undisturbed(tmp_path)


def test_chaos_loses_nothing_and_says_so_in_a_table(tmp_path):
    chaos = TOP / "src/pmeta_nodes/scripts/chaos.py"
    done = run(["/usr/bin/python3", chaos, "gridworld", "--kills", "4", "--seed", "1", "--keep",
                tmp_path / "chaos"], env=environment(tmp_path), timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    names, values = [re.split(r"  +", line) for line in done.stdout.splitlines()[-2:]]
    row = dict(zip(names, values))
    assert row["rounds"] == "20 of 20"
    assert row["result"] == "identical"
    assert row["bytes lost"] == "0"
    kills = [int(word) for word in re.findall(r"\d+", row["kills"])]
    assert sum(kills) == 4
    assert int(row["late"]) > 0 and int(row["corrupted"]) > 0


def test_chaos_names_an_experiment_that_it_does_not_know(tmp_path):
    chaos = TOP / "src/pmeta_nodes/scripts/chaos.py"
    done = run(["/usr/bin/python3", chaos, "ant"], env=environment(tmp_path))
    assert done.returncode == 1
    assert done.stderr == "pmeta: unknown experiment 'ant': chaos knows gridworld, cart_pole.\n"
