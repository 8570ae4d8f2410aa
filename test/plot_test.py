"""Tests of `pmeta plot`: run folders written here, numbers worked out here from their CSV text."""

import math
import os
import re
import statistics
import subprocess
import sys

import pytest

from run_folders import (SCRIPTS, Kept, curve, edit, fails, fresh_mean, groups_of, lines_of,
                         over_seeds, plot, rows_of, summary, table_row, write_run)
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_groups as pg
import pmeta_runs as pr

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
    with open(os.path.join(SCRIPTS, "..", "include", "pmeta_nodes", "scene_parts.h"), encoding="utf-8") as file:
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


def test_names_are_drawn_as_they_are_with_boxes_for_letters_without_a_font(tmp_path, recwarn):
    folder = write_run(tmp_path, fresh=3)
    edit(folder, "manifest.json", lambda t: t.replace("zeta 3,", "\u96ea $a_1$ 3,"))
    _, err = plot(tmp_path)
    assert (tmp_path / "figures" / "tasks_last.png").exists()
    assert "lacks letters of" in err and not [w for w in recwarn if "lyph" in str(w.message)]
    assert pd.plain("costs $5, or $6") == r"costs \$5, or \$6"
    assert pd.plain(pd.plain("$a$")) == r"\$a\$"


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
