"""What a user meets at the door: programs, launch files, sweeps, the installed packages."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "src/pmeta_nodes/scripts"))

from programs import CONFIG, LOCAL, TOP, environment, run


def rows_without_time(path):
    return [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]


BAD_SETTINGS = [
    ("lamda:=5", "unknown setting 'lamda' (given as lamda:=5): did you mean 'personal.lambda'?"),
    ("lambda:=ten",
     "personal.lambda is 'ten' (given as lambda:=ten) but must be a number, at least 0."),
    ("lambda:=-1",
     "personal.lambda is '-1' (given as lambda:=-1) but must be a number, at least 0."),
    ("beta:=1.5",
     "aggregation.beta is '1.5' (given as beta:=1.5) but must be a number, from 0 to 1."),
    ("lambda:=50", "personal.alpha = 0.08 with personal.lambda = 50 diverges: alpha must be below "
                   "2 / (1 + lambda + gamma) = 0.0385356."),
    ("environment.name:=gridwold",
     "unknown environment 'gridwold': did you mean 'gridworld'? Known are "
                                  "ant_fwd_back, cart_pole, gridworld, half_cheetah_dir, "
                                  "half_cheetah_vel, mjcf, mountain_car, remote, sparse_point_robot, "
                                  "walker_2d_params."),
    ("rounds:=2.5",
     "rounds is '2.5' (given as rounds:=2.5) but must be a whole number, from 1 to 1e+06."),
]


@pytest.mark.parametrize("assignment,sentence", BAD_SETTINGS)
def test_bad_settings_are_told_in_one_sentence(tmp_path, assignment, sentence):
    result = run([LOCAL, "run", CONFIG, assignment, "results_dir:=%s" % tmp_path])
    assert result.returncode == 1
    assert result.stderr == "pmeta: %s\n" % sentence
    assert not list(tmp_path.iterdir()), "something was started"


def test_a_misspelt_key_in_a_file_is_named_with_its_line(tmp_path):
    config = tmp_path / "bad.yaml"
    config.write_text("experiment: bad\npersonal:\n  lamda: 5\n")
    result = run([LOCAL, "run", config])
    assert result.returncode == 1
    assert result.stderr == ("pmeta: unknown setting 'personal.lamda' (%s line 3): did you mean "
                             "'personal.lambda'?\n" % config)


BAD_WORDS = [
    (["fuzz", "yaml"],
     "unknown target 'yaml'; known are: checkpoint csv layout message policy replay settings."),
    (["fuzz", "csv", "--seconds"], "--seconds needs a whole number, at least 1."),
    (["fuzz", "csv", "--seconds", "1m"], "--seconds needs a whole number, at least 1."),
    (["key"], "which file? See ./pmeta key --help."),
    (["replay", "cartpole"], "which kind and file? See ./pmeta replay --help."),
    (["build", "all"], "'all' is too much: see ./pmeta build --help."),
    (["convergence", "x"], "'x' is not an assignment: write key:=value."),
    (["test", "--msan"], "unknown option '--msan' of test: see ./pmeta test --help."),
]


@pytest.mark.parametrize("words,sentence", BAD_WORDS)
def test_bad_words_are_told_before_anything_is_built(words, sentence):
    result = run([TOP / "pmeta"] + words)
    assert result.returncode == 1
    assert result.stderr == "pmeta: %s\n" % sentence
    assert result.stdout == ""


@pytest.fixture(scope="module")
def bare_tree(tmp_path_factory):
    """The front door and what its help needs, in a place where nothing has been built."""
    top = tmp_path_factory.mktemp("bare")
    shutil.copy(str(TOP / "pmeta"), str(top))
    for folder in ("tools", "config", "src/pmeta_nodes/scripts"):
        shutil.copytree(str(TOP / folder), str(top / folder),
                        ignore=shutil.ignore_patterns("__pycache__"))
    return top


COMMANDS = sorted(path.stem for path in (TOP / "tools/commands").iterdir())


def test_the_overview_has_every_command_once(bare_tree):
    text = run([bare_tree / "pmeta", "--help"]).stdout
    listed = [line.split()[0] for line in text.splitlines() if line.startswith("  ")]
    assert sorted(listed) == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_its_own_help_which_needs_no_build(bare_tree, command):
    result = run([bare_tree / "pmeta", command, "--help"])
    assert result.returncode == 0 and result.stderr == ""
    assert result.stdout.startswith("usage: ") and command in result.stdout.splitlines()[0]
    assert "Example" in result.stdout and "./pmeta %s" % command in result.stdout.split("Example")[1]
    assert not (bare_tree / "build").exists()


BUILDS = """
TOP=$1; . "$TOP/tools/common.sh"
setup() { :; }
run_make() { mkdir -p "$TOP/build" "$TOP/devel"; [ -f "$TOP/devel/program" ] || echo > "$TOP/devel/program"
             find "$TOP/src" "$TOP/config" -type f -newer "$TOP/devel/program" -printf "newer: %f"; echo made; }
