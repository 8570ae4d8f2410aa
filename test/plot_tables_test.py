"""Tests of the tables of `pmeta plot`: the paper's, text and LaTeX, and returns on fresh episodes."""

import csv
import os
import re
import statistics

import pytest

from run_folders import (curve, edit, fails, fresh_mean, groups_of, plot, summary, table_row,
                         write_run)
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_tables as pt


@pytest.fixture(scope="module")
def deep_top(tmp_path_factory):
    return tmp_path_factory.mktemp("deep")


@pytest.fixture(scope="module")
def deep(deep_top):
    """{(algorithm, lambda): [folder of seed 0, 1, 2]} of an experiment that the paper has, too."""
    folders = {}
    for algorithm, value in (("pmeta", 5), ("pmeta", 20), ("model_averaging", 0),
                             ("independent", 0)):
        folders[algorithm, value] = [
            write_run(deep_top, algorithm, s, lambda_=value, experiment="mountain_car",
                      learner="dqn", fresh=100, updates=3750) for s in range(3)]
    return folders


@pytest.fixture(scope="module")
def drawn(deep_top, deep):
    """(stdout, stderr) of the deep experiment, drawn once into deep_top/out."""
    return plot(deep_top, "--out", deep_top / "out", "--format", "png", "--what", "tasks")


def test_best_and_fresh_returns_are_what_the_files_say(deep_top, deep, drawn):
    rows = summary(deep_top / "out")
    labels = {("pmeta", 5): "pMeta-RL λ=5", ("pmeta", 20): "pMeta-RL λ=20",
              ("model_averaging", 0): "model averaging", ("independent", 0): "independent"}
    for key, folders in deep.items():
        row = rows[labels[key]]
        assert row["fresh_seeds"] == row["seeds"] == "3"
        for policy, name in (("personal", "pp"), ("meta", "mp")):
            if (policy, key[0]) == ("meta", "independent"):
                assert row["mp_best_mean"] == row["mp_fresh_best_mean"] == ""
                continue
            measured = {"best": [max(curve(f, policy)) for f in folders],
                        "fresh_best": [fresh_mean(f, "best", policy) for f in folders],
                        "fresh_last": [fresh_mean(f, "last", policy) for f in folders]}
            for measure, values in measured.items():
                column = "%s_%s_" % (name, measure)
                assert float(row[column + "mean"]) == pytest.approx(statistics.mean(values))
                assert float(row[column + "std"]) == pytest.approx(statistics.stdev(values))
    for snapshot in ("best", "last"):
        values = [fresh_mean(f, snapshot, "personal", own=False) for f in deep["independent", 0]]
        column = "all_fresh_%s_" % snapshot
        row = rows["independent"]
        assert float(row[column + "mean"]) == pytest.approx(statistics.mean(values))
        assert float(row[column + "std"]) == pytest.approx(statistics.stdev(values))
        assert float(row[column + "mean"]) != float(row["pp_fresh_%s_mean" % snapshot])
        assert rows["pMeta-RL λ=20"][column + "mean"] == ""


def test_the_paper_stands_beside_what_corresponds(drawn):
    out = drawn[0].split("best returns", 1)[1].split("experiment ")[0]
    ends = [re.split(" {2,}", line.strip())[-2:] for line in out.strip().split("\n")]
    assert ends == [["paper, λ", "paper, best"],
                    ["-93.05 ± 1.07", "-"], ["-111.15 ± 4.31", "-"],
                    ["-92.13 ± 0.95", "-93.05 ± 0.95"], ["-107.08 ± 3.21", "-107.15 ± 4.10"],
                    ["-", "-"], ["-", "-111.34 ± 5.95"],
                    ["-", "-92.96 ± 2.08"], ["-", "-133.96 ± 3.25"]]
    assert re.search(r"independent +PP \(DQN\*\) ", out) and " all (DQN) " in out


@pytest.mark.parametrize("change", [
    lambda t: t.replace("hidden: [512, 512]", "hidden: [128, 128]"),
    lambda t: t.replace("batch_size: 64", "batch_size: 32"),
    lambda t: t.replace("updates_per_round: 3750", "updates_per_round: 500")])
def test_the_paper_does_not_stand_beside_runs_of_other_sizes(tmp_path, change):
    folder = write_run(tmp_path, experiment="mountain_car", learner="dqn", updates=3750)
    assert "paper, best" in plot(tmp_path, "--what", "curves", "--format", "png")[0]
    edit(folder, "config.yaml", change)
    assert "paper, best" not in plot(tmp_path, "--what", "curves", "--format", "png")[0]


def test_no_paper_and_no_fresh_columns_without_them(tmp_path):
    write_run(tmp_path)
    out, _ = plot(tmp_path, "--format", "png", "--out", tmp_path / "out")
    assert "paper" not in out.split("Returns are")[0] and "fresh" not in out.split("Returns")[0]
    assert "fresh" not in (tmp_path / "out/best_returns.tex").read_text().split("begin{tab")[2]
    assert not (tmp_path / "out/lambda_table.tex").exists()
    assert not (tmp_path / "out/tasks_last.csv").exists()
    assert "nothing to draw for tasks" in fails(tmp_path, "--what", "tasks")


def test_text_tables_fit_a_terminal(deep_top, drawn):
    assert max(map(len, (deep_top / "out/summary.txt").read_text("utf-8").split("\n"))) <= 120
    wide = [("group", "a", "b"), ("g" * 60, "1" * 40, "2" * 30), ("", "3", "4")]
    lines = pt.aligned(wide[0], wide[1:])
    assert max(map(len, lines)) <= 120 and lines[2] == "  " + "g" * 60
    assert lines[3].split() == ["1" * 40, "2" * 30] and lines[4].split() == ["3", "4"]


