"""./pmeta runs: how runs and sweeps stand, and removing them."""

import json
import os
import pty
import socket
import subprocess
import sys
import time

import pytest
from programs import CONFIG, LOCAL, TOP, run
from run_folders import SCRIPTS, call, curve, edit, fails, rows_of, write_run

import pmeta_lock
import runs as program
from pmeta_files import PlotError

DAY = 86400


def runs(*arguments, code=0):
    return call(program.main, *arguments, code=code)


def refuses(*arguments):
    return fails(*arguments, main=program.main, name="runs")


def listed(top, *arguments):
    return {item["name"]: item for item in json.loads(runs(top, "--json", *arguments)[0])}


def set_manifest(folder, **values):
    def change(text):
        return json.dumps(dict(json.loads(text), **values))
    edit(folder, "manifest.json", change)


def age_by(folder, days):
    for where, _, names in os.walk(folder):
        for path in [where] + [os.path.join(where, name) for name in names]:
            os.utime(path, (time.time() - days * DAY,) * 2)


def test_each_run_tells_its_status_rounds_and_last_returns(tmp_path):
    finished = write_run(tmp_path, run_id="done", contexts=(0, 2), tests=1)
    stopped = write_run(tmp_path, run_id="stopped", status="stopped", algorithm="independent")
    failed = write_run(tmp_path, run_id="failed", status="failed")
    set_manifest(failed, reason="task 0 sent\na value.", rounds=9)
    for days, folder in enumerate((failed, stopped, finished)):
        age_by(folder, days)
    lines = runs(tmp_path)[0].splitlines()
    assert [line.split()[0] for line in lines] == ["run", "grid/done", "grid/stopped",
                                                   "grid/failed"]
    assert lines[1].endswith("2 d  finished")
    assert lines[3].split()[1] == "4/9" and lines[3].endswith("failed: task 0 sent?a value.")
    found = listed(tmp_path)
    assert found["grid/done"]["personal_return"] == pytest.approx(curve(finished, "personal")[-1])
    assert found["grid/done"]["meta_return"] == pytest.approx(curve(finished, "meta")[-1])
    assert found["grid/stopped"]["meta_return"] is None
    assert found["grid/done"]["size"] == sum(
        os.path.getsize(os.path.join(finished, name)) for name in os.listdir(finished))


def test_a_round_that_is_being_written_is_no_harm(tmp_path):
    folder = write_run(tmp_path, run_id="r")
    edit(folder, "rounds.csv", lambda text: text + "5,0,train,pers")
    assert listed(tmp_path)["grid/r"]["personal_return"] == pytest.approx(
        curve_of_whole_lines(folder))


def curve_of_whole_lines(folder):
    rows = [row for row in rows_of(folder, "personal") if row["round"] == "4"]
    return sum(float(row["return_mean"]) for row in rows) / len(rows)


def test_a_file_that_cannot_be_read_hides_no_other_run(tmp_path):
    write_run(tmp_path, run_id="good")
    bad = write_run(tmp_path, run_id="bad")
    edit(bad, "manifest.json", lambda text: text[:-5])
    edit(bad, "rounds.csv", lambda text: text.replace("-", "x"))
    out, err = runs(tmp_path)
    assert "grid/good" in out and "grid/bad" in out
    assert "bad/manifest.json is not valid JSON" in err


def test_a_sweep_is_one_line_and_its_folder_lists_its_runs(tmp_path):
    sweep = tmp_path / "sweeps" / "mine"
    for seed in range(2):
        for lambda_ in (5, 10):
            write_run(sweep, seed=seed, lambda_=lambda_)
    write_run(sweep, seed=2, status="failed")
    write_run(tmp_path / "demo" / "sweeps" / "seeds")
    write_run(tmp_path)
    assert set(listed(tmp_path)) == {"sweeps/mine", "demo/sweeps/seeds", "grid/pmeta_l10_s0"}
    assert listed(tmp_path)["sweeps/mine"]["statuses"] == {"finished": 4, "failed": 1}
    assert "20/20" in runs(tmp_path)[0]
    assert "sweep of 5 runs, 3 seeds: 1 failed, 4 finished" in runs(tmp_path)[0]
    assert set(listed(tmp_path / "sweeps")) == {"mine"}
    assert len(listed(sweep)) == 5


