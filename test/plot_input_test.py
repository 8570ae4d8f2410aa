"""Tests of what `pmeta plot` refuses or leaves out: unfinished, altered and foreign files."""

import os

import pytest

from run_folders import HEADER, edit, fails, plot, summary, write_run


def test_unfinished_runs_are_left_out_and_named(tmp_path):
    write_run(tmp_path, seed=0)
    folder = write_run(tmp_path, seed=1, status="stopped")
    half = edit(write_run(tmp_path, seed=2, status="running"), "rounds.csv",
                lambda t: t[:t.index("4,0,train")] + "4,0,tr")
    _, err = plot(tmp_path, "--format", "png")
    assert folder in err and "'stopped' (4 of 4 rounds)" in err
    assert os.path.dirname(half) in err and "'running' (3 of 4 rounds)" in err
    assert summary(tmp_path / "figures")["pMeta-RL λ=10"]["seeds"] == "1"


def test_only_unfinished_runs(tmp_path):
    write_run(tmp_path, status="running")
    assert "none of the 1 runs" in fails(tmp_path)


@pytest.mark.parametrize("change, line, words", [
    (lambda t: t[:-1], 17, "truncated"),
    (lambda t: t[:-20], 17, "truncated"),
    (lambda t: t.replace(",1.5,15,100,", ",1.5,15,", 1), 2, "10 fields instead of 11"),
    (lambda t: t.replace("1,1,train", "1,x,train", 1), 3, "task is 'x'"),
    (lambda t: t.replace(",1.5,15,", ",nan,15,", 1), 2, "return_std is 'nan'"),
    (lambda t: t.replace("train", "trial", 1), 2, "'trial'"),
    (lambda t: t.replace("1,0,train", "0,0,train", 1), 2, "out of range"),
    (lambda t: t.replace("1,1,train", "1,0,train", 1), 3, "repeats round 1, task 0"),
    (lambda t: t.replace("train,meta,0", "train,meta,-1", 1), 4, "context_episodes -1"),
    (lambda t: t.replace("train,pers", "test,pers", 1), 2, "neither adapts nor has test tasks"),
    (lambda t: t.replace("personal,0", "personal,2", 1), 2, "neither adapts nor has test tasks"),
    (lambda t: t.replace("round,", "turn,"), 1, "header"),
    (lambda t: "", 1, "empty"),
    (lambda t: t.replace("\n2,", "\n\n2,", 1), 6, "is blank: remove it"),
])
def test_malformed_rounds_are_refused_by_line(tmp_path, change, line, words):
    path = edit(write_run(tmp_path), "rounds.csv", change)
    message = fails(tmp_path)
    assert "%s line %d" % (path, line) in message and words in message


@pytest.mark.parametrize("keep, words", [
    (lambda line: not line.startswith("4,"), "ends with round 3"),
    (lambda line: not line.startswith("2,"), "no personal return of round 2"),
    (lambda line: line == HEADER, "holds no returns"),
])
def test_missing_rounds_of_a_finished_run_are_refused(tmp_path, keep, words):
    path = edit(write_run(tmp_path), "rounds.csv",
                lambda t: "".join(l for l in t.splitlines(True) if keep(l.strip())))
    message = fails(tmp_path)
    assert path in message and words in message


def test_tasks_that_did_not_report_are_named(tmp_path):
    folder = write_run(tmp_path)
    edit(folder, "rounds.csv",
         lambda t: "".join(l for l in t.splitlines(True) if not l.startswith("2,1,train,pers")))
    _, err = plot(tmp_path, "--format", "png")
    assert folder in err and "round 2" in err


@pytest.mark.parametrize("name, text, words", [
    ("manifest.json", "{", "not valid JSON"),
    ("manifest.json", "[]", "JSON object"),
    ("manifest.json", '{"status": "finished"}', "'experiment' is missing"),
    ("config.yaml", "a: [", "not valid YAML"),
    ("config.yaml", "just words", "key: value"),
])
def test_broken_files_are_refused_by_name(tmp_path, name, text, words):
    path = edit(write_run(tmp_path), name, lambda _: text)
    message = fails(tmp_path)
    assert path in message and words in message