build
"""


def remake(path, text, age):
    path.write_text(text)
    os.utime(str(path), (time.time() - age,) * 2)


CHANGES = [
    ("nothing", lambda top: None, ""),
    ("a script", lambda top: (top / "src/plot.py").write_text("2"), ""),
    ("a file is edited", lambda top: remake(top / "src/a.cpp", "2", 0), "newer: a.cpp"),
    ("another is put back, older than the build",
     lambda top: remake(top / "src/a.cpp", "2", 9000), "newer: a.cpp"),
    ("a model", lambda top: remake(top / "config/models/m.xml", "2", 9000), "newer: m.xml"),
    ("a file is new", lambda top: remake(top / "src/c d.cpp", "", 9000), "newer: c d.cpp"),
    ("a file is gone", lambda top: (top / "src/b.cpp").unlink(), "made"),
    ("a program is gone", lambda top: (top / "devel/program").unlink(), "made"),
    ("build/ is gone", lambda top: shutil.rmtree(str(top / "build")), "made"),
    ("devel/ is gone", lambda top: shutil.rmtree(str(top / "devel")), "made"),
]


@pytest.mark.parametrize("change,expected", [pytest.param(*c[1:], id=c[0]) for c in CHANGES])
def test_what_has_changed_and_only_that_is_built(tmp_path, change, expected):
    for folder in ("src", "config/models", "test"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("src/a.cpp", "src/b.cpp", "src/plot.py", "config/models/m.xml"):
        remake(tmp_path / name, "1", 5000)
    shutil.copytree(str(TOP / "tools"), str(tmp_path / "tools"))
    build = ["bash", "-euo", "pipefail", "-c", BUILDS, "_", tmp_path]
    first = run(build)
    assert first.stdout == "made\n", first.stderr
    change(tmp_path)
    second = run(build)
    assert second.returncode == 0, second.stderr
    assert expected in second.stdout if expected else second.stdout == ""
    assert run(build).stdout == ""


def test_an_unwritable_results_folder_is_told_before_anything_starts(tmp_path):
    (tmp_path / "file").write_text("")
    result = run([LOCAL, "run", CONFIG, "results_dir:=%s/file/results" % tmp_path])
    assert result.returncode == 1
    assert result.stderr == (
        "pmeta: the results folder %s/file/results cannot be written (Not a directory): choose "
        "another with results_dir:=DIR.\n" % tmp_path)
    assert result.stdout == ""


def test_a_key_is_made_once_and_must_stay_private(tmp_path):
    key = tmp_path / "run.key"
    made = run([TOP / "pmeta", "key", key], timeout=600)
    assert made.returncode == 0, made.stderr
    assert key.stat().st_mode & 0o7777 == 0o600
    text = key.read_text()
    assert len(bytes.fromhex(text)) == 32 and text not in made.stdout + made.stderr
    again = run([LOCAL, "key", key])
    assert again.returncode == 1
    assert again.stderr == ("pmeta: %s is there already and was left as it is: give a new name.\n"
                            % key)
    assert key.read_text() == text

    key.chmod(0o640)
    launch = run(["roslaunch", "pmeta_nodes", "gridworld.launch", "key_file:=%s" % key,
                  "results_dir:=%s" % tmp_path], env=environment(tmp_path))
    assert launch.returncode == 1
    assert "has mode 0640, which lets others at it: run chmod 600" in launch.stdout + launch.stderr


def test_two_runs_with_one_seed_are_byte_identical_apart_from_wall_s(tmp_path):
    for run_id in ("a", "b"):
        result = run([LOCAL, "run", CONFIG, "seed:=3", "results_dir:=%s" % tmp_path,
                      "run_id:=%s" % run_id])
        assert result.returncode == 0, result.stderr
    a, b = (rows_without_time(tmp_path / "gridworld" / name / "rounds.csv") for name in "ab")
    assert a == b
    assert len(a) == 1 + 10 * 5 * 2
    other = run([LOCAL, "run", CONFIG, "seed:=4", "results_dir:=%s" % tmp_path, "run_id:=c"])
    assert other.returncode == 0
    assert rows_without_time(tmp_path / "gridworld/c/rounds.csv") != a


def test_a_run_is_never_written_over(tmp_path):
    command = [LOCAL, "run", CONFIG, "results_dir:=%s" % tmp_path, "run_id:=once"]
    assert run(command).returncode == 0
    before = (tmp_path / "gridworld/once/rounds.csv").read_bytes()
    again = run(command)
    assert again.returncode == 1
    assert "already holds a run: choose another run_id." in again.stderr
    assert (tmp_path / "gridworld/once/rounds.csv").read_bytes() == before


def test_the_effective_settings_kept_with_a_run_repeat_it(tmp_path):
    assert run([LOCAL, "run", CONFIG, "lambda:=5", "slip:=0.1", "seed:=2",
                "results_dir:=%s" % tmp_path, "run_id:=first"]).returncode == 0
    first = tmp_path / "gridworld/first"
    assert run([LOCAL, "run", first / "config.yaml", "run_id:=second"]).returncode == 0
    assert (rows_without_time(first / "rounds.csv")
            == rows_without_time(tmp_path / "gridworld/second/rounds.csv"))


def test_a_sweep_does_each_run_once_and_goes_on_where_it_stopped(tmp_path):
    command = [LOCAL, "sweep", CONFIG, "lambda:=5,10", "algorithm:=pmeta,model_averaging",
               "seed:=0-2", "results_dir:=%s" % tmp_path, "--name", "s"]
    result = run(command)
    assert result.returncode == 0, result.stderr
    folder = tmp_path / "sweeps/s/gridworld"
    # lambda means nothing to model averaging: 2 x 3 runs of pmeta and 3 of averaging
    assert len(list(folder.iterdir())) == 9
    assert "[9/9]" in result.stdout and "ETA" in result.stdout

    # one run cut off, one unfinished
    names = sorted(path.name for path in folder.iterdir())
    expected = rows_without_time(folder / names[0] / "rounds.csv")
    manifest = json.loads((folder / names[0] / "manifest.json").read_text())
    manifest["status"] = "running"
    (folder / names[0] / "manifest.json").write_text(json.dumps(manifest))
    (folder / names[0] / "rounds.csv").write_text("round,")
    shutil.rmtree(str(folder / names[1]))
    result = run(command)
    assert result.returncode == 0, result.stderr
    assert "7 runs had been finished before" in result.stdout
    assert rows_without_time(folder / names[0] / "rounds.csv") == expected
    assert sorted(path.name for path in folder.iterdir()) == names

    (folder / names[2] / "manifest.json").unlink()
    before = sorted(tmp_path.rglob("*"))
    planned = run(command + ["--dry-run"])
    assert planned.stderr.endswith("1 of 9 runs are to be done\n")
    assert sorted(tmp_path.rglob("*")) == before
    assert sorted(planned.stdout.splitlines(), key=lambda line: line.split()[1]) == [
        "%s %s" % ("missing" if name == names[2] else "finished", folder / name) for name in names]

    # the same name for other settings would mix results
    for dry in ([], ["--dry-run"]):
        other = run([LOCAL, "sweep", CONFIG, "lambda:=5,10", "algorithm:=pmeta,model_averaging",
                     "seed:=0-2", "rounds:=5", "results_dir:=%s" % tmp_path, "--name", "s"] + dry)
        assert other.returncode == 1
        assert ("has other settings, with rounds 10 where this sweep has 5: give this sweep another "
                "--name") in other.stderr


def test_an_interrupted_sweep_keeps_what_is_finished(tmp_path):
    command = [LOCAL, "sweep", CONFIG, "seed:=0-399", "rounds:=300", "sizes:=[16]",
               "results_dir:=%s" % tmp_path]
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE,
                               universal_newlines=True)
    assert process.stdout.readline().startswith("[1/400]")
    process.send_signal(signal.SIGINT)
    output = process.communicate(timeout=60)[0]
    assert process.returncode == 130
    assert "stopped; the same command goes on" in output
    statuses = [json.loads(path.read_text())["status"]
                for path in tmp_path.glob("sweeps/gridworld/gridworld/*/manifest.json")]
    assert statuses.count("finished") >= 1 and statuses.count("running") == 0


def test_a_second_interrupt_does_not_wait_for_the_round(tmp_path):
    command = [LOCAL, "run", CONFIG, "rounds:=1", "updates_per_round:=1000000000",
               "results_dir:=%s" % tmp_path]
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, universal_newlines=True)
    while not list(tmp_path.glob("gridworld/*/rounds.csv")):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.stderr.readline() == "\n"
    assert "once more stops at once" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGINT


def test_every_program_answers_help(tmp_path):
    env = environment(tmp_path)
    scripts = [path.name for path in (TOP / "src/pmeta_nodes/scripts").glob("[!p]*.py")
               if path.name != "results.py"]  # is not installed
    for program in ["task_agent", "meta_aggregator", "trajectory_view", "prepare_run", "run_guard",
                    "policy_node", "plot.py"] + scripts:
        result = run([TOP / "devel/lib/pmeta_nodes" / program, "--help"], env=env)
        assert result.returncode == 0, program + ": " + result.stderr
        assert program.split(".")[0].split("_")[0] in result.stdout
    assert run([LOCAL, "--help"]).stdout.startswith("usage: pmeta_local")
    assert run([TOP / "pmeta", "--help"]).stdout.startswith("usage: ./pmeta")
    unknown = run([TOP / "pmeta", "dmeo"])
    assert unknown.returncode == 1 and "unknown command 'dmeo'" in unknown.stderr


def test_nodes_say_what_they_miss(tmp_path):
    env = environment(tmp_path)
    master = subprocess.Popen(["rosmaster", "--core", "-p", env["ROS_MASTER_URI"].rsplit(":")[-1]],
                              env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        result = run(["rosrun", "pmeta_nodes", "task_agent", "_task:=0", "__ns:=/pmeta"], env=env)
        assert result.returncode == 1
        assert "the parameter /pmeta/config is not set" in result.stderr
        result = run(["rosrun", "pmeta_nodes", "task_agent", "_task:=9",
                      "_config_file:=%s" % CONFIG], env=env)
        assert result.returncode == 1
        assert ("the private parameter task is '9' but must be a whole number from 0 to 4: give "
                "_task:=VALUE.") in result.stderr
    finally:
        master.terminate()
        master.wait(timeout=20)


BAD_SCREENSHOTS = [
    ([], "which experiment?"),
    (["gridwold"], "unknown experiment 'gridwold'"),
    (["gridworld", "-o"], "-o needs a file."),
    (["gridworld", "-o", "/no/such/folder/picture.png"], "there is no folder /no/such/folder"),
    (["gridworld", "picture.png"], "'picture.png' is not an assignment: write key:=value."),
]


@pytest.mark.parametrize("words,sentence", BAD_SCREENSHOTS)
def test_screenshot_says_what_is_wrong(words, sentence):
    result = run([TOP / "pmeta", "screenshot"] + words)
    assert result.returncode == 1
    assert sentence in result.stderr


@pytest.mark.skipif(shutil.which("Xvfb") is None or shutil.which("import") is None,
                    reason="needs xvfb and imagemagick")
def test_a_screenshot_shows_both_policies_in_rviz(tmp_path):
    image = pytest.importorskip("matplotlib.image")
    picture = tmp_path / "carts.png"
    result = run([TOP / "pmeta", "screenshot", "cart_pole", "rounds:=1", "updates_per_round:=5",
                  "-o", picture], timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    pixels = (image.imread(str(picture))[:, :, :3] * 255).round().astype(int)
    assert pixels.shape == (800, 1640, 3)
    # carts, labels and legend in the colours of the personal policies and the meta-policy
    for red, green, blue in ((216, 27, 96), (11, 79, 179)):
        near = abs(pixels - (red, green, blue)).max(axis=2) < 12
        assert near.sum() > 500, (red, green, blue, near.sum())
