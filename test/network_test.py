"""Runs on several machines, which are network namespaces here: who reaches whom, and a bad link."""
import contextlib
import json
import re
import subprocess
import sys
import time

import pytest
import yaml

from faults_test import process, wait_until
from programs import LOCAL, TOP, environment, free_port, rows, run

SCRIPTS = TOP / "src/pmeta_nodes/scripts"
sys.path.insert(0, str(SCRIPTS))
import pmeta_network
from pmeta_network import HERE, THERE

# whoever may have network namespaces has these tests
PROBLEM = pmeta_network.problem()
needs_network = pytest.mark.skipif(bool(PROBLEM), reason=PROBLEM)

HOLD_NETWORK = """
import os, sys
sys.path.insert(0, %r)
import pmeta_network
pmeta_network.enter()
with pmeta_network.Network(0, 0) as network:
    print(os.getpid(), network.there[2], flush=True)
    sys.stdin.read()
""" % str(SCRIPTS)


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """What a command here and there begins with: two machines with a link between."""
    program = tmp_path_factory.mktemp("network") / "hold.py"
    program.write_text(HOLD_NETWORK)
    keeper = subprocess.Popen([sys.executable, str(program)], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, universal_newlines=True)
    pids = keeper.stdout.readline().split()
    yield [["nsenter", "--target", pid, "--user", "--preserve-credentials", "--net"] for pid in pids]
    keeper.stdin.close()
    keeper.wait(30)


def on(address, env):
    return dict(env, ROS_IP=address, ROSLAUNCH_SSH_UNKNOWN="1",
                ROS_MASTER_URI="http://%s:%s" % (HERE, env["ROS_MASTER_URI"].rsplit(":", 1)[1]))


@contextlib.contextmanager
def firewall(machine, rule):
    """A machine that drops connections from the other one which fit a rule."""
    done = run(machine + ["nft", "add table inet wall; add chain inet wall input { type filter hook input "
                          "priority 1; }; add rule inet wall input iifname != lo ct state new %s drop" % rule])
    assert done.returncode == 0, done.stderr
    try:
        yield
    finally:
        run(machine + ["nft", "delete table inet wall"])


@contextlib.contextmanager
def ssh_server(machine, tmp_path, env):
    """Its port there; both keys are thrown away."""
    import paramiko
    port = free_port()
    (tmp_path / ".ssh").mkdir()
    keys = [tmp_path / "host_key", tmp_path / ".ssh/id_rsa"]
    for key in keys:
        paramiko.RSAKey.generate(2048).write_private_key_file(str(key))
    log = tmp_path / "ssh.log"
    with process(machine + [sys.executable, TOP / "test/ssh_server.py", THERE, port] + keys, log, env):
        assert wait_until(lambda: "listening" in log.read_text()), log.read_text()
        yield port


def lab(tmp_path, host, port):
    """The settings file of the documents' example, with a machine that there is."""
    page = (TOP / "docs/ros.md").read_text()
    text = re.search(r"^```yaml\n(# lab.yaml\n.*?)^```", page, re.M | re.S)[1]
    for old, new in (("192.168.1.21", host), ("~/pmeta/devel/env.sh", str(TOP / "devel/env.sh")),
                     ("/home/robot/.ros/pmeta", str(tmp_path / "far")),
                     ("user: robot", "user: robot\n    ssh_port: %d" % port)):
        assert old in text
        text = text.replace(old, new)
    config = tmp_path / "lab.yaml"
    config.write_text(text)
    return config


