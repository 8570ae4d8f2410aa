"""Tests of what sets ours beside methods that learn all tasks at once: figures and margins."""

import csv
import os
import shutil
import statistics

import pytest

from programs import LOCAL, TOP, run
from run_folders import (Kept, call, curve, edit, fails, groups_of, plot, summary, write_at_once,
                         write_run)
import pmeta_archives as pa
import pmeta_figures as pf
import pmeta_margins as pm
import pmeta_method_curves as pmc
import pmeta_runs as pr
import pmeta_statistics as ps
import pmeta_trajectories as pmt
import report
import results

EXPERIMENT = "half_cheetah_dir"  # of which the paper has a margin


def lines_of(axis):
    return {line.get_label(): line for line in axis.lines if not line.get_label().startswith("_")}


def mean_of(folders, *arguments, **named):
    return [statistics.mean(v) for v in zip(*(curve(f, *arguments, **named) for f in folders))]


def total_steps(folders, policy="meta"):
    return [2 * v for v in mean_of(folders, policy, column="env_steps")]


@pytest.fixture
def mixed(tmp_path):
    """{algorithm: [folder of seed 0, 1, 2]}, one of them longer than the others."""
    return {
        "pmeta": [write_run(tmp_path, seed=s, experiment=EXPERIMENT, learner="sac", rounds=4)
                  for s in range(3)],
        "independent": [write_run(tmp_path, "independent", s, experiment=EXPERIMENT, learner="sac")
                        for s in range(2)],
        "pearl": [write_at_once(tmp_path, "pearl", 5, 20, EXPERIMENT, seed=s, contexts=(0, 2),
                                tests=2, scale=2) for s in range(3)],
        "maml": [write_at_once(tmp_path, "maml", 4, 10, EXPERIMENT, seed=0, contexts=(0, 2, 20),
                               tests=2)]}


def drawn(tmp_path, draw):
    kept = Kept()
    draw(groups_of(tmp_path), kept)
    return kept.written


def test_such_runs_alone_have_no_columns_of_personal_policies(tmp_path):
    folder = write_at_once(tmp_path, contexts=(0, 2), tests=1)
    out, err = plot(tmp_path, "--format", "png")
    assert err == "" and "PP" not in out.split("Returns are")[0] and "MP - MA" not in out.split(
        "Returns are")[0]
    assert "nan" not in out
    row = summary(tmp_path / "figures")["GAMMA"]
    assert float(row["mp_last_mean"]) == pytest.approx(curve(folder, "meta")[-1])
    assert row["pp_last_mean"] == ""
    names = os.listdir(str(tmp_path / "figures"))
    assert {"learning_curves.png", "grid_unseen_tasks.png", "tasks_last.png"} <= set(names)
    # there is nothing to set it beside
    assert not [name for name in names if "comparison" in name or "margins" in name]
    assert "no method that learns all tasks at once" in fails(tmp_path, "--what", "comparison")


def test_what_an_algorithm_has_no_use_for_tells_it_from_nobody(tmp_path, mixed):
    [groups] = groups_of(tmp_path).values()
    assert [group.label for group in groups] == [
        "pMeta-RL λ=10 C=4", "independent C=4", "MAML C=10", "PEARL C=20"]
    kept = Kept()
    pf.learning_curves(EXPERIMENT, groups, kept, "")
    assert list(lines_of(kept.written[0][0].axes[0])) == [
        "MP, pMeta-RL λ=10", "PP, pMeta-RL λ=10", "PP, independent", "MP, MAML C=10",
        "MP, PEARL C=20"]


def test_all_of_it_is_drawn_and_told(tmp_path):
    write_run(tmp_path)
    write_at_once(tmp_path, contexts=(0, 2), tests=1)
    out, err = plot(tmp_path, "--what", "comparison,unseen", "--format", "png", "--out",
                    tmp_path / "out")
    assert err == ""
    assert {"comparison.png", "comparison_unseen.png", "margins.csv"} <= set(
        os.listdir(str(tmp_path / "out")))
    assert "margins over other methods" in out and "Margin: (ours - theirs)" in out
    page = tmp_path / "report.html"
    call(report.main, tmp_path, "-o", page)
    text = page.read_text(encoding="utf-8")
    assert "Margins over other methods" in text and "All methods beside ours" in text


