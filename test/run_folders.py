"""Run folders written for the tests of plot and report, and numbers read straight from them."""

import contextlib
import csv
import io
import json
import math
import os
import statistics
import sys

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)),
                       "..", "src", "pmeta_nodes", "scripts")
sys.path.insert(0, SCRIPTS)
import plot as program
import pmeta_drawing as pd
import pmeta_groups as pg
import pmeta_manifest as pm
import pmeta_runs as pr
from pmeta_files import read_yaml

HEADER = ("round,task,split,policy,context_episodes,return_mean,return_std,episodes,env_steps,"
          "updates,wall_s")
FRESH_HEADER = "snapshot,round,policy,trained_task,task,split,return_mean,return_std,episodes"
ALONE = ("independent", "pooled")  # algorithms without a meta-policy
CONFIG = """experiment: {experiment}
algorithm: {algorithm}
seed: {seed}
rounds: {rounds}
updates_per_round: {updates}
learner: {learner}
fresh_episodes: {fresh}
results_dir: /somewhere
run_id: {run_id}
personal:
  alpha: 0.08
  lambda: {lambda_}
  eta: 0.08
  personal_init: meta
dqn:
  hidden: [512, 512]
  batch_size: 64
aggregation:
  beta: {beta}
environment:
  name: gridworld
  sizes: [4, 5]
  slip: [0]
"""


def write_run(top, algorithm="pmeta", seed=0, lambda_=10, rounds=4, status="finished",
              experiment="grid", run_id=None, scale=1.0, optimal=None, started="2026-01-01",
              learner="q_learning", fresh=0, updates=1, contexts=(0,), tests=0, own_best=False):
    """A run of two tasks whose returns are uneven numbers, different for every setting and seed.

    `contexts`: exploration episodes that the meta-policy adapts from; `tests`: test tasks.
    """
    run_id = run_id or "%s_l%g_s%d" % (algorithm, lambda_, seed)
    folder = os.path.join(str(top), experiment, run_id)
    os.makedirs(folder)
    lambda_ = lambda_ if algorithm == "pmeta" else 0
    with open(os.path.join(folder, "config.yaml"), "w") as file:
        file.write(CONFIG.format(experiment=experiment, algorithm=algorithm, seed=seed,
                                 rounds=rounds, run_id=run_id, lambda_=lambda_,
                                 learner=learner, fresh=fresh, updates=updates,
                                 beta=0 if algorithm in ALONE else 1))
    tasks = [{"task": task, "split": "test" if task >= 2 else "train",
              "description": "zeta %g, force 1" % (3 + task / 2)} for task in range(2 + tests)]
    for task, value in zip(tasks, optimal or ()):
        task["optimal_return"] = value
    with open(os.path.join(folder, "manifest.json"), "w") as file:
        json.dump({"experiment": experiment, "run_id": run_id, "algorithm": algorithm, "seed": seed,
                   "status": status, "rounds_done": rounds, "rounds": rounds, "started": started,
                   "commit": "abc", "tasks": tasks}, file)
    lines = [HEADER]
    for round_ in range(1, rounds + 1):
        for policy in ("personal",) if algorithm in ALONE else ("personal", "meta"):
            for task, context in [(task, context)
                                  for task in range(2 + tests * (policy == "meta"))
                                  for context in (contexts if policy == "meta" else (0,))]:
                value = scale * (-40 / round_ - 3 * task - 0.37 * seed * (2 - task) - 0.1 * lambda_
                                 - 1.7 * (policy == "personal") - math.sin(seed * round_ + lambda_)
                                 + 1.3 * context)
                trained = 0 if task >= 2 else round_ * updates
                lines.append("%d,%d,%s,%s,%d,%r,1.5,15,%d,%d,0.000010" % (
                    round_, task, "test" if task >= 2 else "train", policy, context, value,
                    (100 + 20 * task) * trained, 3 * trained))
    with open(os.path.join(folder, "rounds.csv"), "w") as file:
        file.write("\n".join(lines) + "\n")
    if fresh:
        write_fresh(folder, algorithm, seed + lambda_, fresh, tests, own_best)
    return folder


def write_fresh(folder, algorithm, shift, episodes, tests=0, own_best=False):
    """As the core does: personal before meta, all pairs of those that train alone."""
    lines = [FRESH_HEADER]
    kept = [("personal", "last"), ("personal", "best"), ("meta", "last"), ("meta", "best")]
    for number, (policy, snapshot) in enumerate(kept + [("personal", "own_best")] * own_best):
        if policy == "meta" and algorithm in ALONE:
            continue
        for trained in range(2) if policy == "personal" else (-1,):
            for task in range(2 + tests * (policy == "meta")):
                if policy == "personal" and trained != task and (
                        algorithm not in ALONE or snapshot == "own_best"):
                    continue
                value = (-50 - 9 * (trained != task) - 3.1 * task - number
                         - 0.7 * math.cos(shift))
                lines.append("%s,%d,%s,%d,%d,%s,%r,2.5,%d" % (
                    snapshot, 3 - task if snapshot == "own_best" else 3, policy, trained, task,
                    "test" if task >= 2 else "train", value, episodes))
    with open(os.path.join(folder, "final.csv"), "w") as file:
        file.write("\n".join(lines) + "\n")


