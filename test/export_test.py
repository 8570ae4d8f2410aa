"""Policies as ONNX models act as policy_node does: by another program's reading of them."""

import json
import os

import pytest

from programs import LOCAL, TOP, run

pytestmark = pytest.mark.skipif(os.path.isdir("/opt/ros/noetic"),
                                reason="Ubuntu 20.04 has no ONNX package for Python")
EXPORT = TOP / "src/pmeta_nodes/scripts/export.py"
ONNX_ACT = TOP / "devel/lib/pmeta_core/onnx_act"

CART_POLE = """
experiment: cart
learner: dqn
rounds: 2
updates_per_round: 20
dqn: {hidden: [32, 24], batch_size: 16, buffer_size: 2000, num_envs: 2, dueling: %s}
environment: {name: cart_pole}
"""
POINT = """
experiment: point
algorithm: %s
learner: sac
rounds: 2
updates_per_round: 20
sac: {hidden: [12, 10], batch_size: 16, buffer_size: 500, warm_up_steps: 40, context_hidden: [8],
      latent_size: 2, context_batch: 20, task_encoding: %s, task_model: {hidden: [8]}}
%s
environment: {name: sparse_point_robot, train_tasks: 3, goal_angles: []}
"""
HEADS = "pooled_sac: {hidden: [12], batch_size: 12, warm_up_steps: 40, task_encoding: multi_head}"
STEP = "promp: {hidden: [12], episodes: 2, exploration_episodes: [2]}"


@pytest.fixture
def trained(tmp_path):
    """Trains an experiment for a moment; the folder of its policies."""
    def train(text):
        config = tmp_path / "mine.yaml"
        config.write_text(text)
        done = run([LOCAL, "run", config, "results_dir:=%s" % tmp_path, "run_id:=run"])
        assert done.returncode == 0, done.stderr
        [policies] = tmp_path.glob("*/run/policies")
        return policies
    return train


def export(policy, *more):
    model = policy.with_suffix(".onnx")
    done = run(["/usr/bin/python3", EXPORT, policy, *more])
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert done.stdout.startswith("wrote %s: observation [batch, " % model)
    return model


def refusal(policy, *more):
    done = run(["/usr/bin/python3", EXPORT, policy, *more])
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    return done.stderr


def acts_alike(policy, *more, task=()):
    done = run([ONNX_ACT, policy, export(policy, *more), *task])
    assert done.returncode == 0, done.stderr
    largest, other = done.stdout.split()
    return float(largest) < 1e-5 and other == "0"


@pytest.mark.parametrize("dueling", ["false", "true"])
def test_q_networks(trained, dueling):
    policies = trained(CART_POLE % dueling)
    for name in ("meta", "task_0"):
        assert acts_alike(policies / (name + ".safetensors"))


def test_actors_that_are_told_nothing(trained):
    policies = trained(POINT % ("pmeta", "none", ""))
    for name in ("meta", "task_1"):
        assert acts_alike(policies / (name + ".safetensors"))


def test_actors_with_a_latent(trained):
    policies = trained(POINT % ("pmeta", "inference", ""))
    assert acts_alike(policies / "task_1.safetensors")
    # whoever runs a meta-policy infers it
    assert acts_alike(policies / "meta.safetensors", task=["-1", "told"])


@pytest.mark.parametrize("algorithm, settings", [("pmeta", ""), ("pooled_sac", HEADS)])
def test_actors_that_are_told_their_task(trained, algorithm, settings):
    policies = trained(POINT % (algorithm, "one_hot", settings))
    meta = policies / "meta.safetensors"
    assert acts_alike(meta, "--task", "2", task=["2"])
    assert not acts_alike(meta, "--task", "2", task=["1"])
    assert "--task is 3 but must be one from 0 to 2" in refusal(meta, "--task", "3")
    if algorithm == "pmeta":
        assert acts_alike(policies / "task_1.safetensors")
        assert "needs no --task" in refusal(policies / "task_1.safetensors", "--task", "1")
        assert acts_alike(meta, task=["1", "told"])
    else:
        assert "say which, by --task" in refusal(meta)


def test_policies_that_scale_and_clip(trained):
    assert acts_alike(trained(POINT % ("promp", "none", STEP)) / "meta.safetensors")


def test_a_model_says_what_its_numbers_are(trained):
    onnx = pytest.importorskip("onnx")
    model = onnx.load(str(export(trained(CART_POLE % "false") / "task_0.safetensors")))
    told = {one.key: one.value for one in model.metadata_props}
    assert [one["name"] for one in json.loads(told["observation"])] == [
        "position", "velocity", "angle", "angular_velocity"]
    assert told["policy"] == "personal" and told["task"] == "0" and told["round"] == "2"


def test_what_is_no_network_of_layers_is_refused(tmp_path):
    done = run([LOCAL, "run", TOP / "config/gridworld.yaml", "rounds:=1", "updates_per_round:=10",
                "results_dir:=%s" % tmp_path, "run_id:=run"])
    assert done.returncode == 0, done.stderr
    [policy] = tmp_path.glob("*/run/policies/meta.safetensors")
    assert "has no network of layers that acts: a table" in refusal(policy)
    assert not policy.with_suffix(".onnx").exists()
    assert "cannot use" in refusal(tmp_path / "none.safetensors")
