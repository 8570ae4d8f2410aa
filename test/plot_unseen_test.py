"""Tests of `pmeta plot` on runs that adapt and have test tasks."""

import csv
import json
import os
import re
import statistics

import pytest

from run_folders import (Kept, curve, edit, fails, fresh_mean, groups_of, lines_of, make_older,
                         over_seeds, plot, rows_of, summary, table_row, write_run)
import pmeta_drawing as pd
import pmeta_figures as pf
import pmeta_unseen as pu


@pytest.fixture
def adapting(tmp_path):
    """Folders of seeds 0, 1, 2: test tasks, and exploration episodes to adapt from."""
    return [write_run(tmp_path, seed=s, contexts=(0, 1, 3), tests=3, fresh=100, own_best=True,
                      learner="sac") for s in range(3)]


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