def test_latex_tables_follow_from_the_csv(deep_top, drawn):
    rows = summary(deep_top / "out")
    best = (deep_top / "out/best_returns.tex").read_text(encoding="utf-8")
    lambdas = (deep_top / "out/lambda_table.tex").read_text(encoding="utf-8")
    assert "mountain\\_car" in best and "λ" not in best + lambdas

    def cell(label, column):
        return "$%.2f \\pm %.2f$" % tuple(float(rows[label][column + s]) for s in ("mean", "std"))

    assert table_row(best, "=20, MP").split(" & ", 1)[1] == "%s & %s \\\\" % (
        cell("pMeta-RL λ=20", "mp_best_"), cell("pMeta-RL λ=20", "mp_fresh_best_"))
    assert "\n    pMeta-RL $\\lambda$=20, MP & " in best
    assert table_row(best, "DQN*").count("$") == 4 and "all (DQN) & -- & $" in best
    assert "$\\lambda=5$ & $\\lambda=20$" in lambdas
    five, twenty = (cell("pMeta-RL λ=%d" % v, "pp_best_") for v in (5, 20))
    means = [float(rows["pMeta-RL λ=%d" % v]["pp_best_mean"]) for v in (5, 20)]
    assert means[0] > means[1]
    assert table_row(lambdas, "PP &") == "    PP & {\\boldmath %s} & %s \\\\" % (five, twenty)
    for text in (best, lambdas):
        assert text.count("{") == text.count("}") and text.count("$") % 2 == 0


def test_latex_escapes_labels():
    assert pt.latex("η=1 a_b 5% λ") == r"$\eta$=1 a\_b 5\% $\lambda$"
    assert pt.latex("a\\b{c}$d^e~f#g&h") == (
        r"a\textbackslash{}b\{c\}\$d\textasciicircum{}e\textasciitilde{}f\#g\&h")


def test_returns_task_by_task(deep_top, deep, drawn):
    assert {"tasks_last.csv", "tasks_last.png"} <= set(os.listdir(str(deep_top / "out")))
    with open(str(deep_top / "out/tasks_last.csv"), encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    row = [r for r in rows if (r["group"], r["snapshot"], r["policies"], r["task"])
           == ("independent", "best", "all", "1")][0]
    assert (row["name"], row["episodes"], row["seeds"]) == ("zeta 3.5", "fresh", "3")
    values = []
    for folder in deep["independent", 0]:
        with open(os.path.join(folder, "final.csv")) as file:
            values.append(statistics.mean(
                float(r["return_mean"]) for r in csv.DictReader(file)
                if (r["snapshot"], r["task"]) == ("best", "1")))
    assert float(row["mean"]) == pytest.approx(statistics.mean(values))
    assert float(row["min"]) == pytest.approx(min(values))


def test_tasks_without_fresh_episodes_are_those_of_the_round(tmp_path):
    folder = write_run(tmp_path, learner="dqn")
    group = groups_of(tmp_path)["grid"][0]
    curves = curve(folder, "meta")
    for snapshot, place in (("best", curves.index(max(curves))), ("last", -1)):
        values, measured = group.by_task("meta", snapshot)
        assert measured == "evaluation"
        assert values.mean() == pytest.approx(curves[place])
    figure, axes = pd.panels(1, 1)
    assert pf.draw_tasks(axes[0][0], group, "last") == "evaluation"
    points = axes[0][0].lines[1]
    assert list(points.get_xdata()) == list(values[0])


def test_seeds_without_fresh_episodes_are_named(tmp_path):
    first = write_run(tmp_path, fresh=100)
    write_run(tmp_path, seed=1)
    _, err = plot(tmp_path, "--what", "curves", "--format", "png")
    assert "1 of the 2 runs" in err and "no final.csv" in err
    row = summary(tmp_path / "figures")["pMeta-RL λ=10"]
    assert row["fresh_seeds"] == "1" and not row["mp_fresh_best_std"]
    assert float(row["mp_fresh_best_mean"]) == pytest.approx(fresh_mean(first, "best", "meta"))


@pytest.mark.parametrize("change, words", [
    (lambda t: t[:-1], "line 9 is truncated"),
    (lambda t: t.replace("snapshot", "shot"), "line 1: the header"),
    (lambda t: t.replace("last", "first", 1), "line 2: snapshot and policy are 'first'"),
    (lambda t: t.replace("personal,1,1", "personal,1,2", 1), "line 3: task 2"),
    (lambda t: t.replace("personal,1,1", "personal,0,0", 1), "line 3 repeats"),
    (lambda t: t.replace("last,3,meta,-1,1", "best,3,meta,-1,7", 1), "out of range"),
    (lambda t: t.replace("1,1,train", "1,1,trial", 1), "split is 'trial'"),
    (lambda t: t.replace("1,1,train", "1,1,test", 1), "line 3: task 1 (test)"),
    (lambda t: t.replace("last", "own_best", 1).replace("own_best,3,personal,0,0",
                                                       "own_best,3,personal,0,1"),
     "line 2: own_best is of a personal policy on its own task"),
    (lambda t: t[:t.rindex("best")], "has the meta returns (best) of 1 of 2 tasks"),
    (lambda t: t.replace(",2.5,", ",", 1), "8 fields instead of 9"),
])
def test_malformed_fresh_returns_are_refused(tmp_path, change, words):
    path = edit(write_run(tmp_path, fresh=100), "final.csv", change)
    message = fails(tmp_path)
    assert path in message and words in message
