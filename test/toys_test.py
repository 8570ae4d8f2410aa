"""An environment with a scene, a learner, an algorithm and an aggregation rule that the suite does
not know, each in a file of its own (test/toys), in one experiment."""
import csv
import re

import pytest

from faults_test import process, wait_until
from programs import LOCAL, TOP, environment, run

TOYS = {"toy_target": "toy_target.cpp", "toy_guess": "toy_guess.cpp",
        "toy_midrange": "toy_midrange.cpp", "toy_pulled_averaging": "toy_pulled_averaging.cpp"}
LIBRARY = TOP / "devel/lib/libpmeta_toys.so"


@pytest.fixture
def config(tmp_path):
    """The toys' settings file, as somebody has it who keeps the library beside it."""
    (tmp_path / "libtoys.so").symlink_to(LIBRARY)
    path = tmp_path / "toys.yaml"
    path.write_text((TOP / "test/toys/toys.yaml").read_text() + "library: libtoys.so\n")
    return path


def rows_of(results_dir, run_id):
    """rounds.csv without the time that it took."""
    with open(results_dir / "toys" / run_id / "rounds.csv", newline="") as file:
        return [{key: value for key, value in row.items() if key != "wall_s"}
                for row in csv.DictReader(file)]


def mean_return(rows, round_, policy):
    found = [float(row["return_mean"]) for row in rows
             if row["round"] == str(round_) and row["policy"] == policy]
    assert len(found) == 3
    return sum(found) / len(found)


def test_toys_learn_over_ros_as_in_one_process_and_are_drawn(config, tmp_path):
    local = run([LOCAL, "run", config, "run_id:=local", "results_dir:=%s" % tmp_path])
    assert local.returncode == 0, local.stderr
    expected = rows_of(tmp_path, "local")
    assert mean_return(expected, 8, "personal") > mean_return(expected, 1, "personal") + 0.1

    env = environment(tmp_path)
    launch = ["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % config,
              "run_id:=ros", "results_dir:=%s" % tmp_path, "hold:=true", "view:=true"]
    with process(launch, tmp_path / "launch.log", env) as launched:
        manifest = tmp_path / "toys/ros/manifest.json"
        assert wait_until(lambda: manifest.exists() and '"finished"' in manifest.read_text(), 60), \
            (tmp_path / "launch.log").read_text()
        markers = run(["rostopic", "echo", "-n", "1", "/pmeta/markers"], env=env, timeout=60)
        launched.terminate()  # killed, it would leave its nodes behind
        launched.wait(60)
    assert markers.stdout.count("toy_discs") == 3
    assert rows_of(tmp_path, "ros") == expected


def test_a_toys_policy_is_evaluated_and_its_run_resumed(config, tmp_path):
    words = ["run_id:=r", "results_dir:=%s" % tmp_path]
    assert run([LOCAL, "run", config, "checkpoint.interval:=1"] + words).returncode == 0
    policy = tmp_path / "toys/r/policies/task_1.safetensors"
    evaluated = run([LOCAL, "evaluate", policy, "--episodes", "3"])
    assert evaluated.returncode == 0 and "target_1" in evaluated.stdout, evaluated.stderr
    again = run([LOCAL, "run", config, "resume:=%s" % (tmp_path / "toys/r")])
    assert again.returncode == 1 and "finished" in again.stderr


def test_a_name_that_nothing_has_is_refused_with_those_there_are(config):
    wrong = run([LOCAL, "check", config, "environment.name:=toy_targt"])
    assert wrong.returncode == 1 and "did you mean 'toy_target'?" in wrong.stderr
    for key, name in (("learner", "toy_guess"), ("algorithm", "toy_pulled_averaging"),
                      ("aggregation.rule", "toy_midrange")):
        wrong = run([LOCAL, "check", config, key + ":=nothing"])
        assert wrong.returncode == 1 and name in wrong.stderr, wrong.stderr
    missing = run([LOCAL, "check", TOP / "test/toys/toys.yaml"])
    assert missing.returncode == 1 and "toy_guess" in missing.stderr


