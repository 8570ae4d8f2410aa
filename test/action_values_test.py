"""Tests of the point robot's action values: the networks, what tells them the task, the figure."""

import os
import sys

import numpy as np
import pytest

from run_folders import Kept, edit, fails, plot, write_run
from value_maps_test import write_policy
import pmeta_action_values as pa
import pmeta_drawing as pd
import pmeta_groups as pg


def point_policy(towards, inputs=1):
    """Critics worth 5 + the first and 4 + the second action along `towards`, half if z is 1; an
    actor that goes there."""
    critics = {}
    for name, start in (("critic1", 5), ("critic2", 4)):
        critics[name + ".layer0.weight"] = [[0, 0] + [-1] + [0] * (inputs - 1) + list(towards)]
        critics[name + ".layer0.bias"] = [start]
        critics[name + ".layer1.weight"] = [[2]]
        critics[name + ".layer1.bias"] = [0]
    actor = {"actor.layer0.weight": [[0] * (2 + inputs)] * 4,
             "actor.layer0.bias": list(np.arctanh(0.9 * np.array(towards))) + [0, 0]}
    return dict(critics, **actor)


@pytest.fixture
def folder(tmp_path):
    folder = write_run(tmp_path, learner="sac")
    edit(folder, "config.yaml", lambda t: t[:t.index("environment:")] + "sac:\n"
         "  task_encoding: inference\nenvironment:\n  name: sparse_point_robot\n"
         "  goal_angles: [0, 3]\n")
    for name, towards, known in (("meta", (0, 1), ""), ("task_0", (1, 0), "1"),
                                 ("task_1", (-1, 0), "0.5")):
        write_policy(os.path.join(folder, "policies", name + ".safetensors"), point_policy(towards),
                     {"task_input": known})
    return folder


def load(folder):
    return pg.load([folder])[0]["grid"][0].runs[0]


def test_values_are_the_smaller_critics_with_what_the_policy_knows(folder):
    views = pa.views_of(load(folder))
    assert set(views) == {"personal", "meta"}
    # critic2 is the smaller: 2 (4 - z + a along the way), z = 1, 0.5 and the prior's mean
    assert views["personal"][0].values()[0] == pytest.approx(2 * (3 + pa.AXIS), abs=1e-5)
    assert views["personal"][1].values()[7] == pytest.approx(2 * (3.5 - pa.AXIS), abs=1e-5)
    assert views["meta"][1].values()[:, 3] == pytest.approx(2 * (4 + pa.AXIS), abs=1e-5)
    assert views["personal"][1].action() == pytest.approx([-0.9, 0], abs=1e-6)
    assert views["meta"][0].action() == pytest.approx([0, 0.9], abs=1e-6)


def test_a_meta_policy_with_one_hot_is_told_the_task(folder):
    edit(folder, "config.yaml", lambda t: t.replace("inference", "one_hot"))
    write_policy(os.path.join(folder, "policies", "meta.safetensors"), point_policy((0, 1), 2))
    views = pa.views_of(load(folder))
    assert views["meta"][0].values().max() == pytest.approx(8)
    assert views["meta"][1].values().max() == pytest.approx(10)


def test_a_map_marks_the_goal_and_the_policys_action(folder):
    run = load(folder)
    goals = pa.goals_of(run)
    assert goals == pytest.approx(np.array([[1, 0], [np.cos(3), np.sin(3)]]))
    _, axes = pd.panels(1, 1)
    low, high, image = pa.draw_map(axes[0][0], pa.views_of(run)["personal"][1], goals[1:])
    assert (low, high) == pytest.approx((5, 9), abs=1e-5)
    assert np.asarray(image.get_array()).shape == (41, 41)
    star, dot = axes[0][0].lines
    assert (star.get_xdata()[0], star.get_ydata()[0]) == pytest.approx((-1, -np.tan(3)))
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == pytest.approx((-0.9, 0), abs=1e-6)


def test_one_map_for_all_tasks_is_drawn_once(tmp_path, folder):
    run = load(folder)
    views = pa.views_of(run)
    kept = Kept()
    pa.action_values("not told its task", run, views, kept, "a")
    views["meta"][1].state = views["meta"][1].state + 1
    pa.action_values("told its task", run, views, kept, "b")
    axes, told = ([axis for axis in figure.axes if axis.images] for figure, _ in kept.written)
    assert (len(axes), len(told)) == (3, 4)
    [stars] = [line for line in axes[2].lines if line.get_marker() == "*"]
    assert len(stars.get_xdata()) == 2
    assert "all tasks" in axes[2].get_xlabel()
    assert all("action along x" in axis.get_xlabel() for axis in axes)


def test_goals_lie_evenly_where_no_angles_are_given(folder):
    edit(folder, "config.yaml", lambda t: t.replace("[0, 3]", "[]"))
    assert pa.goals_of(load(folder)) == pytest.approx(np.array([[1, 0], [-1, 0]]))


def test_some_tasks_are_chosen_of_many():
    assert list(pa.chosen_tasks(10)) == [0, 2, 4, 7, 9]
    assert list(pa.chosen_tasks(2)) == [0, 1]


def test_the_figure_is_drawn_where_there_are_policies(tmp_path, folder):
    plot(tmp_path, "--what", "values")
    names = set(os.listdir(str(tmp_path / "figures")))
    assert {"action_values.png", "action_values.pdf"} <= names and "value_maps.png" not in names
    for name in ("meta", "task_1"):
        os.remove(os.path.join(folder, "policies", name + ".safetensors"))
    assert "nothing to draw for values" in fails(tmp_path, "--what", "values")


@pytest.mark.parametrize("spoil, words", [
    (lambda t: t.pop("critic2.layer0.weight"), "holds no network 'critic2'"),
    (lambda t: t.update({"critic1.layer0.weight": [[1, 2]]}), "holds no network 'critic1'"),
    (lambda t: [t.pop(name) for name in list(t) if name.startswith("actor")],
     "holds no network 'actor'"),
])
def test_a_broken_policy_is_told_in_one_sentence(tmp_path, folder, spoil, words):
    path = os.path.join(folder, "policies", "task_0.safetensors")
    tensors = point_policy((1, 0))
    spoil(tensors)
    write_policy(path, tensors, {"task_input": "1"})
    message = fails(tmp_path, "--what", "values")
    assert path in message and words in message


def test_a_task_input_that_is_no_numbers_is_told(tmp_path, folder):
    path = os.path.join(folder, "policies", "task_0.safetensors")
    write_policy(path, point_policy((1, 0)), {"task_input": "one"})
    assert "its task_input is 'one', not numbers." in fails(tmp_path, "--what", "values")


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
