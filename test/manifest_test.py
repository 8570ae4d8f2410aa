"""Tests of what manifest.json says of a run, and of what plots make of it."""

import ast
import glob
import json
import os
import shutil

import pytest

from programs import CONFIG, LOCAL, TOP, run
from run_folders import (SCRIPTS, edit, fails, groups_of, make_newer, plot, pm, summary, write_run)

CART_POLE = [TOP / "config/cart_pole.yaml", "preset:=quick", "rounds:=1", "updates_per_round:=5"]
needs_build = pytest.mark.skipif(not LOCAL.is_file(), reason="needs pmeta_local")


def manifest_of(folder):
    with open(os.path.join(str(folder), "manifest.json")) as file:
        return json.load(file)


def run_locally(tmp_path, run_id, words):
    result = run([LOCAL, "run"] + words + ["run_id:=" + run_id, "results_dir:=%s" % tmp_path])
    assert result.returncode == 0, result.stderr
    return glob.glob(str(tmp_path / "*" / run_id))[0]


def make_older(folder):
    manifest = manifest_of(folder)
    del manifest["defining_settings"], manifest["figures"]
    edit(str(folder), "manifest.json", lambda _: json.dumps(manifest))


@needs_build
@pytest.mark.parametrize("algorithm", ["pmeta", "model_averaging", "independent", "pooled"])
def test_older_runs_are_drawn_as_those_of_today(tmp_path, algorithm):
    folder = run_locally(tmp_path, "r", CART_POLE + ["algorithm:=" + algorithm])
    settings = pm.settings_of(folder, manifest_of(folder))
    figures = vars(pm.figures_of(folder, manifest_of(folder), algorithm, "dqn"))
    assert ("meta" in figures["compared_by"]) <= (("train", 0) in figures.pop("curves"))
    make_older(folder)
    assert pm.settings_of(folder, manifest_of(folder)) == settings
    older = vars(pm.figures_of(folder, manifest_of(folder), algorithm, "dqn"))
    assert older.pop("curves") == []
    # of settings that other learners have nothing follows
    for name in ("own_settings", "fixed_settings"):
        assert older.pop(name) & set(settings) == figures.pop(name) & set(settings), name
    assert older == figures and figures["policies"] == "q_network"


@needs_build
def test_a_run_and_a_sweep_of_one_experiment_share_a_curve(tmp_path):
    words = [CONFIG, "rounds:=2", "results_dir:=%s" % tmp_path]
    once = run_locally(tmp_path, "once", words + ["seed:=7", "pace:=0.01"])
    older = run_locally(tmp_path, "older", words + ["seed:=8"])
    make_older(older)
    swept = run([LOCAL, "sweep"] + words + ["seed:=0-1", "--name", "s"])
    assert swept.returncode == 0, swept.stderr
    assert "interval: 0" in open(glob.glob(str(tmp_path / "sweeps/s/*/*0/config.yaml"))[0]).read()
    assert "interval: 0" not in open(os.path.join(once, "config.yaml")).read()
    groups, = groups_of(tmp_path).values()
    assert [group.seeds for group in groups] == [[0, 1, 7, 8]]
    assert groups[0].label == "pMeta-RL λ=10"


def test_runs_of_this_version_and_older_ones_make_the_same_tables(tmp_path):
    for algorithm, value in (("pmeta", 10), ("pmeta", 20), ("model_averaging", 0),
                             ("independent", 0), ("pooled", 0)):
        for seed in range(2):
            write_run(tmp_path / "old", algorithm, seed, value, learner="dqn", fresh=100)
    shutil.copytree(str(tmp_path / "old"), str(tmp_path / "new"))
    for folder in glob.glob(str(tmp_path / "new/*/*")):
        make_newer(folder)
    texts = []
    for name in ("old", "new"):
        out, err = plot(tmp_path / name, "--out", tmp_path / "out" / name, "--format", "png",
                        "--what", "curves,sweep,tasks")
        assert err == ""
        texts.append(out.replace(os.sep + name, ""))
    assert texts[0] == texts[1]
    assert summary(tmp_path / "out/old") == summary(tmp_path / "out/new")


def test_the_manifest_counts_and_an_algorithm_may_be_anything(tmp_path):
    ours, theirs = (write_run(tmp_path, name) for name in ("pmeta", "model_averaging"))
    for folder in (ours, theirs):
        make_newer(folder)
    edit(ours, "config.yaml", lambda text: text.replace("alpha: 0.08", "alpha: 0.5"))
    edit(theirs, "manifest.json", lambda text: text.replace(
        '"algorithm": "model_averaging"', '"algorithm": "taught"').replace(
        '"label": "model averaging"', '"label": "teaching"'))
    groups = groups_of(tmp_path)["grid"]
    assert [group.label for group in groups] == ["pMeta-RL λ=10", "teaching"]
    assert groups[0].settings["personal.alpha"] == 0.08
    out, _ = plot(tmp_path, "--format", "png")
    assert "MP of teaching" in out


@pytest.mark.parametrize("key, value, sentence", [
    ("defining_settings", [1], "defining_settings must hold a text for each setting."),
    ("defining_settings", {"a": 1}, "defining_settings must hold a text for each setting."),
    ("defining_settings", {"a": "[1"}, "the setting a line 1 is not valid YAML"),
    ("figures", {}, "label of its figures is missing or of the wrong type."),
    ("figures", [], "label of its figures is missing or of the wrong type."),
])
def test_what_has_been_altered_is_told(tmp_path, key, value, sentence):
    folder = write_run(tmp_path)
    make_newer(folder)
    edit(folder, "manifest.json", lambda text: json.dumps(dict(json.loads(text), **{key: value})))
    assert sentence in fails(tmp_path)


def test_a_curve_that_the_manifest_names_is_missed(tmp_path):
    folder = write_run(tmp_path)
    make_newer(folder)
    edit(folder, "manifest.json", lambda text: text.replace('"curves": []', '"curves": %s' % (
        json.dumps([{"policy": "meta", "split": "test", "context_episodes": 2}]))))
    assert "no meta (test tasks, 2 episodes) return although" in plot(tmp_path, "--format",
                                                                      "png")[1]


def test_no_script_knows_an_algorithm_or_a_learner_by_its_name():
    older = pm.older_runs()
    names = set(older["algorithms"]) | set(older["policies"]) | {"median", "trimmed_mean"}
    for path in glob.glob(os.path.join(SCRIPTS, "*.py")):
        with open(path, encoding="utf-8") as file:
            tree = ast.parse(file.read())
        compared = [n for node in ast.walk(tree) if isinstance(node, ast.Compare)
                    for n in ast.walk(node)]
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and node.value in names:
                # the project's own name is also one of an algorithm
                assert node.value == "pmeta" and node not in compared, (path, node.lineno)
