"""Signals that arrive at any moment: they change no result, and what they stop goes on later."""
import os
import random
import shutil
import signal
import subprocess

import pytest

from faults_test import master, process
from programs import LOCAL, TOP, environment, rows, run

NODES = TOP / "devel/lib/pmeta_nodes"
CART_POLE = TOP / "config/cart_pole.yaml"
QUICK = ["preset:=quick", "hidden:=[64,64]", "updates_per_round:=20", "evaluation_episodes:=1"]
ROBOT = [TOP / "config/half_cheetah_dir.yaml", "preset:=quick", "updates_per_round:=5",
         "sac.warm_up_steps:=20", "environment.horizon:=20", "evaluation_episodes:=1",
         "evaluation_interval:=1"]

# a signal every 2 ms from a program's start to its end, where it says how many came
TICK = """
#define _GNU_SOURCE
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>
static volatile long ticks;
static void count(int signal) { (void)signal; ++ticks; }
__attribute__((constructor)) static void start(void) {
  struct sigaction action = {0};
  struct itimerval every = {{0, 2000}, {0, 2000}};
  action.sa_handler = count;
  action.sa_flags = SA_RESTART;
  sigaction(SIGALRM, &action, 0);
  setitimer(ITIMER_REAL, &every, 0);
}
__attribute__((destructor)) static void tell(void) {
  FILE* file = fopen(getenv("TICKS"), "a");
  fprintf(file, "%s %ld\\n", program_invocation_short_name, ticks);
  fclose(file);
}
"""


@pytest.fixture(scope="module")
def tick(tmp_path_factory):
    """Environment variables of a program that a timer disturbs."""
    if shutil.which("g++") is None:
        pytest.skip("needs a compiler")
    folder = tmp_path_factory.mktemp("tick")
    (folder / "tick.c").write_text(TICK)
    built = run(["g++", "-x", "c", "-shared", "-fPIC", "-o", folder / "tick.so",
                 folder / "tick.c"])
    assert built.returncode == 0, built.stderr
    return {"LD_PRELOAD": str(folder / "tick.so"), "TICKS": str(folder / "ticks")}


def ticks(tick, program):
    """How many signals came to the processes of that name, the fewest first."""
    with open(tick["TICKS"], encoding="utf-8") as file:
        pairs = [line.split() for line in file]
    return sorted(int(number) for name, number in pairs if name == program)


def results_of(results, env):
    """What the commands of pmeta_local leave in that folder, and what they say of a policy."""
    end = ["run_id:=r", "results_dir:=%s" % results]
    for command in (["run", CART_POLE, "rounds:=1"] + QUICK + end,
                    ["run"] + ROBOT + ["rounds:=1"] + end,
                    ["sweep", CART_POLE, "seed:=0-1", "rounds:=1"] + QUICK + end[1:],
                    ["convergence", TOP / "config/convergence.yaml", "rounds:=20", "draws:=1",
                     "pairs:=100", "sweeps:=500"] + end):
        done = run([LOCAL] + command, env=env)
        assert done.returncode == 0, done.stderr
    policy = results / "cart_pole/r/policies/meta.safetensors"
    evaluated = run([LOCAL, "evaluate", policy], env=env)
    assert evaluated.returncode == 0, evaluated.stderr
    written = {path.relative_to(results): rows(path.parent)
               for path in results.glob("**/rounds.csv")}
    written.update((path.relative_to(results), path.read_text())
                   for path in results.glob("convergence/r/*.csv"))
    return evaluated.stdout, written


def test_a_timer_changes_no_result_of_pmeta_local(tmp_path, tick):
    calm = results_of(tmp_path / "calm", os.environ)
    assert len(calm[1]) == 4 + 6
    assert results_of(tmp_path / "ticked", dict(os.environ, **tick)) == calm
    found = ticks(tick, "pmeta_local")
    assert len(found) == 5 and found[0] > 10, found


def test_a_timer_changes_no_result_over_ros(tmp_path, tick):
    settings = QUICK + ["rounds:=3", "results_dir:=%s" % tmp_path]
    local = run([LOCAL, "run", CART_POLE, "run_id:=local"] + settings)
    assert local.returncode == 0, local.stderr
    env = dict(environment(tmp_path), **tick)
    launched = run(["roslaunch", "pmeta_nodes", "cart_pole.launch", "run_id:=ros"] + settings,
                   env=env)
    assert launched.returncode == 0, launched.stdout + launched.stderr
    assert rows(tmp_path / "cart_pole/ros") == rows(tmp_path / "cart_pole/local")
    # none of them ended and came back
    for name, number in (("task_agent", 5), ("meta_aggregator", 1)):
        found = ticks(tick, name)
        assert len(found) == number and found[0] > 10, (name, found)