def test_methods_are_compared_over_all_steps_after_as_many_episodes(tmp_path, mixed):
    [(figure, name)] = drawn(tmp_path, pmc.draw_comparison)
    assert name == "comparison"
    [axis] = figure.axes
    assert axis.get_title("left") == EXPERIMENT + ", after 2 episodes"
    lines = lines_of(axis)
    assert list(lines) == ["PP, pMeta-RL", "MP, pMeta-RL", "PP, independent", "MAML", "PEARL"]
    for label, algorithm, arguments in (
            ("PP, pMeta-RL", "pmeta", ("personal",)), ("MP, pMeta-RL", "pmeta", ("meta",)),
            ("PP, independent", "independent", ("personal",)),
            ("MAML", "maml", ("meta", "train", 2)), ("PEARL", "pearl", ("meta", "train", 2))):
        folders = mixed[algorithm]
        assert list(lines[label].get_xdata()) == pytest.approx(
            total_steps(folders, arguments[0])), label
        expected = mean_of(folders, *arguments)
        assert list(lines[label].get_ydata()) == pytest.approx(expected), label
        # the final performance is dotted: of 20 evaluations the mean of two
        final = statistics.mean(expected[-max(1, len(expected) // 10):])
        dotted = [line for line in axis.lines if line.get_linestyle() == ":"
                  and line.get_color() == lines[label].get_color()]
        assert [line.get_ydata()[0] for line in dotted] == pytest.approx([final]), label
    looks = [(line.get_color(), line.get_linestyle(), line.get_marker())
             for line in lines.values()]
    assert len(set(looks)) == len(looks)
    assert axis.get_xscale() == "linear" and axis.get_xlim()[1] >= total_steps(mixed["pearl"])[-1]


def test_lengths_that_are_unlike_have_a_logarithmic_axis(tmp_path):
    write_run(tmp_path)
    write_at_once(tmp_path, rounds=25)
    [(figure, _)] = drawn(tmp_path, pmc.draw_comparison)
    assert figure.axes[0].get_xscale() == "log"


def test_ours_that_is_told_its_task_stands_beside_ours_that_explores(tmp_path):
    write_run(tmp_path, learner="dqn")
    write_run(tmp_path, run_id="explores", contexts=(0, 3, 5))
    write_at_once(tmp_path, contexts=(0, 5), tests=1)
    write_at_once(tmp_path, "delta", contexts=(0, 7))
    [(figure, _)] = drawn(tmp_path, pmc.draw_comparison)
    # they have no number of episodes in common
    assert figure.axes[0].get_title("left") == "grid"
    assert list(lines_of(figure.axes[0])) == [
        "PP, pMeta-RL, told its task", "MP, pMeta-RL, told its task", "PP, pMeta-RL, explores",
        "MP, pMeta-RL, explores, after 5 episodes", "DELTA, after 7 episodes",
        "GAMMA, after 5 episodes"]


def test_one_of_several_settings_is_shown_and_the_others_are_named(tmp_path):
    for value in (1, 10, 50):
        write_run(tmp_path, lambda_=value)
    write_at_once(tmp_path)
    edit(write_run(tmp_path, run_id="elsewhere"), "config.yaml",
         lambda text: text.replace("sizes: [4, 5]", "sizes: [6, 7]"))
    _, err = plot(tmp_path, "--what", "comparison", "--format", "png")
    assert err.startswith("plot: warning: the comparison of grid shows 2 of its 5 groups: "
                          "pMeta-RL λ=10 ")


def test_algorithms_whose_order_is_the_same_look_different(tmp_path):
    write_run(tmp_path)
    for name in ("gamma", "delta"):
        write_at_once(tmp_path, name, order=5)
    [(figure, _)] = drawn(tmp_path, pmc.draw_comparison)
    lines = lines_of(figure.axes[0])
    assert lines["GAMMA"].get_color() != lines["DELTA"].get_color()


def test_unseen_tasks_before_and_after_adaptation(tmp_path, mixed):
    [(figure, name)] = drawn(tmp_path, pmc.draw_unseen_methods)
    assert name == "comparison_unseen"
    for axis, count, words in zip(figure.axes, (0, 2), ("before adaptation", "after 2 episodes")):
        assert axis.get_title("left") == "%s, %s" % (EXPERIMENT, words)
        lines = lines_of(axis)
        assert list(lines) == ["MAML", "PEARL"]
        for label in lines:
            assert list(lines[label].get_ydata()) == pytest.approx(
                mean_of(mixed[label.lower()], "meta", "test", count))


def margins(tmp_path):
    [groups] = groups_of(tmp_path).values()
    return {(row["ours"], row["theirs"], row["when"]): row
            for row in pm.margin_rows(EXPERIMENT, groups)}


def test_margins_follow_from_the_files(tmp_path, mixed):
    rows = margins(tmp_path)
    assert [key[:2] for key in list(rows)[::2]] == [
        (ours, theirs) for ours in ("PP of pMeta-RL", "MP of pMeta-RL")
        for theirs in ("PP of independent", "MAML", "PEARL")]
    ours = mean_of(mixed["pmeta"], "personal")[-1]
    theirs = statistics.mean(mean_of(mixed["pearl"], "meta", "train", 2)[-2:])
    end = rows["PP of pMeta-RL", "PEARL", pm.END]
    assert end["percent"] == pytest.approx(100 * (ours - theirs) / abs(theirs))
    assert end["percent_low"] < end["percent"] < end["percent_high"]
    assert (end["steps"], end["their_steps"]) == (880, 4400)
    # at equal steps: where PEARL was at 880 steps of both tasks, which is its round 4
    equal = rows["PP of pMeta-RL", "PEARL", pm.EQUAL]
    assert equal["steps"] == equal["their_steps"] == 880
    curves = mean_of(mixed["pearl"], "meta", "train", 2)
    between = statistics.mean(curves[3] + (curves[2] - curves[3]) * 0.4 * i / 10 for i in range(11))
    assert equal["their_return"] == pytest.approx(between)
    assert end["paper_percent"] == 11.86
    assert rows["MP of pMeta-RL", "PEARL", pm.END]["paper_percent"] is None
    # of one seed there is no interval
    assert rows["PP of pMeta-RL", "MAML", pm.END]["percent_low"] is None
    plot(tmp_path, "--format", "png", "--what", "curves", "--out", tmp_path / "out")
    with open(str(tmp_path / "out/margins.csv"), encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    assert float(table[4]["percent"]) == pytest.approx(rows[table[4]["ours"], table[4]["theirs"],
                                                            pm.EQUAL]["percent"])


def row_of(difference=None, limits=(None, None), percent=None, theirs="X", seeds=3):
    row = dict.fromkeys(pm.COLUMNS)
    row.update(ours="PP", theirs=theirs, when=pm.EQUAL, seeds=seeds, their_seeds=3, percent=percent,
               difference=difference, difference_low=limits[0], difference_high=limits[1])
    return row


def test_who_wins_is_said_where_the_interval_leaves_no_doubt():
    rows = [row_of(5, (1, 9), theirs="A"), row_of(-5, (-9, -1), theirs="B"),
            row_of(5, (-1, 9), theirs="C"), row_of(5, seeds=1, theirs="D"), row_of(theirs="E")]
    assert pm.who_wins(rows) == ["PP at equal steps: above A; below B; not told apart from C, "
                                 "D (one seed); without a common mark with E."]


def test_margins_over_what_is_around_zero_are_differences():
    assert pm.margin_text(row_of(5, (1, 9), percent=12.589)) == "+12.59 %"
    assert pm.margin_text(row_of(5, (1, 9), percent=1001)) == "+5.00 return [1.00, 9.00]"
    assert pm.margin_text(row_of(-5)) == "-5.00 return"
    assert pm.margin_text(row_of()) == "-"


def test_percent_are_of_the_size_of_theirs():
    assert ps.percent_above([110], [100]) == (pytest.approx(10), None)
    assert ps.percent_above([-50], [-100]) == (pytest.approx(50), None)
    assert ps.percent_above([5, 6], [-1, 1]) is None
    value, (low, high) = ps.percent_above([110, 130], [100, 100])
    assert (value, low, high) == (pytest.approx(20), pytest.approx(10), pytest.approx(30))
    value, (low, high) = ps.difference([3, 5], [1, 1])
    assert (value, low, high) == (3, 2, 4)


WAYS = "policy,split,task,context_episodes,step,observation_0,observation_1"


@pytest.fixture
def robots(tmp_path):
    """Folders of ours and of another, which have ways to goals at (1, 0), (0, 1), and (-1, 0)."""
    ours = write_run(tmp_path, experiment="points", contexts=(0, 5, 15), tests=1)
    theirs = write_at_once(tmp_path, "pearl", experiment="points", contexts=(0, 5, 15), tests=1)
    for folder in (ours, theirs):
        for name in ("config.yaml", "manifest.json"):
            edit(folder, name, lambda t: t.replace("gridworld", "sparse_point_robot"))
        for old, new in (("zeta 3,", "goal at (1.000, 0.000),"), ("zeta 3.5", "goal at (0.0, 1.0)"),
                         ("zeta 4", "goal at (-1.000, 0.000)")):
            edit(folder, "manifest.json", lambda t, old=old, new=new: t.replace(old, new))
        lines = [WAYS]
        for policy, counts in (("personal", (0,)), ("meta", (0, 5, 15))):
            for count in counts:
                for task in range(2 if policy == "personal" else 3):
                    # the further it explored, the more it has found
                    far = 0.95 if policy == "personal" or count > 5 * task else 0.3
                    x, y = ((far, 0), (0, far), (-far, 0))[task]
                    for step, part in enumerate((0, 0.5, 1)):
                        lines.append("%s,%s,%d,%d,%d,%r,%r" % (
                            policy, "test" if task == 2 else "train", task, count, step, part * x,
                            part * y))
        keep = [line for line in lines if folder == ours or not line.startswith("personal")]
        with open(os.path.join(folder, "trajectories.csv"), "w") as file:
            file.write("\n".join(keep) + "\n")
    return ours, theirs


def test_ways_to_the_goals_are_drawn_after_each_number_of_episodes(tmp_path, robots):
    [(figure, name)] = drawn(tmp_path, pmt.draw_trajectories)
    assert name == "trajectories"
    titles = [axis.get_title("left") for axis in figure.axes]
    assert titles == ["PP, pMeta-RL: 2 of 2 goals", "",
                      "MP, pMeta-RL, c_1:5: 1 of 2 goals, 0 of 1 unseen",
                      "MP, pMeta-RL, c_1:15: 2 of 2 goals, 1 of 1 unseen",
                      "PEARL, c_1:5: 1 of 2 goals, 0 of 1 unseen",
                      "PEARL, c_1:15: 2 of 2 goals, 1 of 1 unseen"]
    way = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 3][1]
    assert list(way.get_ydata()) == pytest.approx([0, 0.475, 0.95])
    assert [patch.center[0] for patch in figure.axes[3].patches] == pytest.approx([1, 0, -1])


def test_ways_survive_packing(tmp_path, robots):
    path = str(tmp_path / "data/s.tar.xz")
    pa.pack(path, "s", ["points"], robots[:1])
    with pa.unpacked([path]) as top:
        [run] = pr.load_runs(pr.find_folders([top])[0])
    assert run.trajectories["test", 15][2].tolist() == [[0, 0], [-0.475, 0], [-0.95, 0]]


@pytest.mark.parametrize("change, words", [
    (lambda t: t.replace("meta,train,0,5,1", "meta,train,0,5,2", 1), "step is 2 but must be 1"),
    (lambda t: t.replace("meta,train,0,0,0", "meta,train,7,0,0", 1), "no such policy, split, task"),
    (lambda t: t.replace("personal,train,0,0", "personal,train,0,5", 1), "no such policy, split"),
    (lambda t: t.replace("observation_0", "place", 1), "the column 'observation_0' is missing"),
    (lambda t: t.replace(",0.5,", ",nan,").replace(",0.475,", ",nan,"), "is 'nan', not a finite"),
])
def test_malformed_ways_are_refused(tmp_path, robots, change, words):
    path = edit(robots[0], "trajectories.csv", change)
    message = fails(tmp_path)
    assert path in message and words in message


def test_a_goal_that_is_not_told_is_missed(tmp_path, robots):
    edit(robots[0], "manifest.json", lambda t: t.replace("goal at (0.0, 1.0)", "somewhere"))
    assert "task 1 does not say where its goal is" in fails(tmp_path, "--what", "trajectories")


@pytest.mark.skipif(not os.path.isfile(str(LOCAL)), reason="needs pmeta_local")
@pytest.mark.parametrize("algorithm, keys", [
    ("pmeta", [("test", 2), ("test", 3), ("train", 2), ("train", 3), "personal"]),
    ("promp", [("test", 2), ("test", 3), ("train", 2), ("train", 3)])])
def test_a_run_that_is_over_tells_its_ways(tmp_path, algorithm, keys):
    small = (["sac.hidden:=[8]", "sac.context_hidden:=[8]", "updates_per_round:=2",
              "warm_up_steps:=40"] if algorithm == "pmeta" else
             ["promp.hidden:=[8]", "promp.episodes:=2", "steps_per_round:=200"])
    done = run([LOCAL, "run", TOP / "config/sparse_point_robot.yaml", "algorithm:=" + algorithm,
                "train_tasks:=2", "test_tasks:=1", "rounds:=1", "evaluation_interval:=1",
                "exploration_episodes:=[2,3]", "run_id:=r", "results_dir:=%s" % tmp_path] + small)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "sparse_point_robot/r"
    assert run([LOCAL, "trace", folder]).returncode == 0
    text = (folder / "trajectories.csv").read_bytes()
    [found] = pr.load_runs([str(folder)])
    assert sorted(found.trajectories, key=str) == keys
    for key, ways in found.trajectories.items():
        assert sorted(ways) == list(found.tasks_of(key))
        for way in ways.values():
            assert way.shape == (21, 2) and not way[0].any()
            assert 0 < abs(way[1:] - way[:-1]).max() <= 0.1 + 1e-12
    # what a policy does depends on nothing else
    assert run([LOCAL, "trace", folder]).returncode == 0
    assert (folder / "trajectories.csv").read_bytes() == text
    shutil.rmtree(folder / "policies")
    assert "has no policies below policies/" in run([LOCAL, "trace", folder]).stderr


PLAN = """sweeps:
  - {name: ours, use: test, priority: 1, core_hours: 1, page: page.md, experiment: grid,
     assignments: "seed:=0-1"}
  - {name: theirs, use: test, priority: 1, core_hours: 1, page: page.md, experiment: grid,
     assignments: "seed:=0-1 algorithm:=gamma,delta"}
figures:
  - {folder: both, sweeps: [theirs, ours], kinds: [comparison], keep: [comparison]}
"""
PAGE = "".join("<!-- generated: %s -->\n<!-- end -->\n" % words for words in (
    "wins theirs ours", "margins theirs ours", "figure both comparison"))


@pytest.mark.skipif(not os.path.isfile(str(LOCAL)), reason="needs pmeta_local")
def test_a_page_shows_the_ways_of_its_sweep(tmp_path):
    folder = tmp_path / "pages"
    folder.mkdir()
    (folder / "plan.yaml").write_text("""sweeps:
  - {name: ways, use: test, priority: 1, core_hours: 0.1, page: page.md,
     experiment: sparse_point_robot, assignments: "algorithm:=promp seed:=0 train_tasks:=2 rounds:=1
       test_tasks:=1 evaluation_interval:=1 exploration_episodes:=2 hidden:=8 episodes:=2
       steps_per_round:=100"}
figures:
  - {folder: ways, sweeps: [ways], kinds: [trajectories], keep: [trajectories]}
""", encoding="utf-8")
    (folder / "page.md").write_text("<!-- generated: figure ways trajectories -->\n<!-- end -->\n")
    call(results.main, "--folder", folder, "--results-dir", tmp_path / "runs", "--run", "--jobs", "1")
    call(results.main, "--folder", folder)
    assert "(figures/ways/trajectories.png)" in (folder / "page.md").read_text(encoding="utf-8")
    assert (folder / "figures/ways/trajectories.png").is_file()


def test_a_page_says_who_wins_or_that_nothing_was_run(tmp_path):
    folder = tmp_path / "pages"
    folder.mkdir()
    (folder / "plan.yaml").write_text(PLAN, encoding="utf-8")
    page = folder / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    call(results.main, "--folder", folder)
    text = page.read_text(encoding="utf-8")
    assert "None of these runs can be compared yet." in text
    assert text.count("Not run yet: theirs") == 2
    runs = {"ours": [write_run(tmp_path, seed=s) for s in range(2)],
            "theirs": [write_at_once(tmp_path, name, seed=s, scale=3) for s in range(2)
                       for name in ("gamma", "delta")]}
    for name, folders in runs.items():
        pa.pack(pa.archive_of(str(folder), name), name, ["grid"], folders)
    call(results.main, "--folder", folder)
    text = page.read_text(encoding="utf-8")
    assert "* **grid**: PP of pMeta-RL at equal steps: above DELTA, GAMMA." in text
    assert "| PP of pMeta-RL | DELTA | 2, 2 | 880 | +" in text
    assert (folder / "figures/both/comparison.png").is_file()
