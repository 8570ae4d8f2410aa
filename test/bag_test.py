"""Tests of `pmeta plot` on rosbags: written here from the messages' definitions."""

import csv
import os
import subprocess
import sys

import pytest

from run_folders import Kept, curve, fails, plot, write_run
import pmeta_bags as pb
import pmeta_figures as pf
import pmeta_runs as pr

rosbag = pytest.importorskip("rosbag")
import genpy.dynamic

MSG = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "src", "pmeta_msgs", "msg")
HEADER_DEFINITION = "\n".join(["", "=" * 80, "MSG: std_msgs/Header", "uint32 seq", "time stamp",
                               "string frame_id", ""])


@pytest.fixture(scope="module")
def definition():
    with open(os.path.join(MSG, "TaskReturn.msg")) as file:
        return file.read() + HEADER_DEFINITION


@pytest.fixture(scope="module")
def message_class(definition):
    return generated(definition)


def generated(definition):
    return genpy.dynamic.generate_dynamic("pmeta_msgs/TaskReturn", definition)[
        "pmeta_msgs/TaskReturn"]


def write_bag(path, folder, message_class, keep=lambda row: True, run_id="r", twice=False,
              asked=False):
    """The returns of a run folder as the agents publish them, in an order of their own."""
    with open(os.path.join(folder, "rounds.csv")) as file:
        rows = [row for row in csv.DictReader(file) if keep(row)]
    with rosbag.Bag(str(path), "w") as bag:
        for i, row in enumerate(sorted(rows, key=lambda row: (row["round"], -int(row["task"])))):
            message = message_class(run_id=run_id, task=int(row["task"]), round=int(row["round"]),
                                    policy_name=row["policy"], split_name=row["split"],
                                    return_mean=float(row["return_mean"]))
            # older messages have no such fields
            if hasattr(message, "context_episodes"):
                message.context_episodes = int(row["context_episodes"])
            if hasattr(message, "scheduled"):
                message.scheduled = True
            bag.write("/pmeta/returns", message, genpy.Time(i + 1))
            if asked:
                message.scheduled, message.round = False, message.round + 100
                bag.write("/pmeta/returns", message, genpy.Time(i + 1, 1))
            if twice:
                message.return_mean = 1e6
                bag.write("/pmeta/returns", message, genpy.Time(i + 1, 1))
    return str(path)


def test_curves_of_a_bag_equal_those_of_rounds_csv(tmp_path, message_class):
    folder = write_run(tmp_path, seed=3)
    path = write_bag(tmp_path / "r.bag", folder, message_class, twice=True)
    [run] = pb.read_bag(path)
    [of_folder] = pr.load_runs([folder])
    assert list(run.rounds) == list(of_folder.rounds)
    for policy in ("personal", "meta"):
        assert list(run.curves[policy]) == list(of_folder.curves[policy])
        assert list(run.curves[policy]) == pytest.approx(curve(folder, policy), rel=1e-14)


def test_returns_outside_the_schedule_are_left_out(tmp_path, message_class):
    folder = write_run(tmp_path, seed=3)
    [run] = pb.read_bag(write_bag(tmp_path / "r.bag", folder, message_class, asked=True))
    assert list(run.rounds) == list(pr.load_runs([folder])[0].rounds)


def test_the_figure_shows_both_policies(tmp_path, message_class):
    folder = write_run(tmp_path, seed=3)
    kept = Kept()
    [run] = pb.read_bag(write_bag(tmp_path / "r.bag", folder, message_class))
    pf.bag_curves(run, *pb.names_of([run]), kept)
    [(figure, name)] = kept.written
    assert name == "r_learning_curves"
    drawn = {line.get_label(): list(line.get_ydata()) for line in figure.axes[0].lines}
    assert drawn == {"MP": list(run.curves["meta"]), "PP": list(run.curves["personal"])}


def test_test_tasks_and_adaptation_equal_those_of_rounds_csv(tmp_path, message_class):
    folder = write_run(tmp_path, seed=3, contexts=(0, 2), tests=2)
    [run] = pb.read_bag(write_bag(tmp_path / "r.bag", folder, message_class))
    [of_folder] = pr.load_runs([folder])
    assert run.curves.keys() == of_folder.curves.keys()
    for key in run.curves:
        assert list(run.curves[key]) == list(of_folder.curves[key])
    assert list(run.curves["meta"]) == pytest.approx(curve(folder, "meta", "train", 2), rel=1e-14)
    kept = Kept()
    pf.bag_curves(run, "r", kept)
    drawn = {line.get_label(): list(line.get_ydata()) for line in kept.written[0][0].axes[0].lines}
    assert drawn == {"MP": list(run.curves["meta"]), "PP": list(run.curves["personal"]),
                     "MP before adaptation": list(run.curves["train", 0]),
                     "MP, test tasks, after 0 episodes": list(run.curves["test", 0]),
                     "MP, test tasks, after 2 episodes": list(run.curves["test", 2])}


def test_older_bags_lack_context_episodes(tmp_path, definition):
    older = generated(definition.replace("uint32 context_episodes", "").replace("bool scheduled",
                                                                                ""))
    assert not hasattr(older(), "context_episodes") and not hasattr(older(), "scheduled")
    folder = write_run(tmp_path, seed=3)
    [run] = pb.read_bag(write_bag(tmp_path / "r.bag", folder, older))
    for policy in ("personal", "meta"):
        assert list(run.curves[policy]) == pytest.approx(curve(folder, policy), rel=1e-14)


