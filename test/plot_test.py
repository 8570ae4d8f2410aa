"""Tests of `pmeta plot`: run folders written here, numbers worked out here from their CSV text."""

import csv
import math
import os
import re
import statistics
import subprocess
import sys

import pytest

from run_folders import (HEADER, SCRIPTS, curve, edit, fails, fresh_mean, groups_of, plot, summary,
                         write_run)
import pmeta_convergence as pc
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_runs as pr
import pmeta_tables as pt

PLOT = os.path.join(SCRIPTS, "plot.py")


@pytest.fixture
def sweep(tmp_path):
    """{(algorithm, lambda): [folder of seed 0, 1, 2]}; model averaging lacks seed 2."""
    folders = {("pmeta", value): [write_run(tmp_path, seed=s, lambda_=value) for s in range(3)]
               for value in (1, 10, 50)}
    folders["model_averaging", 0] = [write_run(tmp_path, "model_averaging", s) for s in range(2)]
    folders["independent", 0] = [write_run(tmp_path, "independent", s) for s in range(3)]
    return folders


def test_summary_is_what_the_files_say(tmp_path, sweep):
    plot(tmp_path, "--out", tmp_path / "out", "--format", "png", "--what", "sweep")
    rows = summary(tmp_path / "out")
    assert list(rows) == ["pMeta-RL λ=1", "pMeta-RL λ=10", "pMeta-RL λ=50", "model averaging",
                          "independent"]
    for value in (1, 10, 50):
        row = rows["pMeta-RL λ=%d" % value]
        assert row["seeds"] == "3"
        for policy, name in (("personal", "pp"), ("meta", "mp")):
            curves = [curve(folder, policy) for folder in sweep["pmeta", value]]
            for measure, values in (("last", [c[-1] for c in curves]),
                                    ("auc", [statistics.mean(c) for c in curves])):
                key = "%s_%s_" % (name, measure)
                assert float(row[key + "mean"]) == pytest.approx(statistics.mean(values), rel=1e-13)
                assert float(row[key + "std"]) == pytest.approx(statistics.stdev(values), rel=1e-9)


def test_differences_are_paired_by_seed(tmp_path, sweep):
    plot(tmp_path, "--out", tmp_path / "out", "--format", "png", "--what", "sweep")
    rows = summary(tmp_path / "out")
    for policy, name in (("personal", "pp"), ("meta", "mp")):
        differences = [statistics.mean(curve(ours, policy)) - statistics.mean(curve(theirs, "meta"))
                       for ours, theirs in zip(sweep["pmeta", 10], sweep["model_averaging", 0])]
        row = rows["pMeta-RL λ=10"]
        assert row["pairs"] == "2"
        assert float(row[name + "_minus_ma_auc"]) == pytest.approx(statistics.mean(differences))
        assert float(row[name + "_minus_ma_auc_se"]) == pytest.approx(
            statistics.stdev(differences) / math.sqrt(2))
    assert rows["model averaging"]["pairs"] == rows["independent"]["mp_last_mean"] == ""


def test_one_seed_has_no_spread(tmp_path):
    write_run(tmp_path)
    out, _ = plot(tmp_path, "--format", "png")
    row = summary(tmp_path / "figures")["pMeta-RL λ=10"]
    assert row["pp_last_mean"] and not row["pp_last_std"] and not row["pairs"]
    assert "±" not in out.split("Returns are")[0]


def test_writes_what_the_data_allow(tmp_path, sweep):
    out, err = plot(tmp_path)
    figures = tmp_path / "figures"
    names = sorted(os.listdir(str(figures)))
    assert names == ["best_returns.tex", "lambda_curves.pdf", "lambda_curves.png",
                     "lambda_table.tex", "learning_curves.pdf", "learning_curves.png",
                     "summary.csv", "summary.txt", "sweep_lambda.pdf", "sweep_lambda.png"]
    assert all("wrote " + str(figures / name) in out for name in names)
    assert (figures / "summary.txt").read_text(encoding="utf-8") in out
    assert (figures / "sweep_lambda.png").read_bytes().startswith(b"\x89PNG")
    assert (figures / "sweep_lambda.pdf").read_bytes().startswith(b"%PDF")
    assert err == ""