class Live:
    """A run of the core that goes on until it is ended."""

    def __init__(self, top):
        self.folder = str(top / "gridworld" / "live")
        self.process = subprocess.Popen(
            [str(LOCAL), "run", str(CONFIG), "rounds:=1000000", "run_id:=live",
             "results_dir:=%s" % top], stdout=subprocess.PIPE)
        while b"settings" not in self.process.stdout.readline():
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()
        self.process.stdout.close()

    def kill(self):
        self.process.kill()
        self.process.wait()


def test_a_live_run_is_never_removed_and_a_killed_one_is_interrupted(tmp_path):
    with Live(tmp_path) as live:
        write_run(tmp_path, run_id="done")
        holder = "process %d on host %s" % (live.process.pid, socket.gethostname())
        item = listed(tmp_path)["gridworld/live"]
        assert (item["status"], item["holder"]) == ("running", holder)
        assert "running, " + holder in runs(tmp_path)[0]
        assert "live is being written by %s: wait" % holder in refuses(
            tmp_path, "--yes", "--remove", "grid/done", "gridworld/live")
        assert "nothing to remove" in runs(tmp_path, "--yes", "--remove-unfinished")[0]
        with pytest.raises(PlotError, match=holder):
            with pmeta_lock.held(live.folder):
                pass
        assert len(listed(tmp_path)) == 2
        assert "left alone" in runs(tmp_path, "--yes", "--remove-all")[1]
        assert list(listed(tmp_path)) == ["gridworld/live"]
        live.kill()
        assert listed(tmp_path)["gridworld/live"]["status"] == "interrupted"
        runs(tmp_path, "--yes", "--remove-unfinished")
        assert not list(tmp_path.iterdir())


def test_whoever_holds_a_folder_keeps_the_core_out(tmp_path):
    folder = tmp_path / "gridworld" / "live"
    folder.mkdir(parents=True)
    command = [LOCAL, "run", CONFIG, "rounds:=1", "run_id:=live", "results_dir:=%s" % tmp_path]
    with pmeta_lock.held(str(folder)):
        assert "is being written" in run(command).stderr
    assert run(command).returncode == 0


def test_where_the_file_system_cannot_lock_a_dead_process_holds_nothing(tmp_path):
    folder = write_run(tmp_path, run_id="r", status="running")
    path = os.path.join(folder, pmeta_lock.WITHOUT_LOCKS)

    def holder(**values):
        with open(path, "w") as file:
            json.dump(values, file)
        return pmeta_lock.holder_of(folder)

    here = socket.gethostname()
    with open("/proc/self/stat") as file:
        start = int(file.read().rpartition(")")[2].split()[19])
    mine = "process %d on host %s" % (os.getpid(), here)
    assert holder(pid=os.getpid(), start=start, host=here) == mine
    assert holder(pid=os.getpid(), start=start + 1, host=here) == ""
    assert holder(pid=2 ** 22 + 1, start=1, host=here) == ""
    assert holder(pid=7, start=1, host="elsewhere") == "process 7 on host elsewhere"
    assert holder() == "another process"


def test_only_what_is_named_goes_and_empty_folders_above_it(tmp_path):
    for run_id in ("a", "b"):
        write_run(tmp_path, run_id=run_id)
    sweep = tmp_path / "sweeps" / "mine"
    for seed in range(3):
        write_run(sweep, seed=seed)
    (sweep / "figures").mkdir()
    assert "removed 1 run" in runs(tmp_path, "--yes", "--remove", "grid/a")[0]
    runs(tmp_path, "--yes", "--remove", sweep / "grid" / "pmeta_l10_s1")
    assert set(listed(tmp_path)) == {"grid/b", "sweeps/mine"}
    assert set(listed(sweep)) == {"grid/pmeta_l10_s0", "grid/pmeta_l10_s2"}
    # a run of a sweep that goes as a whole is no second thing
    assert "removed 2 runs" in runs(tmp_path, "--yes", "--remove", "sweeps/mine",
                                    "sweeps/mine/grid/pmeta_l10_s0")[0]
    assert [path.name for path in tmp_path.iterdir()] == ["grid"]
    (tmp_path / "other").mkdir()
    for name in ("grid/a", "other", ".", "..", "/"):
        assert "there is no run or sweep '%s' in" % name in refuses(tmp_path, "--yes", "--remove",
                                                                  name)
    assert set(listed(tmp_path)) == {"grid/b"}


