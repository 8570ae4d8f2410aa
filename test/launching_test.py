"""Tests of launches: which words they take, what they check before anything starts, what they leave."""

import csv
import json
import pathlib
import shlex
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "src/pmeta_nodes/scripts"))
import pmeta_bags
import pmeta_returns
import pmeta_runs

from programs import CONFIG, TOP, environment, run


def test_launching_with_bad_settings_starts_nothing(tmp_path):
    result = run(["roslaunch", "pmeta_nodes", "gridworld.launch", "lambda:=-1"],
                 env=environment(tmp_path))
    assert result.returncode == 1
    assert ("pmeta: personal.lambda is '-1' (given as lambda:=-1) but must be a number, at least 0."
            in result.stderr)
    assert "started with pid" not in result.stdout


def test_nodes_of_a_plain_roslaunch_are_reached_from_this_machine_only(tmp_path):
    env = environment(tmp_path)
    del env["ROS_IP"]
    addresses = {}
    for name, value in (("", ""), ("ROS_IP", "10.1.2.3"), ("ROS_HOSTNAME", "robot")):
        given = dict(env, **{name: value}) if name else env
        command = run(["roslaunch", "--args", "/pmeta/task_agent_0", "pmeta_nodes",
                       "gridworld.launch"], env=given)
        assert command.returncode == 0, command.stderr
        addresses[name] = 'ROS_IP="127.0.0.1"' in command.stdout
    assert addresses == {"": True, "ROS_IP": False, "ROS_HOSTNAME": False}


def test_launching_takes_any_setting(tmp_path):
    env = environment(tmp_path)
    result = run(["roslaunch", "pmeta_nodes", "gridworld.launch", "settings:=betta=1"], env=env)
    assert result.returncode == 1
    assert "unknown setting 'betta'" in result.stderr
    result = run(["roslaunch", "--dump-params", "pmeta_nodes", "gridworld.launch",
                  "settings:=slip=0.1 sizes=[3,4]", "seed:=5"], env=env)
    settings = yaml.safe_load(result.stdout)["/pmeta/config"]
    assert "slip: [0.1]" in settings
    assert "sizes: [3, 4]" in settings
    assert "seed: 5" in settings


def test_launching_takes_and_checks_what_no_argument_declares(tmp_path):
    env = environment(tmp_path)
    command = ["roslaunch", "--dump-params", "pmeta_nodes", "gridworld.launch"]
    result = run(command + ["lamda:=5", "slip:=0.3"], env=env)
    assert "/pmeta/config" not in result.stdout
    assert ("pmeta: unknown setting 'lamda' (given as lamda:=5): did you mean 'personal.lambda'?"
            in result.stderr)
    result = run(command + ["sizes:=[4, 5, 6]", "slip:=0.3", "speed:=2"], env=env)
    settings = yaml.safe_load(yaml.safe_load(result.stdout)["/pmeta/config"])
    assert settings["environment"]["sizes"] == [4, 5, 6]
    assert settings["environment"]["slip"] == [0.3]


ODD = "it's $x \\ & <é> \"q\" 日本 (a) %20"


def test_odd_characters_pass_through_a_launch_file(tmp_path):
    home = tmp_path / ODD
    home.mkdir()
    env = environment(tmp_path)
    env["ROS_HOME"] = str(home / "ros")
    launch = ["pmeta_nodes", "half_cheetah_dir.launch", "results_dir:=%s" % home, "run_id:=odd",
              "settings:=preset=quick  environment.model_file='%s'"
              % (TOP / "config/models/half_cheetah.xml"), "record:=true"]
    result = run(["roslaunch", "--dump-params"] + launch, env=env)
    assert result.returncode == 0, result.stderr
    settings = yaml.safe_load(yaml.safe_load(result.stdout)["/pmeta/config"])
    assert settings["results_dir"] == str(home) and settings["run_id"] == "odd"
    assert settings["preset"] == "quick"
    recorder = run(["roslaunch", "--args", "/pmeta/recorder"] + launch, env=env)
    assert recorder.returncode == 0, recorder.stderr
    assert str(home / "half_cheetah_dir/odd.bag") in recorder.stdout


@pytest.fixture(scope="module")
def launch_arguments():
    """Of experiment.launch: names and defaults."""
    root = ElementTree.parse(str(TOP / "launch/experiment.launch")).getroot()
    return {arg.get("name"): arg.get("default") for arg in root.findall("arg")
            if "value" not in arg.attrib}


def check_launch(*words):
    return run([TOP / "devel/lib/pmeta_nodes/prepare_run", "--check",
                TOP / "launch/gridworld.launch", CONFIG, *words])