def test_experiment_name_cannot_leave_the_folder(tmp_path):
    folder = write_run(tmp_path)
    edit(folder, "manifest.json", lambda t: t.replace('"grid"', '"../../away"'))
    assert "plain name" in fails(tmp_path)


def test_binary_file_is_refused(tmp_path):
    folder = write_run(tmp_path)
    with open(os.path.join(folder, "rounds.csv"), "wb") as file:
        file.write(b"\xff\xfe\x00")
    assert "not a text file" in fails(tmp_path)


def test_bad_arguments(tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    write_run(tmp_path)
    assert "no folder %s/nowhere" % tmp_path in fails(tmp_path / "nowhere")
    assert "no runs in %s" % empty in fails(empty)
    assert "not 'curve'" in fails(tmp_path, "--what", "curve")
    assert "not 'svg'" in fails(tmp_path, "--format", "svg")
    assert "--bogus" in fails(tmp_path, "--bogus")
    assert "DIR" in fails()
    assert "nothing to draw for sweep" in fails(tmp_path, "--what", "sweep")
    assert "nothing to draw for convergence" in fails(tmp_path, "--what", "convergence")
    (tmp_path / "file").write_text("")
    assert "cannot use %s/file" % tmp_path in fails(tmp_path, "--out", tmp_path / "file")


def test_a_mark_before_the_text_and_blank_lines_after_it_do_no_harm(tmp_path):
    folder = write_run(tmp_path, fresh=3)
    expected = plot(tmp_path, "--format", "png")[0]
    for name in ("rounds.csv", "final.csv", "manifest.json", "config.yaml"):
        edit(folder, name, lambda t: "\ufeff" + t + "\n \n")
    assert plot(tmp_path, "--format", "png")[0] == expected


@pytest.mark.parametrize("name, change, words", [
    ("manifest.json", lambda t: t.replace('"rounds": 4', '"rounds": 4000000000'),
     "ends with round 4 (personal) but its manifest.json says 4000000000 rounds"),
    ("rounds.csv", lambda t: t.replace("4,1,", "4,999999999,"),
     "has a task 999999999 but the run has"),
    ("rounds.csv", lambda t: t.replace("4,1,", "4000000000,1,"), "ends with round 4000000000"),
    ("manifest.json", lambda t: "[" * 10 ** 6, "is nested too deeply to be read"),
    ("manifest.json", lambda t: '{"a":' * 10 ** 6, "is nested too deeply to be read"),
    ("config.yaml", lambda t: t + "a: " + "[" * 10 ** 4, "is nested too deeply to be read"),
    ("config.yaml", lambda t: t + "a: &a [1]\nb: [*a, *a]\n", "aliases are not read"),
    ("config.yaml", lambda t: t + "evaluation_interval: 0\n", "evaluation_interval is '0'"),
    ("config.yaml", lambda t: t + "evaluation_interval: soon\n", "evaluation_interval is 'soon'"),
    ("manifest.json", lambda t: t.replace('"grid"', '"../x"'), "must be a plain name"),
    ("manifest.json", lambda t: t.replace('"grid"', '"g\\u001b[31m"'), "experiment is 'g?[31m'"),
])
def test_an_altered_run_is_refused_in_one_sentence(tmp_path, name, change, words):
    edit(write_run(tmp_path), name, change)
    assert words in fails(tmp_path)


def test_a_pipe_in_place_of_a_file_is_not_waited_for(tmp_path):
    folder = write_run(tmp_path)
    for name in ("config.yaml", "rounds.csv", "manifest.json"):
        os.rename(os.path.join(folder, name), os.path.join(folder, "kept"))
        os.mkfifo(os.path.join(folder, name))
        assert "%s is not a regular file" % os.path.join(folder, name) in fails(tmp_path)
        os.replace(os.path.join(folder, "kept"), os.path.join(folder, name))


def test_a_file_is_no_folder_of_runs(tmp_path):
    path = os.path.join(write_run(tmp_path), "rounds.csv")
    assert "%s is a file: give the run folder" % path in fails(path)
