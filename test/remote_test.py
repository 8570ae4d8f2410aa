"""A robot behind services: the server class of Python, what describes servers, and runs on them."""
import os
import signal
import subprocess
import sys
import time

import pytest
import yaml

from programs import LOCAL, TOP, environment, run

CONFIG = TOP / "examples/remote/cart_pole.yaml"


def wait_for(condition, seconds=90):
    limit = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < limit, "it did not come to that in time"
        time.sleep(0.1)


@pytest.fixture
def server():
    sys.path[:0] = [str(TOP / "devel/lib/python3/dist-packages"),
                    str(TOP / "src/pmeta_nodes/python")]
    from pmeta_nodes.env_server import EnvServer
    done = []

    def reset(seed):
        done.append("reset")
        return [seed]

    def act(action):
        if action[0] > 0.9:
            raise RuntimeError("the wheel is jammed")
        done.append("step")
        return [len(done)], -1, False, len(done) == 5
    made = EnvServer({"x": ("m", -1, 1)}, {"speed": ("m/s", -1, 1)}, reset, act)
    made.done = done
    yield made
    del sys.path[:2]


def asked(server, session, episode, step=None, action=(0.5,), seed=7):
    from pmeta_msgs.srv import ResetEnvRequest, StepEnvRequest
    if step is None:
        return server.reset(ResetEnvRequest(session, episode, seed))
    return server.step(StepEnvRequest(session, episode, step, action))


def test_what_is_asked_for_again_is_done_once(server):
    assert list(asked(server, 1, 1).observation) == [7]
    assert list(asked(server, 1, 1).observation) == [7]
    assert [asked(server, 1, 1, 1).observation for _ in range(3)] == [[2]] * 3
    asked(server, 1, 1, 2)
    assert server.done == ["reset", "step", "step"]
    for step in (1, 4):
        assert asked(server, 1, 1, step).error == "step %d cannot be made after step 2." % step
    assert asked(server, 1, 2).error == ""
    assert asked(server, 1, 1).error == "episode 1 is over: episode 2 has begun."
    assert asked(server, 2, 1).error == "", "an agent that was started again takes over"
    assert asked(server, 1, 2, 1).error.startswith("there is no such episode")


def test_what_is_raised_or_out_of_limits_is_the_answer(server):
    asked(server, 1, 1)
    assert asked(server, 1, 1, 1, [2]).error == "speed of an action is 2.000000, which is out of its limits."
    assert asked(server, 1, 1, 1, [float("nan")]).error
    assert asked(server, 1, 1, 1, []).error == "an action of 0 numbers is not one of 1."
    assert asked(server, 1, 1, 1, [1]).error == "RuntimeError: the wheel is jammed"
    assert asked(server, 1, 1, 2).error == "step 2 cannot be made after step 1, which ended the episode."


class Processes:
    """Programs of ROS on a master of their own."""

    def __init__(self, folder):
        self.folder = folder
        self.env = environment(folder)
        self.run = folder / "remote_cart_pole/run"
        self.started = []

    def start(self, *words, **variables):
        log = self.folder / ("output_%d.txt" % len(self.started))
        with open(str(log), "w") as out:
            process = subprocess.Popen([str(word) for word in words], env=dict(self.env, **variables),
                                       stdout=out, stderr=subprocess.STDOUT, preexec_fn=os.setsid)
        self.started.append(process)
        return process, log

    def launch(self, *assignments):
        return self.start("roslaunch", "--skip-log-check", "pmeta_nodes", "experiment.launch",
                          "config:=%s" % CONFIG, "results_dir:=%s" % self.folder, *assignments)

    def status(self):
        manifest = self.run / "manifest.json"
        return yaml.safe_load(manifest.read_text())["status"] if manifest.exists() else None

    def servers(self):
        for task, force in enumerate((10, 5)):
            self.start(TOP / "examples/remote/cart_pole_server.py", force, ROS_NAMESPACE="/cart_pole_%d" % task)


@pytest.fixture
def processes(tmp_path):
    made = Processes(tmp_path)
    yield made
    for process in reversed(made.started):
        if process.poll() is not None:
            continue
        # what is launched ends its nodes, which are in groups of their own
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def test_a_run_on_servers_in_python_goes_on_where_it_was_stopped(processes):
    processes.start("roscore", "-p", processes.env["ROS_MASTER_URI"].rsplit(":", 1)[1])
    processes.servers()
    told = []

    def describes():
        told.append(run([TOP / "src/pmeta_nodes/scripts/describe_env.py", "/cart_pole_0", "/cart_pole_1"],
                        env=processes.env))
        return told[-1].returncode == 0
    wait_for(describes)
    section = yaml.safe_load(told[-1].stdout)["environment"]
    assert section == yaml.safe_load(CONFIG.read_text())["environment"]

    settings = "settings:=updates_per_round=30 evaluation_interval=3 checkpoint.interval=1"
    launched, log = processes.launch(settings, "run_id:=run", "rounds:=9", "pace:=0.5")
    wait_for(lambda: list(processes.run.glob("checkpoint/aggregator*")))
    os.killpg(launched.pid, signal.SIGINT)
    launched.wait(60)
    assert processes.status() == "stopped", log.read_text()
    launched, log = processes.launch("resume:=%s" % processes.run, "pace:=0")
    assert launched.wait(100) == 0
    assert processes.status() == "finished", log.read_text()
    for task in range(2):
        assert ("cart_pole_%d begins a new episode: the one it was in cannot be restored." % task
                in log.read_text())


def test_a_run_that_waits_for_a_robot_says_so_and_can_be_stopped(processes):
    launched, log = processes.launch("run_id:=run")
    wait_for(lambda: "waiting for the services of /cart_pole_0" in log.read_text())
    os.killpg(launched.pid, signal.SIGINT)
    launched.wait(60)
    assert processes.status() == "stopped", log.read_text()
    assert "FATAL" not in log.read_text() and "escalating" not in log.read_text()


def test_without_ros_it_is_said_that_it_is_needed():
    listed = run([LOCAL, "settings", CONFIG])
    assert "environment.observations.angle.limits" in listed.stdout
    refused = run([LOCAL, "run", CONFIG])
    assert refused.returncode == 1
    assert refused.stderr == ("pmeta: environment.name is remote, whose robots are reached over ROS: "
                              "use ./pmeta run or roslaunch.\n")
