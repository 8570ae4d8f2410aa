"""Tests of docs/results: its pages against its data, and the command that makes both."""

import os
import re
import sys

import pytest

from programs import LOCAL, TOP
from run_folders import call, edit, fails, write_run
import pmeta_archives as pa
import pmeta_pages as pg
import pmeta_plan as pp
import pmeta_runs as pr
import results as program

FOLDER = os.path.join(str(TOP), "docs", "results")
PLAN = """sweeps:
  - {name: first, use: test, priority: 1, core_hours: 0.1, page: page.md, experiment: gridworld,
     assignments: "algorithm:=pmeta,model_averaging seed:=0-1 rounds:=3"}
  - {name: second, use: selection, priority: 2, core_hours: 0.1, page: page.md,
     experiment: gridworld, assignments: "lambda:=5 seed:=2 rounds:=3"}
aims:
  - {aim: easy, runs: {sweep: first, algorithm: pmeta}, policy: mp, measure: last, number: -1000,
     source: a guess}
  - {aim: hard, runs: {sweep: first, algorithm: pmeta}, policy: mp, measure: last, number: 0,
     source: a guess}
claims:
  - {claim: who, measure: auc, ours: {runs: {sweep: first, algorithm: pmeta}, policy: mp},
     theirs: {runs: {sweep: first, algorithm: model_averaging}, policy: mp}}
figures:
  - {folder: first, sweeps: [first], kinds: [curves], keep: [learning_curves]}
"""
PAGE = "prose\n" + "".join("<!-- generated: %s -->\n<!-- end -->\nmore\n" % words for words in (
    "summary", "claims", "plan", "commands first second", "learning first second",
    "comparisons first", "iqm first", "figure first learning_curves")) + "end\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages/plan.yaml").write_text(PLAN, encoding="utf-8")
    (tmp_path / "pages/page.md").write_text(PAGE, encoding="utf-8")
    return tmp_path / "pages"


def results(folder, *arguments):
    return call(program.main, "--folder", folder, *arguments)[0]


def refuses(folder, *arguments):
    return fails("--folder", folder, *arguments, main=program.main, name="results")


def test_the_pages_agree_with_the_data():
    assert "agree with the data" in results(FOLDER, "--check")


def test_every_figure_of_the_pages_is_there():
    for page in pg.pages_of(FOLDER):
        with open(page, encoding="utf-8") as file:
            for target in re.findall(r"\]\(([^)#]+\.png)\)", file.read()):
                assert os.path.isfile(os.path.join(FOLDER, target)), (page, target)


def test_the_data_are_small_and_of_the_plans_commands():
    plan = pp.plan_in(FOLDER)
    data = os.path.join(FOLDER, "data")
    assert sum(os.path.getsize(os.path.join(data, name)) for name in os.listdir(data)) < 5e6
    for name in os.listdir(data):
        assert program.is_packed(FOLDER, plan.sweep(name.split(".")[0])), name


@pytest.mark.skipif(not os.path.isfile(str(LOCAL)), reason="needs pmeta_local")
def test_from_a_plan_to_a_page(folder, tmp_path):
    runs = ("--results-dir", tmp_path / "runs")
    assert results(folder, *runs, "--status").count("0 of ") == 2
    results(folder)
    page = (folder / "page.md").read_text(encoding="utf-8")
    assert page.count("not run") == 7 and "Not run yet: first, second" in page

    results(folder, *runs, "--run", "--only", "first", "--jobs", "1")
    told = results(folder, *runs, "--status")
    assert re.search(r"first .*: done\n", told) and re.search(r"second .*: 0 of 1 runs", told)
    assert "tables and data differ" in refuses(folder, "--check")
    results(folder)
    page = (folder / "page.md").read_text(encoding="utf-8")
    assert page.startswith("prose\n") and page.endswith("end\n") and page.count("\nmore\n") == 8
    assert re.search(r"\| easy .* −1000.00 .* 2 \| reached \|", page)
    assert re.search(r"\| hard .* 0.00 .* 2 \| worse \|", page)
    assert "| first | 0–1 | test | 4 |" in page and "Not run yet: second" in page
    assert (folder / "figures/first/learning_curves.png").is_file()
    assert "agree" in results(folder, "--check")

    # a number that is typed
    (folder / "page.md").write_text(page.replace("| reached |", "| surpassed |"), encoding="utf-8")
    assert "page.md: tables and data differ" in refuses(folder, "--check")

    # data of another command than the plan's
    edit(str(folder), "plan.yaml", lambda t: t.replace("seed:=0-1", "seed:=0-2"))
    assert "out of date" in results(folder, *runs, "--status")
    # the same runs, from elsewhere, and one more is missing
    assert "4 of 6 runs have finished" in results(folder, "--import", tmp_path / "runs")