def test_figures_of_a_bag_stand_beside_it(tmp_path, message_class):
    bag = write_bag(tmp_path / "r.bag", write_run(tmp_path), message_class)
    out, err = plot(bag)
    assert sorted(os.listdir(str(tmp_path / "figures"))) == ["r_learning_curves.pdf",
                                                             "r_learning_curves.png"]
    assert out.count("wrote ") == 2 and err == ""
    # beside a run folder both are drawn
    plot(tmp_path / "grid", bag, "--out", tmp_path / "both", "--format", "png")
    assert {"learning_curves.png", "r_learning_curves.png"} <= set(
        os.listdir(str(tmp_path / "both")))
    assert fails(bag, "--what", "sweep") == "plot: a bag gives curves alone."


def test_no_installed_messages_are_needed(tmp_path, message_class):
    bag = write_bag(tmp_path / "r.bag", write_run(tmp_path), message_class)
    script = os.path.join(os.path.dirname(pb.__file__), "plot.py")
    result = subprocess.run([sys.executable, script, bag], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, universal_newlines=True, timeout=60,
                            env={"PATH": "/usr/bin:/bin"})
    assert result.returncode == 0, result.stderr


def test_the_name_of_a_run_is_never_a_path(tmp_path, message_class):
    folder = write_run(tmp_path)
    path = str(tmp_path / "in.bag")
    write_bag(path, folder, message_class, run_id="/../../../out")
    plot(path, "--out", tmp_path / "a" / "b" / "c" / "d", "--format", "png")
    assert os.listdir(str(tmp_path / "a" / "b" / "c" / "d")) == [
        "in__.._.._.._out_learning_curves.png"]
    assert sorted(os.listdir(str(tmp_path))) == ["a", "grid", "in.bag"]


def test_runs_whose_names_become_the_same_have_figures_of_their_own():
    class Run:
        path = "x.bag"

    runs = [Run(), Run(), Run(), Run()]
    for run, run_id in zip(runs, ("a/b", "a b", "x", "a_b")):
        run.run_id = run_id
    assert pb.names_of(runs) == ["x_a_b", "x_a_b~2", "x", "x_a_b~3"]


def test_returns_of_no_run_are_left_out(tmp_path, message_class):
    path = write_bag(tmp_path / "r.bag", write_run(tmp_path), message_class)
    with rosbag.Bag(path, "a") as bag:
        for values in ({"round": 0}, {"round": 2, "policy_name": "x"},
                       {"round": 3, "split_name": "test", "return_mean": float("inf")}):
            message = message_class(**dict({"run_id": "r", "policy_name": "meta", "task": 1,
                                            "split_name": "train", "scheduled": True}, **values))
            bag.write("/pmeta/returns", message, genpy.Time(1000))
    _, err = plot(path)
    assert "holds 3 returns that are none of a run's" in err
    assert list(pb.read_bag(path)[0].rounds) == [1, 2, 3, 4]


def test_a_far_round_of_a_message_is_not_counted_up_to(tmp_path, message_class):
    path = write_bag(tmp_path / "r.bag", write_run(tmp_path), message_class)
    with rosbag.Bag(path, "a") as bag:
        for policy in ("personal", "meta"):
            bag.write("/pmeta/returns", message_class(
                run_id="r", policy_name=policy, split_name="train", round=4000000000,
                scheduled=True), genpy.Time(1000))
    _, err = plot(path)
    assert "lacks 3999999995 of the first 4000000000 rounds (first: round 5)" in err


def test_a_bag_that_is_being_recorded_is_told(tmp_path):
    path = tmp_path / "x.bag.active"
    path.write_bytes(b"")
    assert "%s is still being recorded" % path in fails(path)


def test_rounds_and_returns_that_were_not_recorded_are_named(tmp_path, message_class):
    folder = write_run(tmp_path)
    late = write_bag(tmp_path / "late.bag", folder, message_class,
                     lambda row: row["round"] != "1" and (row["round"], row["task"]) != ("3", "0"))
    [run] = pb.read_bag(late)
    assert list(run.rounds) == [2, 3, 4]
    assert list(run.curves["meta"])[::2] == [curve(folder, "meta")[i] for i in (1, 3)]
    _, err = plot(late)
    assert "late.bag lacks 1 of the first 4 rounds (first: round 1)" in err
    assert "returns of some tasks are missing in 1 rounds (first: round 3)" in err


def test_bags_without_returns_are_told_in_one_sentence(tmp_path, message_class):
    path = str(tmp_path / "r.bag")
    with rosbag.Bag(path, "w"):
        pass
    assert fails(path) == ("plot: %s has no topic returns of type pmeta_msgs/TaskReturn; its "
                           "topics are: none." % path)
    other = genpy.dynamic.generate_dynamic("a/B", "float64 x\n")["a/B"]
    with rosbag.Bag(path, "w") as bag:
        bag.write("/pmeta/returns", other(x=1), genpy.Time(1))
    assert fails(path).endswith("its topics are: /pmeta/returns.")
    write_bag(path, write_run(tmp_path), message_class, lambda row: row["policy"] == "personal"
              and row["round"] == "1" or row["policy"] == "meta" and row["round"] == "2")
    assert fails(path) == "plot: %s has no round with returns of every policy." % path


@pytest.mark.parametrize("change, words", [
    (lambda data: data[:len(data) // 2], "is cut off, or its recording was: mend it"),
    (lambda data: b"", "is not a readable bag (empty file)."),
    (lambda data: b"round,task\n1,2\n", "is not a readable bag"),
    (lambda data: data.replace(b"\x08\0\0\0personal", b"\xff\xff\0\0personal"),
     "is not a readable bag"),
])
def test_a_broken_bag_is_told_in_one_sentence(tmp_path, message_class, change, words):
    path = write_bag(tmp_path / "r.bag", write_run(tmp_path), message_class)
    with open(path, "rb") as file:
        data = file.read()
    with open(path, "wb") as file:
        file.write(change(data))
    message = fails(path)
    assert path in message and words in message


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