@pytest.mark.parametrize("name", TOYS)
def test_nobody_else_had_to_know_a_toy(name):
    knowing = [path.name for folder in ("src", "test", "tools", "launch", "config")
               for path in (TOP / folder).rglob("*") if path.is_file()
               and path.suffix in (".cpp", ".h", ".py", ".sh", ".txt", ".yaml", ".launch", ".xml")
               and name in path.read_text()]
    assert sorted(knowing) == sorted([TOYS[name], "toys.yaml", "toys_test.py"])


# what a name also means where it is no row's
ELSEWHERE = {
    ("pmeta", "version.cpp"), ("pmeta", "origin.cpp"), ("pmeta", "scene.h"), ("pmeta", "runs.py"),
    ("pmeta", "chaos.py"), ("pmeta", "pmeta_html.py"), ("pmeta", "check_agent.py"),
    ("pmeta", "check_machines.py"),  # the project
    ("mean", "console.cpp"), ("mean", "pmeta_figures.py"), ("mean", "pmeta_sections.py"),
    ("mean", "pmeta_tables.py"),  # a column
    ("mean", "rl2_networks.cpp"), ("mean", "running_variance.cpp"),  # a block, a number
    ("independent", "design.cpp"),  # draws
    # defaults
    ("gridworld", "experiment_settings.h"), ("q_learning", "experiment_settings.h"),
    ("pmeta", "experiment_settings.h"), ("mean", "experiment_settings.h"),
    # the theory is about tables, of which there is one family
    ("gridworld", "convergence_settings.cpp"), ("gridworld", "convergence.h"),
    # experiments that a disturbed run is made of
    ("gridworld", "chaos.py"), ("cart_pole", "chaos.py"),
    # the body of the bodies that its family draws
    ("walker_2d_params", "walker2d.cpp"),
    # figures of one environment, in files of their own
    ("sparse_point_robot", "pmeta_action_values.py"), ("mountain_car", "pmeta_mountain_car.py"),
}


def registered_names():
    """{name: the files that register it}"""
    names = {}
    constant = re.compile(r'constexpr char (k\w+)\[\] = "(\w+)";')
    shared = {key: (value, path.name) for path in (TOP / "src").rglob("*.h")
              for key, value in constant.findall(path.read_text())}
    for path in (TOP / "src").rglob("*.cpp"):
        text = path.read_text()
        if "Registered" not in text:
            continue
        constants = dict(constant.findall(text))
        # terms of mjcf are words of mechanics, which others use for what they measure
        for row in re.findall(r"^const (?:Registered(?!Term)|Row)[^;]*;", text, re.M):
            words = [(text or constants.get(key), path.name) if not key or key in constants
                     else shared.get(key) for text, key in re.findall(r'"(\w+)"|\b(k\w+)', row)]
            # of a row the name comes first
            name, file = next(word for word in words if word)
            names.setdefault(name, set()).update({path.name, file})
    return names


def test_a_registered_name_stands_in_the_files_of_its_row_alone():
    names = registered_names()
    assert {"gridworld", "ant_fwd_back", "half_cheetah_vel", "dqn", "q_learning", "sac", "pooled",
            "pmeta", "median", "trimmed_mean"} <= set(names)
    assert not [name for name in names if name.startswith("toy")]
    found = set()
    for path in (TOP / "src").rglob("*"):
        if path.suffix not in (".cpp", ".h", ".py"):
            continue
        code = re.sub(r"//.*$", "", path.read_text(), flags=re.M)
        found |= {(name, path.name) for name in re.findall(r"""["'](\w+)["']""", code)
                  if name in names}
    # an environment's own files may say its name again, as half_cheetah.h's do
    strangers = {(name, file) for name, file in found if file not in names[name]}
    assert strangers <= ELSEWHERE, sorted(strangers - ELSEWHERE)