def test_run_takes_every_launch_argument_and_refuses_half_true_switches(tmp_path, launch_arguments):
    assert "view_prefix" in launch_arguments
    where = "results_dir:=%s" % tmp_path
    kept = [name for name, default in launch_arguments.items() if default != ""]
    for name in kept + ["uplink"]:
        result = check_launch(where, "%s:=%s" % (name, "true"))
        assert result.returncode == 0, result.stderr
    for name in ("rviz", "view", "hold", "agents", "record"):
        assert name in kept
        assert check_launch(where, name + ":=0").returncode == 0
        result = check_launch(where, name + ":=yes")
        assert result.returncode == 1
        assert result.stderr == "pmeta: %s is 'yes' but must be true or false.\n" % name
    assert check_launch("results_dir:=$(x)").stderr == (
        "pmeta: results_dir is '$(x)', but roslaunch takes '$(' for a substitution.\n")
    assert check_launch(where, "n:=1:=2").returncode == 1
    result = check_launch("results_dir:=%s" % (tmp_path / ODD), "sizes:=[4, 5, 6]", "run_id:=odd")
    assert result.stdout == "%s\n3\n" % (tmp_path / ODD / "gridworld/odd")


def test_run_takes_a_settings_file_of_ones_own(tmp_path):
    own = tmp_path / "my own.yaml"
    own.write_text("experiment: mine\nenvironment:\n  name: gridworld\n  sizes: [3]\n")
    env = dict(environment(tmp_path), ROS_HOME=str(tmp_path / "it's"))
    result = run([TOP / "pmeta", "run", own, "rounds:=2", "pace:=0", "run_id:=own"], env=env,
                 timeout=600)
    assert result.returncode == 0, result.stderr
    folder = tmp_path / "it's/pmeta/mine/own"
    assert json.loads((folder / "manifest.json").read_text())["status"] == "finished"
    last = result.stdout.splitlines()[-1]
    assert shlex.split(last) == ["figures:", "./pmeta", "plot", str(folder)]
    assert "starting the aggregator and 1 agent\n" in result.stdout
    missing = run([TOP / "pmeta", "run", tmp_path / "no.yaml"])
    assert missing.stderr == "pmeta: there is no settings file '%s'.\n" % (tmp_path / "no.yaml")


def test_the_launch_file_starts_an_agent_for_each_task_of_the_settings(tmp_path):
    env = environment(tmp_path)
    for sizes, count in (("[4,5,6,7,8]", 5), ("[3]", 1), ("[3,4,5,6,7,8,9]", 7)):
        result = run(["roslaunch", "--nodes", "pmeta_nodes", "gridworld.launch",
                      "settings:=sizes=%s" % sizes], env=env)
        agents = [line for line in result.stdout.split() if "task_agent" in line]
        assert agents == ["/pmeta/task_agent_%d" % i for i in range(count)]


def test_the_launch_ends_by_itself_and_interrupting_it_leaves_what_was_done(tmp_path):
    env = environment(tmp_path)
    command = ["roslaunch", "pmeta_nodes", "gridworld.launch", "pace:=0.1",
               "results_dir:=%s" % tmp_path]
    result = run(command + ["run_id:=whole", "rounds:=5"], env=env)
    manifest = json.loads((tmp_path / "gridworld/whole/manifest.json").read_text())
    assert manifest["status"] == "finished" and manifest["rounds_done"] == 5, result.stdout

    process = subprocess.Popen(command + ["run_id:=cut", "rounds:=1000"], env=env,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    csv_path = tmp_path / "gridworld/cut/rounds.csv"
    limit = time.time() + 60
    while not (csv_path.exists() and csv_path.read_text().count("\n") > 20):
        assert time.time() < limit, "no round was done"
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    manifest = json.loads((tmp_path / "gridworld/cut/manifest.json").read_text())
    assert manifest["status"] == "stopped"
    rows = list(csv.DictReader(csv_path.open()))
    assert max(int(row["round"]) for row in rows) == manifest["rounds_done"] < 1000


def test_a_bag_of_the_whole_run_is_recorded_on_request(tmp_path):
    env = environment(tmp_path)
    run(["roslaunch", "pmeta_nodes", "gridworld.launch", "pace:=0.3", "record:=true",
         "results_dir:=%s" % tmp_path, "run_id:=r"], env=env)
    bag = tmp_path / "gridworld/r.bag"
    info = run(["rosbag", "info", bag], env=env).stdout
    for topic in ("/pmeta/auxiliary", "/pmeta/meta_policy", "/pmeta/returns", "/pmeta/round"):
        assert topic in info, info

    # what was recorded gives the curves of the run folder; the recorder may miss the first rounds
    plot = run([TOP / "pmeta", "plot", bag])
    assert plot.returncode == 0, plot.stderr
    assert (tmp_path / "gridworld/figures/r_learning_curves.png").exists()
    [recorded] = pmeta_bags.read_bag(str(bag))
    [logged] = pmeta_runs.load_runs([str(tmp_path / "gridworld/r")])
    assert recorded.rounds[-1] == 10 and len(recorded.rounds) >= 5
    returns = pmeta_returns.with_stand_ins(recorded.returns)
    for policy in ("personal", "meta"):
        by_round = dict(zip(logged.rounds, logged.curves[policy]))
        complete = [r for r in recorded.rounds if len(returns[policy][r]) == 5]
        assert len(complete) >= 5
        by_round_recorded = dict(zip(recorded.rounds, recorded.curves[policy]))
        assert [by_round_recorded[r] for r in complete] == [by_round[r] for r in complete]
