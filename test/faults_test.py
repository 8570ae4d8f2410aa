"""What happens to a run when things around it die."""
import contextlib
import os
import signal
import subprocess
import time

import pytest

from programs import CONFIG, environment, run

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
    """A program in a group of its own, its output in a file; killed at the end."""
    with open(str(log), "w") as out:
        started = subprocess.Popen([str(word) for word in command], stdout=out,
                                   stderr=subprocess.STDOUT, env=env, preexec_fn=os.setsid)
    try:
        yield started
    finally:
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