def test_a_link_to_a_folder_elsewhere_is_not_followed(tmp_path):
    elsewhere = write_run(tmp_path / "elsewhere", run_id="r")
    top = tmp_path / "top"
    write_run(top, run_id="r", status="failed")
    os.symlink(elsewhere, str(top / "grid" / "link"))
    os.symlink(elsewhere, str(top / "grid" / "r" / "link"))
    runs(top, "--yes", "--remove-all")
    assert os.path.isfile(os.path.join(elsewhere, "rounds.csv"))
    assert os.listdir(str(top / "grid")) == ["link"]


def test_unfinished_runs_go_those_in_sweeps_too(tmp_path):
    for status in ("finished", "stopped", "failed", "running"):
        write_run(tmp_path / "sweeps" / "mine", run_id=status, status=status)
        write_run(tmp_path, run_id=status, status=status)
    old = write_run(tmp_path, run_id="old", status="failed")
    age_by(old, 9.5)
    assert "removed 1 run" in runs(tmp_path, "--yes", "--remove-unfinished", "--older-than", 9)[0]
    assert "removed 6 runs" in runs(tmp_path, "--yes", "--remove-unfinished")[0]
    assert set(listed(tmp_path)) == {"sweeps/mine", "grid/finished"}
    assert set(listed(tmp_path / "sweeps" / "mine")) == {"grid/finished"}


def test_older_than_looks_at_the_last_change(tmp_path):
    for days in (1, 5, 9):
        age_by(write_run(tmp_path, run_id="d%d" % days), days + 0.1)
    assert list(listed(tmp_path, "--older-than", 5)) == ["grid/d9", "grid/d5"]
    assert "that old" in runs(tmp_path, "--older-than", 20)[0]
    runs(tmp_path, "--yes", "--remove-all", "--older-than", 5)
    assert list(listed(tmp_path)) == ["grid/d1"]


@pytest.mark.parametrize("answer,code", [("y\n", 0), ("\n", 1), ("no\n", 1)])
def test_it_asks_before_it_removes(tmp_path, answer, code):
    write_run(tmp_path, run_id="r")
    ours, theirs = pty.openpty()
    os.write(ours, answer.encode())
    result = run([sys.executable, os.path.join(SCRIPTS, "runs.py"), tmp_path, "--remove-all"],
                 stdin=theirs)
    os.close(ours)
    os.close(theirs)
    assert result.returncode == code
    assert "grid/r" in result.stdout and "Remove 1 run with " in result.stdout
    assert ("nothing was removed." in result.stderr) == (code == 1)
    assert (tmp_path / "grid").exists() == (code == 1)


def test_without_anybody_to_ask_it_refuses(tmp_path):
    write_run(tmp_path, run_id="r")
    result = run([TOP / "pmeta", "runs", tmp_path, "--remove-all"], stdin=subprocess.DEVNULL)
    assert result.returncode == 1
    assert result.stderr.startswith("runs: nobody can be asked here whether to remove 1 run with ")
    assert result.stderr.endswith(": give --yes.\n")
    assert listed(tmp_path)


def test_the_default_is_the_results_folder_of_the_programs(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    assert runs()[0] == "there are no runs in %s/pmeta.\n" % tmp_path
    write_run(tmp_path / "pmeta", run_id="r")
    assert "grid/r" in runs()[0]
    monkeypatch.delenv("ROS_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert runs()[0] == "there are no runs in %s/.ros/pmeta.\n" % tmp_path


@pytest.mark.parametrize("arguments,words", [
    (["/nowhere"], "there is no folder /nowhere."),
    (["--older-than", "-1"], "--older-than is -1 but must be a number of days, at least 0."),
    (["--older-than", "nan"], "--older-than is nan but must be a number of days, at least 0."),
    (["--json", "--remove-all"], "--json lists: leave it out to remove."),
    (["--yes"], "--yes is for removing: give --remove, --remove-unfinished or --remove-all."),
    (["--remove-all", "--remove-unfinished"], "not allowed with argument"),
])
def test_bad_words_are_told_in_a_sentence(arguments, words):
    assert words in refuses(*arguments)