def test_same_runs_give_the_same_bytes(tmp_path):
    write_run(tmp_path)
    plot(tmp_path, "--out", tmp_path / "a")
    plot(tmp_path, "--out", tmp_path / "b")
    for name in os.listdir(str(tmp_path / "a")):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_and_format_limit_what_is_drawn(tmp_path, sweep):
    plot(tmp_path, "--what", "sweep", "--format", "pdf")
    assert sorted(os.listdir(str(tmp_path / "figures"))) == [
        "best_returns.tex", "lambda_table.tex", "summary.csv", "summary.txt", "sweep_lambda.pdf"]


def test_a_folder_for_every_experiment(tmp_path):
    write_run(tmp_path)
    write_run(tmp_path, experiment="other")
    plot(tmp_path, "--format", "png")
    for experiment in ("grid", "other"):
        assert (tmp_path / "figures" / experiment / "learning_curves.png").exists()


def test_a_run_given_twice_counts_once(tmp_path):
    folder = write_run(tmp_path)
    plot(folder, tmp_path, folder, "--out", tmp_path / "out", "--format", "png")
    assert summary(tmp_path / "out")["pMeta-RL λ=10"]["seeds"] == "1"


def test_lines_and_bands_show_mean_and_deviation(tmp_path, sweep):
    figure, axes = pd.panels(1, 1)
    group = groups_of(tmp_path)["grid"][1]
    pf.draw_curve(axes[0][0], group, "meta", "MP", **pf.MP)
    curves = list(zip(*(curve(folder, "meta") for folder in sweep["pmeta", 10])))
    line = axes[0][0].lines[0]
    assert list(line.get_xdata()) == [1, 2, 3, 4]
    assert list(line.get_ydata()) == pytest.approx([statistics.mean(c) for c in curves])
    edges = axes[0][0].collections[0].get_paths()[0].vertices
    last = sorted(y for x, y in edges if x == 4)
    middle, spread = statistics.mean(curves[-1]), statistics.stdev(curves[-1])
    assert (last[0], last[-1]) == pytest.approx((middle - spread, middle + spread))


def test_sweep_points_show_mean_and_standard_error(tmp_path, sweep):
    figure, axes = pd.panels(1, 1)
    groups = groups_of(tmp_path)["grid"]
    pf.draw_sweep(axes[0][0], "personal.lambda", groups[:3], "auc", groups)
    points, _, bars = axes[0][0].containers[0]
    assert list(points.get_xdata()) == [1, 10, 50]
    values = [statistics.mean(curve(folder, "meta")) for folder in sweep["pmeta", 10]]
    middle, error = statistics.mean(values), statistics.stdev(values) / math.sqrt(3)
    assert points.get_ydata()[1] == pytest.approx(middle)
    low, high = bars[0].get_segments()[1]
    assert (low[1], high[1]) == pytest.approx((middle - error, middle + error))


def test_labels_name_exactly_what_differs(tmp_path):
    for init in ("meta", "keep"):
        folder = write_run(tmp_path, run_id=init)
        edit(folder, "config.yaml", lambda t: t.replace("_init: meta", "_init: " + init))
    write_run(tmp_path, "model_averaging")
    labels = [group.label for group in groups_of(tmp_path)["grid"]]
    assert labels == ["pMeta-RL λ=10 personal_init=keep", "pMeta-RL λ=10 personal_init=meta",
                      "model averaging"]


def test_numbers_in_exponent_form_are_numbers(tmp_path):
    for alpha in ("1e-05", "0.00001"):
        folder = write_run(tmp_path, run_id=alpha, seed=int(alpha == "1e-05"))
        edit(folder, "config.yaml", lambda t: t.replace("alpha: 0.08", "alpha: " + alpha))
    assert len(groups_of(tmp_path)["grid"]) == 1


def test_curves_show_the_default_strength(tmp_path, sweep):
    pmeta = pf.pmeta_only(groups_of(tmp_path)["grid"])
    assert pr.reference(pmeta).settings["personal.lambda"] == 10
    assert pr.reference([g for g in pmeta if g.settings["personal.lambda"] != 10]).label in (
        "pMeta-RL λ=1", "pMeta-RL λ=50")


def test_baseline_must_share_the_other_settings(tmp_path):
    write_run(tmp_path, rounds=4)
    write_run(tmp_path, "model_averaging", rounds=6)
    plot(tmp_path, "--format", "png")
    assert summary(tmp_path / "figures")["pMeta-RL λ=10 C=4"]["pairs"] == ""