@needs_network
def test_agents_learn_on_the_machines_that_the_settings_name(network, tmp_path):
    here, there = network
    env = on(HERE, environment(tmp_path))
    with ssh_server(there, tmp_path, env) as port:
        config = lab(tmp_path, THERE, port)
        local = run([LOCAL, "run", config, "run_id:=r", "results_dir:=%s" % (tmp_path / "local")])
        assert local.returncode == 0, local.stderr
        launch = here + [TOP / "pmeta", "run", config, "run_id:=r",
                         "results_dir:=%s" % (tmp_path / "ros")]
        done = run(launch, env=env, timeout=240)
        assert done.returncode == 0, done.stdout + done.stderr
        assert rows(tmp_path / "ros/lab/r") == rows(tmp_path / "local/lab/r")
        hashes = {json.loads((tmp_path / where / "lab/r/manifest.json").read_text())["settings_hash"]
                  for where in ("ros", "local")}
        assert len(hashes) == 1
        # each party keeps what is its own where it learns
        kept = {folder: {path.name for path in (tmp_path / folder / "lab/r/policies").iterdir()}
                for folder in ("far", "ros")}
        assert {"task_0.safetensors", "task_2.safetensors"} <= kept["far"]
        assert "task_1.safetensors" in kept["ros"] and "task_0.safetensors" not in kept["ros"]

        # what keeps them from it is said before anything starts
        launch = here + ["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % config,
                         "results_dir:=%s" % tmp_path]
        ports = "tcp dport != %d ct state new" % port
        for wall, machine, sentence in (
                (there, "there", "machine left_robot (%s) gives out the address %s, where nodes here do not reach it"
                 % (THERE, THERE)),
                (here, "here", "machine left_robot (%s): %s, which launches the run, cannot be reached from there"
                 % (THERE, HERE))):
            with firewall(wall, ports):
                refused = run(launch, env=env)
            assert refused.returncode == 1 and sentence in refused.stderr, (machine, refused.stderr)
            assert "a firewall" in refused.stderr and "ROS_IP" in refused.stderr
        wrong = run(launch + ["machines.left_robot.env_loader:=/nowhere/env.sh"], env=env)
        assert "pmeta: machine left_robot (%s): env: '/nowhere/env.sh'" % THERE in wrong.stderr.replace(
            "‘", "'").replace("’", "'")
        keyless = run(launch + ["machines.left_robot.key_file:=/nowhere/key",
                                "key_file:=%s" % a_key(tmp_path)], env=env)
        assert "machine left_robot (%s): " % THERE in keyless.stderr and "/nowhere/key" in keyless.stderr
        assert "started with pid" not in refused.stdout + wrong.stdout + keyless.stdout


def a_key(tmp_path):
    run([LOCAL, "key", tmp_path / "key"])
    return tmp_path / "key"


