"""Tests of `pmeta plot`: run folders written here, numbers worked out here from their CSV text."""

import csv
import json
import math
import os
import re
import statistics
import subprocess
import sys

import pytest

from run_folders import (HEADER, SCRIPTS, Kept, curve, edit, fails, fresh_mean, groups_of,
                         make_older, plot, rows_of, summary, write_run)
import pmeta_convergence as pc
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_groups as pg
import pmeta_runs as pr
import pmeta_tables as pt
import pmeta_unseen as pu

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


def test_lines_and_bands_show_mean_and_interval(tmp_path, sweep):
    figure, axes = pd.panels(1, 1)
    group = groups_of(tmp_path)["grid"][1]
    pf.draw_curve(axes[0][0], group, "meta", "MP", **pf.MP)
    curves = list(zip(*(curve(folder, "meta") for folder in sweep["pmeta", 10])))
    line = axes[0][0].lines[0]
    assert list(line.get_xdata()) == [1, 2, 3, 4]
    assert list(line.get_ydata()) == pytest.approx([statistics.mean(c) for c in curves])
    edges = axes[0][0].collections[0].get_paths()[0].vertices
    last = sorted(y for x, y in edges if x == 4)
    # of three seeds one alone is drawn with 1/27, which is above 2.5 %
    assert (last[0], last[-1]) == pytest.approx((min(curves[-1]), max(curves[-1])))


def test_sweep_points_show_mean_and_interval(tmp_path, sweep):
    figure, axes = pd.panels(1, 1)
    groups = groups_of(tmp_path)["grid"]
    pf.draw_sweep(axes[0][0], "personal.lambda", groups[:3], "auc", groups)
    points, _, bars = axes[0][0].containers[0]
    assert list(points.get_xdata()) == [1, 10, 50]
    values = [statistics.mean(curve(folder, "meta")) for folder in sweep["pmeta", 10]]
    assert points.get_ydata()[1] == pytest.approx(statistics.mean(values))
    low, high = bars[0].get_segments()[1]
    assert (low[1], high[1]) == pytest.approx((min(values), max(values)))


def test_the_colours_of_the_policies_are_those_of_rviz():
    with open(os.path.join(SCRIPTS, "..", "src", "draw", "scene_parts.h"), encoding="utf-8") as file:
        text = file.read()
    for name, color in (("kPersonal", pd.PP_COLOR), ("kMeta", pd.MP_COLOR)):
        assert "%s = rgb(0x%s)" % (name, color[1:].lower()) in text
    assert pf.PP["color"] == pf.TASK_STYLES["personal"][1] == pd.PP_COLOR
    assert pf.MP["color"] == pf.TASK_STYLES["meta"][1] == pd.MP_COLOR
    styles = pd.BASELINE_STYLES
    for what in ("color", "linestyle", "marker"):
        assert len(set(style[what] for style in styles)) >= len(styles) - 1 == 7, what
    assert len(set([s["color"] for s in styles] + [pd.PP_COLOR, pd.MP_COLOR])) == len(styles) + 2


def test_figures_say_what_their_bands_are(tmp_path, sweep):
    kept = Kept()
    figures = {kind: kept for kind in ("curves", "sweep", "tasks")}
    pf.draw_runs(groups_of(tmp_path), ("curves", "sweep"), figures)
    titles = [figure._suptitle.get_text() for figure, _ in kept.written]
    assert len(titles) == 3 and all("mean and its 95 % interval over 3 seeds" in t or
                                    "mean and its 95 % interval over 2 to 3 seeds" in t
                                    for t in titles), titles