def test_optimum_only_if_every_task_has_it(tmp_path):
    write_run(tmp_path, optimal=(-4.0, -8.0), experiment="known")
    write_run(tmp_path, optimal=(-4.0,), experiment="half")
    groups = groups_of(tmp_path)
    assert groups["known"][0].optimal() == -6
    assert groups["half"][0].optimal() is None


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


def test_repeated_baseline_counts_once_in_silence(tmp_path):
    for name in ("a", "b"):
        write_run(tmp_path, "model_averaging", run_id=name)
    _, err = plot(tmp_path, "--format", "png")
    assert err == ""
    assert summary(tmp_path / "figures")["model averaging"]["seeds"] == "1"


def test_the_newer_of_two_differing_runs_counts(tmp_path):
    old = write_run(tmp_path, run_id="z", started="2026-01-01")
    new = write_run(tmp_path, run_id="a", started="2026-01-02", scale=2)
    _, err = plot(tmp_path, "--format", "png")
    assert old + " is left out" in err
    row = summary(tmp_path / "figures")["pMeta-RL λ=10"]
    assert float(row["mp_last_mean"]) == pytest.approx(curve(new, "meta")[-1])


@pytest.mark.parametrize("change, line, words", [
    (lambda t: t[:-1], 17, "truncated"),
    (lambda t: t[:-20], 17, "truncated"),
    (lambda t: t.replace(",1.5,15,100,", ",1.5,15,", 1), 2, "10 fields instead of 11"),
    (lambda t: t.replace("1,1,train", "1,x,train", 1), 3, "task is 'x'"),
    (lambda t: t.replace(",1.5,15,", ",nan,15,", 1), 2, "return_std is 'nan'"),
    (lambda t: t.replace("train", "trial", 1), 2, "'trial'"),
    (lambda t: t.replace("1,0,train", "0,0,train", 1), 2, "out of range"),
    (lambda t: t.replace("1,1,train", "1,0,train", 1), 3, "repeats round 1, task 0"),
    (lambda t: t.replace("round,", "turn,"), 1, "header"),
    (lambda t: "", 1, "empty"),
    (lambda t: t + "\n", 18, "1 fields"),
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


def test_averaging_without_meta_returns_is_no_baseline(tmp_path):
    for value in (5, 10):
        write_run(tmp_path, lambda_=value)
    folder = write_run(tmp_path, "model_averaging")
    edit(folder, "rounds.csv",
         lambda t: "".join(l for l in t.splitlines(True) if ",meta," not in l))
    plot(tmp_path, "--format", "png")
    assert summary(tmp_path / "figures")["pMeta-RL λ=5"]["pairs"] == ""


def test_baselines_alone_are_drawn(tmp_path):
    write_run(tmp_path, "independent")
    write_run(tmp_path, "model_averaging")
    plot(tmp_path, "--format", "png")
    assert (tmp_path / "figures" / "learning_curves.png").exists()


def test_a_reader_that_stops_early_is_no_error(tmp_path):
    write_run(tmp_path)
    done = subprocess.run("set -o pipefail; '%s' '%s' --format png | true" % (PLOT, tmp_path),
                          shell=True, executable="/bin/bash", stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "figures" / "summary.txt").exists()


def test_help():
    out = subprocess.run([PLOT, "--help"], stdout=subprocess.PIPE, check=True,
                         universal_newlines=True).stdout
    assert "--what" in out and "figures" in out


def test_refusal_ends_with_status_1(tmp_path):
    done = subprocess.run([PLOT, str(tmp_path)], stderr=subprocess.PIPE, universal_newlines=True)
    assert done.returncode == 1
    assert done.stderr.startswith("plot: there are no runs in") and done.stderr.count("\n") == 1


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
                      learner="dqn", fresh=100) for s in range(3)]
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


def table_row(text, *words):
    """The one line that holds all the words."""
    lines = [line for line in text.split("\n") if all(word in line for word in words)]
    assert len(lines) == 1, lines
    return lines[0]