def make_older(folder):
    """The files as they were before there were test tasks."""
    for name, column in (("rounds.csv", "context_episodes"), ("final.csv", "split")):
        if os.path.isfile(os.path.join(folder, name)):
            place = (HEADER if name == "rounds.csv" else FRESH_HEADER).split(",").index(column)
            edit(folder, name, lambda text: "".join(
                ",".join(f for i, f in enumerate(line.split(",")) if i != place)
                for line in text.splitlines(True)))


def make_newer(folder):
    """The manifest as runs write it that say there what defines them and how they are drawn."""
    settings = pm.flatten(read_yaml(os.path.join(folder, "config.yaml")))
    older = pm.older_runs()

    def change(text):
        manifest = json.loads(text)
        manifest["defining_settings"] = {
            key: json.dumps(value) for key, value in settings.items()
            if key not in older["not_defining"]}
        manifest["figures"] = dict(older["algorithms"][manifest["algorithm"]], curves=[],
                                   policies=older["policies"][settings["learner"]])
        return json.dumps(manifest)

    edit(folder, "manifest.json", change)


class Kept(pd.Figures):
    """Keeps [(figure, name)] as they are."""

    def __init__(self):
        super().__init__("", ())

    def save(self, figure, name):
        self.written.append((figure, name))
        pd.plt.close(figure)

    def write(self, text, name):
        pass


def call(main, *arguments, code=0):
    """Runs a program in this process, which is quick, and returns (stdout, stderr)."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        result = main([str(a) for a in arguments])
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode("utf-8"))
    assert result == code, texts[1]
    return texts


def plot(*arguments, code=0):
    return call(program.main, *arguments, code=code)


def fails(*arguments, main=program.main, name="plot"):
    """The one sentence with which it refuses."""
    _, message = call(main, *arguments, code=1)
    lines = message.strip().split("\n")
    assert lines[-1].startswith(name + ": ") and lines[-1].endswith(".")
    assert all(line.startswith(name + ": warning: ") for line in lines[:-1])
    return lines[-1]


def summary(out):
    with open(os.path.join(str(out), "summary.csv"), encoding="utf-8") as file:
        return {row["group"]: row for row in csv.DictReader(file)}


def fresh_mean(folder, snapshot, policy, own=True, split="train"):
    with open(os.path.join(folder, "final.csv")) as file:
        return statistics.mean(
            float(row["return_mean"]) for row in csv.DictReader(file)
            if (row["snapshot"], row["policy"], row["split"]) == (snapshot, policy, split)
            and (policy == "meta" or not own or row["task"] == row["trained_task"]))


def rows_of(folder, policy, split="train", context=None):
    """Lines of rounds.csv; of the meta-policy, unless told, after the most episodes."""
    with open(os.path.join(folder, "rounds.csv")) as file:
        rows = [row for row in csv.DictReader(file)
                if (row["policy"], row["split"]) == (policy, split)]
    if context is None:
        context = max(int(row["context_episodes"]) for row in rows)
    return [row for row in rows if int(row["context_episodes"]) == context]


def curve(folder, policy, split="train", context=None, column="return_mean"):
    """Mean return over the tasks in each round, straight from the file."""
    by_round = {}
    for row in rows_of(folder, policy, split, context):
        by_round.setdefault(int(row["round"]), []).append(float(row[column]))
    return [statistics.mean(by_round[r]) for r in sorted(by_round)]


def edit(folder, name, change):
    path = os.path.join(folder, name)
    with open(path) as file:
        text = file.read()
    with open(path, "w") as file:
        file.write(change(text))
    return path


def groups_of(top):
    folders, _ = pr.find_folders([str(top)])
    return pg.group_runs(pr.load_runs(folders))


def lines_of(axis):
    """{label: (x, y)} of what the legend names."""
    return {line.get_label(): (list(line.get_xdata()), list(line.get_ydata()))
            for line in axis.lines if not line.get_label().startswith("_")}


def over_seeds(folders, *arguments, **named):
    """Mean over seeds of a curve, straight from the files."""
    return [statistics.mean(v) for v in zip(*(curve(f, *arguments, **named) for f in folders))]


def table_row(text, *words):
    """The one line that holds all the words."""
    lines = [line for line in text.split("\n") if all(word in line for word in words)]
    assert len(lines) == 1, lines
    return lines[0]