@needs_network
@pytest.mark.parametrize("host", ["10.77.0.9", THERE])
def test_a_machine_that_is_off_or_has_no_ssh_is_named_within_ten_seconds(network, tmp_path, host):
    config = lab(tmp_path, host, 22)
    env = on(HERE, environment(tmp_path))
    begin = time.monotonic()
    refused = run(network[0] + ["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % config],
                  env=env)
    assert time.monotonic() - begin < 10 + 3  # roslaunch itself takes a while to start
    assert refused.returncode == 1
    assert "pmeta: machine left_robot (%s) cannot be logged in to: " % host in refused.stderr
    # and one that nobody could reach back from
    alone = run(network[0] + ["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % config],
                env=dict(env, ROS_IP="127.0.0.1"))
    assert ("pmeta: machines.left_robot is another machine, but nodes here give out 127.0.0.1, where no other "
            "machine reaches them: type 'export ROS_IP=%s' and launch again" % HERE) in alone.stderr


@needs_network
def test_an_agent_that_cannot_take_part_says_why_at_once(network, tmp_path):
    here, there = network
    env = environment(tmp_path)
    launched_there = there + ["roslaunch", "pmeta_nodes", "agent.launch", "task:=0"]
    looked_at = there + [SCRIPTS / "check_agent.py", "--namespace", "pmeta"]

    def refused(sentence, look=looked_at, **given):
        begin = time.monotonic()
        done = run(look, env=dict(on(THERE, env), **given))
        assert done.returncode == 1 and time.monotonic() - begin < 15
        assert "pmeta: " + sentence in done.stderr, done.stderr
        assert "started with pid" not in done.stdout

    master = on(HERE, env)["ROS_MASTER_URI"]
    refused("there is no answer from the ROS master at %s: launch the run there after 'export ROS_IP=%s'"
            % (master, HERE), launched_there)
    refused("there is no answer from the ROS master at http://localhost:11311: that is this machine; "
            "type 'export ROS_MASTER_URI=http://ADDRESS:11311'", ROS_MASTER_URI="http://localhost:11311")
    launch = here + ["roslaunch", "-p", master.rsplit(":", 1)[1], "pmeta_nodes", "gridworld.launch",
                     "agents:=false", "results_dir:=%s" % tmp_path]
    log = tmp_path / "launch.log"
    for address in ("", HERE):
        with process(launch + ["run_id:=r" + address], log, on(address, env)):
            assert wait_until(lambda: "10" in run(
                here + ["timeout", "5", "rostopic", "echo", "-n1", "/pmeta/round/rounds"],
                env=on(address, env)).stdout), log.read_text()
            if address != HERE:
                refused("the run on %s gives out the address 127.0.0.1, where only that machine reaches "
                        "it: launch it again there after 'export ROS_IP=%s'." % (HERE, HERE))
            else:
                refused("nodes here give out 127.0.0.1, where %s does not reach them: type 'export "
                        "ROS_IP=%s' and launch again." % (HERE, THERE), ROS_IP="127.0.0.1")
                with firewall(there, ""):
                    refused("%s cannot connect to nodes here, which give out the address %s"
                            % (HERE, THERE))
                with firewall(here, "tcp dport != %s" % master.rsplit(":", 1)[1]):
                    refused("the run's aggregator does not answer at http://%s:" % HERE)


@needs_network
def test_a_slow_link_that_loses_packets_and_goes_down_changes_nothing(tmp_path):
    kept = tmp_path / "kept"
    done = run([SCRIPTS / "chaos.py", "gridworld", "--netns", "--rounds", "8", "--downs", "1",
                "--down-seconds", "5", "--keep", kept], env=environment(tmp_path), timeout=300)
    logs = "\n".join(path.read_text() for path in kept.glob("*/*.log"))
    assert done.returncode == 0, done.stdout + done.stderr + logs
    assert "8 of 8" in done.stdout and "identical" in done.stdout and "finished" in done.stdout
    policies = (kept / "gridworld/disturbed/gridworld/chaos/policies").iterdir()
    assert len([path for path in policies if path.name.startswith("task_")]) == 8


def test_nodes_that_no_other_machine_reaches_are_told_of_where_agents_run_elsewhere(tmp_path):
    env = environment(tmp_path)
    del env["ROS_IP"]
    port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
    command = ["roslaunch", "--dump-params", "pmeta_nodes", "gridworld.launch"]
    sentence = "pmeta: warning: agents:=false, but nodes here give out 127.0.0.1, where no other machine"
    said = run(command + ["agents:=false"], env=env)
    assert said.returncode == 0 and sentence in said.stderr
    advice = re.search(r"type 'export ROS_IP=(\S+)' and launch again.*"
                       r"takes 'export ROS_MASTER_URI=http://(\S+):(\d+)'", said.stderr)
    if advice:  # there is no other address where there is no network
        assert advice[1] == advice[2] and advice[3] == port
    else:
        assert "connect this machine to a network" in said.stderr
    assert sentence not in run(command, env=env).stderr
    assert sentence not in run(command + ["agents:=false"], env=dict(env, ROS_IP=HERE)).stderr


def test_a_machine_with_another_version_or_settings_is_refused_by_name(tmp_path):
    env = environment(tmp_path)
    compare = TOP / "devel/lib/pmeta_nodes/compare_run"
    dumped = run(["roslaunch", "--dump-params", "pmeta_nodes", "gridworld.launch",
                  "results_dir:=%s" % tmp_path], env=env).stdout
    parameters = yaml.safe_load(dumped)
    origin = json.loads(parameters["/pmeta/origin"])
    settings = parameters["/pmeta/config"]

    def compared(**changed):
        return run([compare], env=env, input=json.dumps(dict(origin, **changed)) + "\n" + settings)

    same = compared()
    assert same.returncode == 0 and same.stderr == ""
    assert compared(commit="abc").stderr.startswith("pmeta: warning: ")
    other = compared(versions=dict(origin["versions"], pmeta="9.9.9"), host="desk")
    assert other.returncode == 1
    assert "but the run was launched on 'desk' with '9.9.9': install the same version" in other.stderr
    defining = dict(origin["defining_settings"], **{"personal.lambda": "77"})
    assert "makes personal.lambda " in compared(defining_settings=defining).stderr
