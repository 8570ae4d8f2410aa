"""The table of how well meta-policies find out their tasks."""

import json
import statistics

import pytest

from run_folders import curve, edit, groups_of, rows_of, write_run
import pmeta_inference as pi


@pytest.fixture
def explored(tmp_path):
    folders = [write_run(tmp_path, seed=seed, rounds=8, contexts=(0, 2), tests=1) for seed in (3, 4)]
    return tmp_path, folders


def only_group(top):
    (groups,) = groups_of(top).values()
    return groups


def numbers(text):
    last, mean = text.rstrip("%) ").split(" (")
    return float(last), float(mean)


def test_each_seed_has_its_last_and_its_late_returns(explored):
    top, folders = explored
    heads, lines = pi.inference_cells(only_group(top))
    assert heads[:5] == ("seed", "PP", "MP after 0", "MP after 2", "MP after 2, unseen")
    assert [line[0] for line in lines] == ["3", "4", "mean of the seeds"]
    for folder, line in zip(folders, lines):
        for cell, (policy, split, context) in zip(line[1:5], (
                ("personal", "train", 0), ("meta", "train", 0), ("meta", "train", 2),
                ("meta", "test", 2))):
            expected = curve(folder, policy, split, context)
            assert numbers(cell) == pytest.approx(
                (expected[-1], statistics.mean(expected[-5:])), abs=0.051)
        pp, mp = (curve(folder, policy, "train", context)
                  for policy, context in (("personal", 0), ("meta", 2)))
        assert numbers(line[5]) == pytest.approx(
            (100 * mp[-1] / pp[-1], 100 * statistics.mean(mp[-5:]) / statistics.mean(pp[-5:])),
            abs=0.051)
        # a quarter of eight rounds
        for cell, of in zip(line[6:], (pp, mp)):
            assert float(cell.rstrip(" %")) == pytest.approx(
                100 * min(of[-2:]) / statistics.mean(of[-2:]), abs=0.51)
    means = [statistics.mean(numbers(line[1])[0] for line in lines[:2])]
    assert numbers(lines[2][1])[0] == pytest.approx(means[0], abs=0.11)


def test_test_tasks_that_are_trained_on_are_called_so(explored):
    top, folders = explored
    for folder in folders:
        edit(folder, "manifest.json", with_descriptions(["left", "right", "left"]))
    group = only_group(top)
    assert pi.inference_cells(group)[0][4] == "MP after 2, test tasks, trained on"
    assert group[0].runs[0].test_names == ["left, trained on"]
    edit(folders[0], "manifest.json", with_descriptions(["left", "right", "up"]))
    assert only_group(top)[0].runs[0].test_names == ["up"]


def with_descriptions(words):
    def edited(text):
        manifest = json.loads(text)
        manifest["tasks"] = [{"task": i, "split": "test" if i == 2 else "train", "description": word}
                             for i, word in enumerate(words)]
        return json.dumps(manifest)
    return edited


def test_tasks_are_counted_where_rewards_are_sparse(explored):
    top, folders = explored
    last = max(int(row["round"]) for row in rows_of(folders[0], "meta"))

    def sparse(text):
        lines = text.splitlines()
        for i, line in enumerate(lines[1:], 1):
            cells = line.split(",")
            found = int(cells[0]) == last and cells[3] == "meta" and cells[1] == "1"
            cells[5] = "1.0" if found else "0.5"
            lines[i] = ",".join(cells)
        return "\n".join(lines) + "\n"

    for folder in folders:
        edit(folder, "rounds.csv", sparse)
    heads, lines = pi.reached_cells(only_group(top))
    assert heads == ("seed", "PP", "MP after 0", "MP after 2", "MP after 2, unseen")
    assert lines == [("3", "0 of 2", "1 of 2", "1 of 2", "0 of 1"),
                     ("4", "0 of 2", "1 of 2", "1 of 2", "0 of 1")]


def test_no_tasks_are_counted_where_returns_are_costs(explored):
    top, folders = explored
    assert min(curve(folders[0], "personal")) < 0
    assert pi.reached_cells(only_group(top)) == ((), [])