def test_coordinates_stay_together():
    assert pd.wrapped_name("goal (-0.81, -0.59), radius 0.2", 12).replace("\xa0", " ") == (
        "goal (-0.81, -0.59),\nradius 0.2")
    assert pd.wrapped_name("goal (0.81, 0.59), radius 0.2", 18).replace("\xa0", " ") == (
        "goal (0.81, 0.59),\nradius 0.2")
    manifest = {"tasks": [{"task": i, "description": "goal (%d, 1), r 2" % i} for i in range(2)]}
    assert pr._task_names(manifest, 2) == ["goal (0, 1)", "goal (1, 1)"]


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
    ours = pg.without_baselines(groups_of(tmp_path)["grid"])
    assert pg.reference(ours).settings["personal.lambda"] == 10
    assert pg.reference([g for g in ours if g.settings["personal.lambda"] != 10]).label in (
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


def table_row(text, *words):
    """The one line that holds all the words."""
    lines = [line for line in text.split("\n") if all(word in line for word in words)]
    assert len(lines) == 1, lines
    return lines[0]


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


def test_interquartile_means_and_comparisons_follow_from_the_files(tmp_path, sweep):
    out, _ = plot(tmp_path, "--what", "sweep", "--format", "png")
    rows = summary(tmp_path / "figures")
    last = {key: [[float(row["return_mean"]) for row in rows_of(folder, "meta")
                   if row["round"] == "4"] for folder in folders]
            for key, folders in sweep.items() if key[0] != "independent"}
    ours, theirs = last["pmeta", 10], last["model_averaging", 0]
    flat = sorted(value for run in ours for value in run)
    row = rows["pMeta-RL λ=10"]
    assert float(row["mp_last_iqm"]) == pytest.approx(statistics.mean(flat[1:5]))
    assert flat[0] <= float(row["mp_last_iqm_low"]) < float(row["mp_last_iqm_high"]) <= flat[-1]
    wins = statistics.mean((a[task] > b[task]) + (a[task] == b[task]) / 2
                           for task in range(2) for a in ours for b in theirs)
    line = table_row(out.split("comparisons")[1], "MP of pMeta-RL λ=10 ", "model averaging")
    assert "%.2f [" % wins in line and "3, 2" in line
    assert rows["independent"]["mp_last_iqm"] == ""


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


def test_names_are_drawn_as_they_are_with_boxes_for_letters_without_a_font(tmp_path, recwarn):
    folder = write_run(tmp_path, fresh=3)
    edit(folder, "manifest.json", lambda t: t.replace("zeta 3,", "\u96ea $a_1$ 3,"))
    _, err = plot(tmp_path)
    assert (tmp_path / "figures" / "tasks_last.png").exists()
    assert "lacks letters of" in err and not [w for w in recwarn if "lyph" in str(w.message)]
    assert pd.plain("costs $5, or $6") == r"costs \$5, or \$6"
    assert pd.plain(pd.plain("$a$")) == r"\$a\$"


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


@pytest.fixture
def adapting(tmp_path):
    """Folders of seeds 0, 1, 2: test tasks, and exploration episodes to adapt from."""
    return [write_run(tmp_path, seed=s, contexts=(0, 1, 3), tests=3, fresh=100, own_best=True,
                      learner="sac") for s in range(3)]


def lines_of(axis):
    """{label: (x, y)} of what the legend names."""
    return {line.get_label(): (list(line.get_xdata()), list(line.get_ydata()))
            for line in axis.lines if not line.get_label().startswith("_")}


def over_seeds(folders, *arguments, **named):
    """Mean over seeds of a curve, straight from the files."""
    return [statistics.mean(v) for v in zip(*(curve(f, *arguments, **named) for f in folders))]


def test_mp_is_that_after_adaptation(tmp_path, adapting):
    plot(tmp_path, "--out", tmp_path / "out", "--format", "png", "--what", "curves")
    row = summary(tmp_path / "out")["pMeta-RL λ=10"]
    for name, split, measure, pick in (("mp_last", "train", "last", lambda c: c[-1]),
                                       ("mp_auc", "train", "auc", statistics.mean),
                                       ("mp_best", "train", "best", max),
                                       ("mp_test_last", "test", "last", lambda c: c[-1])):
        values = [pick(curve(folder, "meta", split, 3)) for folder in adapting]
        assert float(row[name + "_mean"]) == pytest.approx(statistics.mean(values)), measure
        assert float(row[name + "_std"]) == pytest.approx(statistics.stdev(values)), measure
    values = [curve(folder, "meta", "train", 0)[-1] for folder in adapting]
    assert float(row["mp_last_mean"]) != pytest.approx(statistics.mean(values))


def test_curves_before_adaptation_and_on_test_tasks(tmp_path, adapting):
    kept = Kept()
    pf.learning_curves("grid", groups_of(tmp_path)["grid"], kept, "")
    [(figure, _)] = kept.written
    lines = lines_of(figure.axes[0])
    assert list(lines) == ["MP, pMeta-RL λ=10", "PP, pMeta-RL λ=10", "MP before adaptation",
                           "MP, test tasks, after 0 episodes", "MP, test tasks, after 1 episode",
                           "MP, test tasks, after 3 episodes"]
    for label, arguments in (("MP, pMeta-RL λ=10", ("meta", "train", 3)),
                             ("MP before adaptation", ("meta", "train", 0)),
                             ("MP, test tasks, after 0 episodes", ("meta", "test", 0)),
                             ("MP, test tasks, after 1 episode", ("meta", "test", 1)),
                             ("MP, test tasks, after 3 episodes", ("meta", "test", 3))):
        assert lines[label] == ([1, 2, 3, 4], pytest.approx(over_seeds(adapting, *arguments)))


def test_unseen_tasks_show_what_the_files_say(tmp_path, adapting):
    kept = Kept()
    pu.draw_unseen(groups_of(tmp_path), kept)
    [(figure, name)] = kept.written
    assert name == "grid_unseen_tasks"
    curves, tasks = figure.axes
    labels = {"MP, %s tasks, after %d episode%s" % (word, count, "" if count == 1 else "s"):
              (split, count) for word, split in (("training", "train"), ("test", "test"))
              for count in (0, 1, 3)}
    lines = lines_of(curves)
    assert list(lines) == list(labels)
    for label, key in labels.items():
        assert lines[label][1] == pytest.approx(over_seeds(adapting, "meta", *key))
    styles = [(line.get_color(), line.get_linestyle()) for line in curves.lines]
    assert len(set(styles)) == 6 and len(set(style for _, style in styles)) == 3
    edges = curves.collections[-1].get_paths()[0].vertices
    last = [curve(folder, "meta", "test", 3)[-1] for folder in adapting]
    assert max(y for x, y in edges if x == 4) == pytest.approx(max(last))
    # the last round: before and after, training and test tasks
    points = lines_of(tasks)
    assert list(points) == [label for label, key in labels.items() if key[1] != 1]
    for label, (values, places) in points.items():
        rows = [[r for r in rows_of(folder, "meta", *labels[label]) if r["round"] == "4"]
                for folder in adapting]
        assert values == pytest.approx([statistics.mean(float(r["return_mean"]) for r in of_task)
                                        for of_task in zip(*rows)])
        assert [round(y) for y in places] == [int(r["task"]) for r in rows[0]]
    assert [text.get_text().replace("\xa0", " ") for text in tasks.get_yticklabels()] == [
        "zeta 3", "zeta 3.5", "test: zeta 4", "test: zeta 4.5", "test: zeta 5"]


def test_long_task_names_do_not_touch(tmp_path):
    names = ["model of task_seed 3436146%d: 26.%d kg (base 23.7), friction of the feet 0.81 and 6.%d"
             % (i, i, i) for i in range(10, 22)]
    path = os.path.join(write_run(tmp_path, tests=10), "manifest.json")
    with open(path) as file:
        manifest = json.load(file)
    for task, name in zip(manifest["tasks"], names):
        task["description"] = name
    with open(path, "w") as file:
        json.dump(manifest, file)
    kept = Kept()
    pu.draw_unseen(groups_of(tmp_path), kept)
    pf.task_figure("grid", groups_of(tmp_path)["grid"], kept, "")
    found = 0
    for figure, _ in kept.written:
        figure.canvas.draw()
        for axis in figure.axes:
            boxes = [text.get_window_extent() for text in axis.get_yticklabels()
                     if "kg" in text.get_text()]
            found += len(boxes)
            assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert found == 12 + 2
    assert pd.wrapped_name(names[0]).replace("\xa0", " ").split("\n") == [
        "model of task_seed 343614610:", "26.10 kg (base 23.7),",
        "friction of the feet 0.81 and 6.10"]


def test_unseen_tasks_are_drawn_only_where_there_are_any(tmp_path, adapting):
    write_run(tmp_path, "independent", experiment="other")
    write_run(tmp_path, experiment="tests", tests=2)
    _, err = plot(tmp_path, "--what", "unseen", "--format", "png", "--out", tmp_path / "out")
    assert err == ""
    assert [os.path.join(os.path.basename(folder), name)
            for folder, _, names in sorted(os.walk(str(tmp_path / "out"))) for name in names
            if "unseen" in name] == ["grid/grid_unseen_tasks.png", "tests/tests_unseen_tasks.png"]
    # nothing adapts there
    kept = Kept()
    pu.draw_unseen({"tests": groups_of(tmp_path)["tests"]}, kept)
    assert list(lines_of(kept.written[0][0].axes[0])) == ["MP, training tasks", "MP, test tasks"]
    assert "nothing to draw for unseen" in fails(tmp_path / "other", "--what", "unseen")


def test_fresh_returns_on_test_tasks_and_of_own_best_policies(tmp_path, adapting):
    out, err = plot(tmp_path, "--format", "png", "--out", tmp_path / "out")
    row = summary(tmp_path / "out")["pMeta-RL λ=10"]
    for column, arguments in (("pp_fresh_own_best", ("own_best", "personal")),
                              ("pp_fresh_best", ("best", "personal")),
                              ("mp_fresh_best", ("best", "meta")),
                              ("mp_test_fresh_best", ("best", "meta", True, "test")),
                              ("mp_test_fresh_last", ("last", "meta", True, "test"))):
        values = [fresh_mean(folder, *arguments) for folder in adapting]
        assert float(row[column + "_mean"]) == pytest.approx(statistics.mean(values))
        assert float(row[column + "_std"]) == pytest.approx(statistics.stdev(values))
    head, pp, mp, tests = [re.split(" {2,}", line.strip()) for line in
                           out.split("best returns\n")[1].split("\n")[:4]]
    assert head[2:] == ["best", "fresh (best)", "fresh (own best)", "fresh (last)"]
    own = "%.2f ± %.2f" % tuple(float(row["pp_fresh_own_best_" + s]) for s in ("mean", "std"))
    assert pp[4] == own and mp[3] == "-"
    assert tests[:2] == ["MP on test tasks", "-"] and tests[3] == "-"
    assert "best on its own task" in out and "MP test last" in out and err == ""
    assert "MP is after adaptation" in out
    tex = (tmp_path / "out/best_returns.tex").read_text(encoding="utf-8")
    assert "best & fresh & fresh, own best" in tex and "episodes; own best: each" in tex
    assert own.replace("±", "\\pm") in table_row(tex, ", PP &")
    with open(str(tmp_path / "out/tasks_last.csv"), encoding="utf-8") as file:
        tests = [r for r in csv.DictReader(file)
                 if (r["policies"], r["snapshot"]) == ("meta_test", "last")]
    assert [(r["task"], r["name"]) for r in tests] == [("2", "zeta 4"), ("3", "zeta 4.5"),
                                                       ("4", "zeta 5")]


def test_an_unknown_own_best_round_is_told(tmp_path):
    folder = write_run(tmp_path, fresh=100, own_best=True)
    edit(folder, "final.csv", lambda t: t[:t.rindex("own_best")])
    out, err = plot(tmp_path, "--format", "png")
    assert "own_best returns of 1 of 2 tasks: they are left out" in err
    assert "own best" not in out


def test_older_files_are_read(tmp_path):
    write_run(tmp_path / "new", fresh=100)
    old = write_run(tmp_path / "old", fresh=100)
    make_older(old)
    with open(os.path.join(old, "rounds.csv")) as file:
        assert "context" not in file.readline()
    for top in ("new", "old"):
        plot(tmp_path / top, "--format", "png", "--out", tmp_path / top / "out")
    for name in os.listdir(str(tmp_path / "new/out")):
        assert (tmp_path / "new/out" / name).read_bytes() == (
            tmp_path / "old/out" / name).read_bytes(), name


def test_test_tasks_must_follow_the_training_tasks(tmp_path):
    path = edit(write_run(tmp_path, tests=1), "rounds.csv",
                lambda t: t.replace(",2,test", ",1,test"))
    assert fails(tmp_path) == ("plot: %s: the test task 1 does not follow the 2 training tasks."
                               % path)


def test_the_optimum_is_that_of_the_training_tasks(tmp_path):
    folder = write_run(tmp_path, tests=1, optimal=(-4.0, -8.0, -30.0))
    assert groups_of(tmp_path)["grid"][0].optimal() == -6
    edit(folder, "manifest.json", lambda t: t.replace(', "optimal_return": -30.0', ""))
    assert groups_of(tmp_path)["grid"][0].optimal() == -6


def test_pooled_is_a_baseline(tmp_path):
    folders = {name: [write_run(tmp_path, name, s, fresh=100, learner="dqn") for s in range(2)]
               for name in ("pmeta", "independent", "pooled")}
    # what pooled does not use tells no two of its groups apart
    edit(folders["pooled"][1], "config.yaml", lambda t: t.replace("eta: 0.08", "eta: 0.5")
         .replace("beta: 0", "beta: 1"))
    groups = groups_of(tmp_path)["grid"]
    assert [group.label for group in groups] == ["pMeta-RL λ=10", "independent", "pooled"]
    kept = Kept()
    pf.learning_curves("grid", groups, kept, "")
    lines = lines_of(kept.written[0][0].axes[0])
    assert lines["PP, pooled"][1] == pytest.approx(over_seeds(folders["pooled"], "personal"))
    out, _ = plot(tmp_path, "--format", "png", "--out", tmp_path / "out")
    values = [fresh_mean(f, "best", "personal", own=False) for f in folders["pooled"]]
    row = summary(tmp_path / "out")["pooled"]
    assert float(row["all_fresh_best_mean"]) == pytest.approx(statistics.mean(values))
    cells = re.split(" {2,}", table_row(out, "pooled DQN on all tasks  ").strip())
    assert cells[2] == "%.2f ± %.2f" % (statistics.mean(values), statistics.stdev(values))


@pytest.mark.parametrize("lengths", [{"rounds": 8}, {"updates": 3}])
def test_rounds_of_different_lengths_are_drawn_over_environment_steps(tmp_path, lengths):
    ours = [write_run(tmp_path, seed=s) for s in range(2)]
    theirs = [write_run(tmp_path, "model_averaging", s, **lengths) for s in range(2)]
    kept = Kept()
    pf.learning_curves("grid", groups_of(tmp_path)["grid"], kept, "")
    axis = kept.written[0][0].axes[0]
    assert axis.get_xlabel() == "environment steps a task"
    lines = list(lines_of(axis).values())
    assert len(lines) == 3
    for (x, y), folders in ((lines[0], ours), (lines[2], theirs)):
        assert x == pytest.approx(over_seeds(folders, "personal", column="env_steps"))
        assert y == pytest.approx(over_seeds(folders, "meta"))
    assert axis.get_xlim()[1] >= lines[2][0][-1]
    label = list(lines_of(axis))[2]
    assert label == "MP, model averaging " + ("C=8" if "rounds" in lengths else "R=3")
    # over rounds their means differ in meaning: nothing is paired
    plot(tmp_path, "--format", "png")
    assert list(summary(tmp_path / "figures").values())[0]["pairs"] == ""


def test_curves_of_a_length_setting_are_over_environment_steps(tmp_path):
    for updates in (1, 5):
        write_run(tmp_path, updates=updates, run_id="r%d" % updates)
    kept = Kept()
    pf.draw_runs(groups_of(tmp_path), ("curves",), {"curves": kept, "sweep": kept})
    figure = dict((name, figure) for figure, name in kept.written)["updates_per_round_curves"]
    assert [axis.get_xlabel() for axis in figure.axes] == ["environment steps a task"] * 2
    assert lines_of(figure.axes[1])["R=5"][0] == [550, 1100, 1650, 2200]


def test_presets_are_told_apart_by_their_settings(tmp_path):
    for seed, preset in enumerate(("quick", "paper")):
        edit(write_run(tmp_path, seed=seed), "config.yaml",
             lambda t: "preset: %s\n%s" % (preset, t))
    assert [len(group.runs) for group in groups_of(tmp_path)["grid"]] == [2]


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
    kept = Kept()
    pc.draw_convergence(pr.load_convergence([str(convergence)]), kept)
    contraction, _, gradient, distance = [figure for figure, _ in kept.written]
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


def test_rounds_that_did_not_evaluate_are_not_missed(tmp_path):
    """With evaluation_interval 3, a run of 4 rounds has returns of the rounds 3 and 4."""
    folder = write_run(tmp_path)
    edit(folder, "config.yaml", lambda text: text + "evaluation_interval: 3\n")
    edit(folder, "rounds.csv", lambda text: "".join(
        line for line in text.splitlines(True) if not line.startswith(("1,", "2,"))))
    plot(tmp_path, "--out", tmp_path / "out")
    group, = groups_of(tmp_path)["grid"]
    assert list(group.rounds) == [3, 4]
    assert list(group.curves("meta")[0]) == curve(folder, "meta")
    edit(folder, "rounds.csv", lambda text: "".join(
        line for line in text.splitlines(True) if not line.startswith("3,")))
    assert "has no" in fails(tmp_path, "--out", tmp_path / "out")