@pytest.mark.skipif(not os.path.isfile(str(LOCAL)), reason="needs pmeta_local")
def test_it_stops_after_the_given_time_and_goes_on(folder, tmp_path):
    edit(str(folder), "plan.yaml", lambda t: t.replace("rounds:=3", "rounds:=40", 1))
    run = ("--results-dir", tmp_path / "runs", "--run", "--only", "first", "--jobs", "1")
    assert "stopped; the same command goes on" in results(folder, *run, "--hours", "1e-9")
    assert not (folder / "data").exists()
    assert "packed 4 runs" in results(folder, *run)


def test_packed_runs_are_those_that_were_packed(tmp_path):
    runs = [write_run(tmp_path / "a", seed=seed, fresh=3) for seed in range(2)]
    paths = [str(tmp_path / name / "s.tar.xz") for name in ("data", "again")]
    for path in paths:
        pa.pack(path, "s", ["grid", "--name", "s"], runs)
    with open(paths[0], "rb") as one, open(paths[1], "rb") as other:
        assert one.read() == other.read()
    assert pa.packed_command(paths[0]) == ["grid", "--name", "s"]
    with pa.unpacked(paths[:1]) as top:
        found = pr.load_runs(pr.find_folders([top])[0])
        for run, original in zip(found, pr.load_runs(runs)):
            assert list(run.curves["meta"]) == list(original.curves["meta"])
            assert run.fresh.keys() == original.fresh.keys()
            with open(os.path.join(run.folder, "config.yaml")) as file:
                assert "results_dir: results\n" in file.read()
    assert not os.path.exists(top)


def test_an_archive_that_leaves_its_folder_is_refused(tmp_path):
    import io
    import tarfile
    path = str(tmp_path / "s.tar.xz")
    with tarfile.open(path, "w:xz") as archive:
        info = tarfile.TarInfo("s/../../rounds.csv")
        info.size = 1
        archive.addfile(info, io.BytesIO(b"x"))
    with pytest.raises(Exception, match="which is no file of a run"):
        with pa.unpacked([path]):
            pass


def test_verdicts_follow_from_the_numbers():
    assert pg.verdict(10, (8, 12), 10) == "reached"
    assert pg.verdict(9.9, (8, 12), 10) == "not reached"
    assert pg.verdict(9, (8, 9.9), 10) == "worse"
    assert pg.verdict(9, None, 10) == "not reached"
    assert pg.holds((0.51, 0.7)) == "holds" and pg.holds((0.2, 0.49)) == "the other way round"
    assert pg.holds((0.5, 0.9)) == pg.holds(None) == "not established"


@pytest.mark.parametrize("change, words", [
    (lambda t: t.replace("use: test", "use: selection"), "nothing is judged by them"),
    (lambda t: t.replace("use: test", "use: show"), "a use, test or selection"),
    (lambda t: t.replace("priority: 1, ", ""), "sweeps, entry 1 must have exactly"),
    (lambda t: t.replace("priority: 1", "priority: soon"), "priority must be of type int"),
    (lambda t: t.replace(" seed:=2", ""), "sweep 'second' have no seed:="),
    (lambda t: t.replace("policy: mp, measure", "policy: me, measure"), "policy is 'me'"),
    (lambda t: t.replace("measure: auc", "measure: length"), "measure is 'length'"),
    (lambda t: t.replace("sweep: first, algorithm: pmeta}, policy: mp, measure",
                         "sweep: third}, policy: mp, measure"), "has no sweep 'third'"),
    (lambda t: t + "goals: []\n", "unknown key 'goals'"),
])
def test_a_plan_that_does_not_hold_is_refused(folder, change, words):
    edit(str(folder), "plan.yaml", change)
    assert words in refuses(folder)


@pytest.mark.parametrize("change, words", [
    (lambda t: t.replace("generated: summary", "generated: praise"), "'praise' is none of the"),
    (lambda t: t.replace("<!-- end -->", "", 8), "has a block without <!-- end -->"),
    (lambda t: t.replace("figure first learning", "figure first burning"), "no figures burning"),
    (lambda t: t.replace("learning first", "learning third"), "has no sweep 'third'"),
])
def test_a_block_that_cannot_be_made_is_refused(folder, change, words):
    edit(str(folder), "page.md", change)
    assert words in refuses(folder)


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