def test_the_paper_stands_beside_what_corresponds(drawn):
    out = drawn[0].split("best returns", 1)[1].split("Returns are")[0]
    ends = [re.split(" {2,}", line.strip())[-2:] for line in out.strip().split("\n")]
    assert ends == [["paper, λ", "paper, best"],
                    ["-93.05 ± 1.07", "-"], ["-111.15 ± 4.31", "-"],
                    ["-92.13 ± 0.95", "-93.05 ± 0.95"], ["-107.08 ± 3.21", "-107.15 ± 4.10"],
                    ["-", "-"], ["-", "-111.34 ± 5.95"],
                    ["-", "-92.96 ± 2.08"], ["-", "-133.96 ± 3.25"]]
    assert re.search(r"independent +PP \(DQN\*\) ", out) and " all (DQN) " in out


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
    (lambda t: t[:t.rindex("best")], "has the meta returns (best) of 1 of 2 tasks"),
    (lambda t: t.replace(",2.5,", ",", 1), "8 fields instead of 9"),
])
def test_malformed_fresh_returns_are_refused(tmp_path, change, words):
    path = edit(write_run(tmp_path, fresh=100), "final.csv", change)
    message = fails(tmp_path)
    assert path in message and words in message


@pytest.fixture
def convergence(tmp_path):
    """Results that follow the theory exactly."""
    folder = tmp_path / "convergence" / "run"
    folder.mkdir(parents=True)
    lambdas = (1, 5, 10)
    files = {
        "manifest.json": '{"status": "finished", "seed": 0}',
        "statements.csv": "statement,setting,measured,bound,holds,remark\n",
        "contraction.csv": "lambda,pairs,worst_pair,worst_shift,bound\n" + "".join(
            "%g,9,%r,%r,%r\n" % (v, 0.9 / (1 + v), 0.9 / (1 + v), 0.9 / (1 + v))
            for v in (0,) + lambdas),
        "fixed_point.csv": "lambda,update,sweeps,distance\n" + "".join(
            "%g,%s,%d,%r\n" % (v, update, k, 0.0 if update == "exact" and k > 10 else 3.0 / k)
            for v in lambdas for update in ("exact", "robbins_monro") for k in (1, 10, 100)),
        "gradient.csv": "diversity,lambda,step,eta,round,grad_norm2,running_mean,shape,distance2\n"
        + "".join("%s,%g,%s,0.1,%d,%r,%r,%r,1\n" % (tasks, v, step, c, v / c, v / c, c ** -0.5)
                  for tasks in ("corner", "centre", "random") for v in lambdas
                  for step in ("used", "allowed") for c in range(1, 21)),
        "distance.csv": "diversity,lambda,distance2,entry_distance2,entry_bound\n" + "".join(
            "%s,%g,%r,%r,%s\n" % (tasks, v, 9.0 / v ** 2, 1.0 / v ** 2, "nan" if v < 3 else "7")
            for tasks in ("corner", "centre") for v in lambdas),
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def test_convergence_figures(tmp_path, convergence):
    plot(tmp_path, "--what", "convergence", "--format", "png", "--out", tmp_path / "out")
    assert sorted(os.listdir(str(tmp_path / "out"))) == [
        "convergence_%s.png" % name
        for name in ("contraction", "distance", "fixed_point", "gradient")]


def test_convergence_slopes_are_measured(tmp_path, convergence):
    class Kept(pd.Figures):
        def save(self, figure, name):
            self.written.append(figure)

    kept = Kept("", ())
    pc.draw_convergence(pr.load_convergence([str(convergence)]), kept)
    contraction, _, gradient, distance = kept.written
    line = contraction.axes[0].lines[0]
    assert list(line.get_ydata() * line.get_xdata()) == pytest.approx([0.9] * 50)
    labels = [text.get_text() for text in gradient.axes[0].get_legend().get_texts()]
    assert labels[0] == "λ=1, η=0.1: slope −1.00" and labels[-1] == "theory, scaled: slope −0.50"
    labels = [text.get_text() for text in distance.axes[1].get_legend().get_texts()]
    assert labels[:2] == ["corner: slope −2.00", "centre: slope −2.00"]


def test_broken_convergence_files_are_refused(tmp_path, convergence):
    path = edit(str(convergence), "gradient.csv", lambda t: t.replace("running_mean", "mean", 1))
    assert path + " line 1: the column 'running_mean' is missing" in fails(tmp_path)
    edit(str(convergence), "gradient.csv", lambda t: t.replace("used,0.1", "used,high", 1))
    assert path + " line 2: eta is 'high'" in fails(tmp_path)


def test_convergence_without_a_manifest_has_not_finished(tmp_path, convergence):
    (convergence / "manifest.json").unlink()
    assert "none of the 1 runs" in fails(tmp_path)


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