# tells two nodes the same states: how many of them get the same action, and that it is not always one
ASK = """
import random
import rospy
from std_msgs.msg import Float64MultiArray
rospy.init_node("ask")
actions = {}
questions, answers = [], []
for name in ("calm", "ticked"):
    questions.append(rospy.Publisher("/%s/observation" % name, Float64MultiArray, queue_size=1))
    answers.append(rospy.Subscriber("/%s/action" % name, Float64MultiArray,
                                    lambda msg, name=name: actions.update({name: msg.data})))
while not all(end.get_num_connections() for end in questions + answers):
    rospy.sleep(0.02)
numbers = random.Random(1)
same = []
for _ in range(500):
    actions.clear()
    state = [numbers.gauss(0, 1) for _ in range(4)]
    for question in questions:
        question.publish(data=state)
    while len(actions) < 2:
        rospy.sleep(0.0002)
    if actions["calm"] == actions["ticked"]:
        same.append(actions["calm"][0])
print(len(same), len(set(same)))
"""


def test_a_timer_changes_no_action_of_a_policy(tmp_path, tick):
    done = run([LOCAL, "run", CART_POLE, "rounds:=1", "run_id:=r",
                "results_dir:=%s" % tmp_path] + QUICK)
    assert done.returncode == 0, done.stderr
    env = environment(tmp_path)
    node = [NODES / "policy_node", "_task:=0",
            "_policy:=%s" % (tmp_path / "cart_pole/r/policies/meta.safetensors")]
    port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
    with process(master(port), tmp_path / "master.log", env), \
            process(node + ["__ns:=/calm"], tmp_path / "calm.log", env), \
            process(node + ["__ns:=/ticked"], tmp_path / "ticked.log", dict(env, **tick)) as ticked:
        asked = run(["/usr/bin/python3", "-c", ASK], env=env, timeout=60)
        # rospy may have something to say before, of a master that comes up
        assert asked.stdout.splitlines()[-1:] == ["500 2"], asked.stdout + asked.stderr
        ticked.send_signal(signal.SIGTERM)
        assert ticked.wait(timeout=20) == 0
    assert ticks(tick, "policy_node")[0] > 10


# the signal itself where nothing had begun, or where it came twice
STOPPED = (0, 130, -signal.SIGINT, -signal.SIGTERM)


def disturbed(command, numbers, seconds):
    """Sends a program one signal or two within that time; what it ended with."""
    started = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, universal_newlines=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    said = ""
    for wait in (numbers.uniform(0, seconds), numbers.choice((60, 60, 0.02))):
        sent = numbers.choice((signal.SIGINT, signal.SIGTERM))
        try:
            said = started.communicate(timeout=wait)[1]
            break
        except subprocess.TimeoutExpired:
            started.send_signal(sent)
    else:
        said = started.communicate(timeout=60)[1]
    assert started.returncode in STOPPED, "%d: %s" % (started.returncode, said)
    return started.returncode


def going_on(command, folder):
    """The command that goes on with what that folder holds."""
    if command[0] == "sweep":
        return [LOCAL] + command + ["--resume"]
    if list(folder.glob("r/checkpoint/aggregator.*.h5")):
        return [LOCAL] + command[:2] + ["resume:=%s" % (folder / "r")]
    shutil.rmtree(str(folder), ignore_errors=True)
    return [LOCAL] + command


def stopped_and_resumed(command, folder, times, seed, seconds=0.4):
    """What a command ended with that was begun, stopped and resumed, and at last left alone."""
    numbers = random.Random(seed)
    ends = [disturbed(going_on(command, folder), numbers, seconds) for _ in range(times)]
    if ends[-1] != 0:
        done = run(going_on(command, folder))
        assert done.returncode == 0, done.stderr
    return ends


KINDS = {
    "dqn": ["run", CART_POLE, "run_id:=r", "rounds:=15", "checkpoint.interval:=1"] + QUICK,
    "sac": ["run"] + ROBOT[:1] + ["run_id:=r", "rounds:=15", "checkpoint.interval:=1"] + ROBOT[1:],
    "sweep": ["sweep", CART_POLE, "seed:=0-1", "rounds:=8", "checkpoint.interval:=1"] + QUICK}


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_signal_stopped_at_any_moment_goes_on_to_the_same_result(tmp_path, kind):
    found = []
    for times in (0, 4):
        results = tmp_path / str(times)
        command = KINDS[kind] + ["results_dir:=%s" % results]
        folder = results / ("half_cheetah_dir" if kind == "sac" else "cart_pole")
        ends = stopped_and_resumed(command, folder, times, seed=len(kind)) if times else \
            [run([LOCAL] + command).returncode]
        found.append({path.relative_to(results): rows(path.parent)
                      for path in results.glob("**/rounds.csv")})
    assert any(ends), "no signal came before the end"
    assert found[0] == found[1] and found[0]
