"""Run folders as pMeta writes them: found, read and checked.

A run folder holds config.yaml, manifest.json and rounds.csv, and final.csv if the kept policies
were tried on fresh episodes. pmeta_returns says what curves there are.
"""

import math
import os
import re

import numpy as np

from pmeta_files import (PlotError, read_columns, read_fresh, read_json, read_rounds, read_text,
                         read_trajectories, shown, warn)
from pmeta_manifest import figures_of, settings_of
from pmeta_returns import split_of, with_stand_ins, words_of

CONVERGENCE_MARKS = ("statements.csv", "gradient.csv", "contraction.csv")
CONVERGENCE_FILES = ("contraction.csv", "fixed_point.csv", "gradient.csv", "distance.csv")


def find_folders(dirs):
    """Run folders and convergence folders in and below `dirs`, each once, in a fixed order."""
    runs, convergence = {}, {}
    for top in dirs:
        if os.path.isfile(top):
            raise PlotError("%s is a file: give the run folder, or a folder above run folders."
                            % top)
        if not os.path.isdir(top):
            raise PlotError("there is no folder %s." % top)
        for folder, subfolders, files in os.walk(top, onerror=_refuse):
            subfolders.sort()
            if any(name in files for name in CONVERGENCE_MARKS):
                convergence.setdefault(os.path.realpath(folder), folder)
            elif "manifest.json" in files and "rounds.csv" in files:
                runs.setdefault(os.path.realpath(folder), folder)
            elif "manifest.json" in files:
                warn("%s is left out: it has a manifest.json but no rounds.csv." % folder)
    return list(runs.values()), list(convergence.values())


def _refuse(error):
    raise error


class Run:
    """A finished run: its settings, and per round the mean returns over its tasks."""

    def __init__(self, folder, manifest):
        self.folder = folder
        self.settings = settings_of(folder, manifest)
        self.experiment = str(_required(folder, manifest, "experiment", str))
        self.algorithm = str(_required(folder, manifest, "algorithm", str))
        # figures lie in folders of that name
        if (not re.fullmatch(r"[\w.+-]*\w[\w.+-]*", self.experiment)
                or len(self.experiment) > 100):
            raise PlotError("%s/manifest.json: experiment is '%s' but must be a plain name."
                            % (folder, shown(self.experiment)))
        self.seed = _required(folder, manifest, "seed", int)
        self.num_rounds = _required(folder, manifest, "rounds", int)
        self.manifest = manifest
        self.figures = figures_of(folder, manifest, self.algorithm,
                                  self.settings.get("learner"))
        self.started = str(manifest.get("started") or "")
        self.commit = str(manifest.get("commit") or "unknown")
        self.optimal = _optimal_return(manifest)
        path = os.path.join(folder, "rounds.csv")
        returns, steps = read_rounds(path)
        if not steps:
            raise PlotError("%s holds no returns although the run has finished." % path)
        self._check_bounds(path, returns)
        for key in self.figures.curves:
            if key not in returns:
                warn("%s has no %s return although its manifest.json names that curve."
                     % (path, words_of(key)))
        # those that evaluated: every k-th and the last
        interval = self.settings.get("evaluation_interval", 1)
        if not isinstance(interval, int) or interval < 1:
            raise PlotError("%s: the setting evaluation_interval is '%s' but must be a whole "
                            "number above 0." % (folder, shown(str(interval))))
        self.rounds = np.array([r for r in range(1, self.num_rounds + 1)
                                if r % interval == 0 or r == self.num_rounds])
        self.curves = with_stand_ins({key: self._curve(path, key, by_round)
                                      for key, by_round in returns.items()})
        self.returns = with_stand_ins(returns)
        # of each task, up to each round
        self.env_steps = np.array([np.mean(list(steps[r].values())) for r in self.rounds])
        self.num_tasks = 1 + max(task for by_task in steps.values() for task in by_task)
        self.num_tests = self._count_tests(path)
        self.task_names = _task_names(manifest, self.num_tasks)
        trained_on = _trained_on(manifest)
        tests = _task_names(manifest, self.num_tasks + self.num_tests)[self.num_tasks:]
        self.test_names = [name + (", trained on" if task in trained_on else "")
                           for task, name in enumerate(tests, self.num_tasks)]
        self.unseen = not trained_on.issuperset(self.tasks_of("meta_test"))
        path = os.path.join(folder, "final.csv")
        self.fresh = (read_fresh(path, self.num_tasks, self.num_tests) if os.path.isfile(path)
                      else {})
        path = os.path.join(folder, "trajectories.csv")
        self.trajectories = (read_trajectories(path, self.num_tasks, self.num_tests)
                             if os.path.isfile(path) else {})

    def tasks_of(self, key):
        """Numbers of the tasks that these returns are of; the test tasks follow the others."""
        tests = range(self.num_tasks, self.num_tasks + self.num_tests)
        return tests if split_of(key) == "test" else range(self.num_tasks)

    def by_task(self, key, snapshot):
        """Return of each task on the evaluation episodes of a round; NaN if it did not report."""
        # test tasks have no say in what is best
        curve = self.curves["meta" if split_of(key) == "test" else key]
        place = int(np.argmax(curve)) if snapshot == "best" else len(curve) - 1
        by_task = self.returns[key][self.rounds[place]]
        return np.array([by_task.get(task, math.nan) for task in self.tasks_of(key)])

    def mean_by_task(self, key):
        """Of each task the mean over the rounds; NaN if it did not report in every one."""
        by_round = [self.returns[key][r] for r in self.rounds]
        return np.array([np.mean([by_task.get(task, math.nan) for by_task in by_round])
                         for task in self.tasks_of(key)])

    def _check_bounds(self, path, returns):
        """The manifest and the table agree on rounds and tasks: what follows counts up to them."""
        for key, by_round in returns.items():
            if max(by_round) != self.num_rounds:
                raise PlotError("%s ends with round %d (%s) but its manifest.json says %d rounds."
                                % (path, max(by_round), words_of(key), self.num_rounds))
        found = set(task for by_round in returns.values() for by_task in by_round.values()
                    for task in by_task)
        listed = self.manifest.get("tasks")
        count = max(len(found), len(listed) if isinstance(listed, list) else 0)
        if max(found) >= count:
            raise PlotError("%s has a task %d but the run has %d tasks, numbered from 0."
                            % (path, max(found), count))

    def _count_tests(self, path):
        tests = set(task for by_task in self.returns.get("meta_test", {}).values()
                    for task in by_task)
        if tests and min(tests) < self.num_tasks:
            raise PlotError("%s: the test task %d does not follow the %d training tasks."
                            % (path, min(tests), self.num_tasks))
        return 1 + max(tests) - self.num_tasks if tests else 0

    def _curve(self, path, key, by_round):
        policy = words_of(key)
        tasks = max(len(by_task) for by_task in by_round.values())
        short = [r for r in by_round if len(by_round[r]) < tasks]
        if short:
            warn("%s: %s returns of some tasks are missing in %d rounds (first: round %d); "
                 "their means are over the tasks that reported."
                 % (self.folder, policy, len(short), min(short)))
        for r in self.rounds:
            if r not in by_round:
                raise PlotError("%s has no %s return of round %d." % (path, policy, r))
        return np.array([np.mean(list(by_round[r].values())) for r in self.rounds])


def load_runs(folders):
    """Reads the finished runs and names those left out; throws PlotError."""
    runs = []
    for folder in folders:
        manifest = _finished_manifest(folder)
        if manifest is not None:
            runs.append(Run(folder, manifest))
    return runs


def load_convergence(folders):
    """{folder: {file name: {column: array}}} of the finished convergence runs; throws PlotError."""
    found = {}
    for folder in folders:
        if not os.path.isfile(os.path.join(folder, "manifest.json")):
            warn("%s is left out: it has no manifest.json, so it has not finished." % folder)
        elif _finished_manifest(folder) is not None:
            found[folder] = {name: read_columns(os.path.join(folder, name))
                             for name in CONVERGENCE_FILES
                             if os.path.isfile(os.path.join(folder, name))}
    return found


def _finished_manifest(folder):
    """The manifest, or None and a warning if the run has not finished."""
    manifest = read_json(os.path.join(folder, "manifest.json"))
    if manifest.get("status") == "finished":
        return manifest
    done = manifest.get("rounds_done", "?")
    path = os.path.join(folder, "rounds.csv")
    if manifest.get("status") == "running" and os.path.isfile(path):
        # the manifest is written at the start and at the end alone
        lines = read_text(path).split("\n")[:-1]
        done = lines[-1].split(",")[0] if len(lines) > 1 else 0
    warn("%s is left out: its status is '%s' (%s of %s rounds), not 'finished'."
         % (folder, manifest.get("status"), done, manifest.get("rounds", "?")))
    return None


def _task_names(manifest, count):
    """What tells each task from the others, from their descriptions: "zeta 3", …"""
    tasks = manifest.get("tasks")
    # a comma within brackets is one of coordinates
    known = {task.get("task"): re.split(r", (?![^(\[]*[)\]])",
                                        shown(str(task.get("description") or ""), 200))
             for task in (tasks if isinstance(tasks, list) else [])
             if isinstance(task, dict) and isinstance(task.get("task"), int)}
    parts = [known.get(task, [""]) for task in range(count)]
    if len(set(map(len, parts))) == 1:
        differ = [i for i in range(len(parts[0])) if len(set(p[i] for p in parts)) > 1]
        parts = [[p[i] for i in differ] for p in parts]
    return [", ".join(p) or "task %d" % task for task, p in enumerate(parts)]


def _trained_on(manifest):
    """Numbers of the test tasks that are training tasks once more, going by their descriptions."""
    tasks = manifest.get("tasks")
    told = [(task.get("task"), task.get("split"), task.get("description"))
            for task in (tasks if isinstance(tasks, list) else []) if isinstance(task, dict)]
    trained = set(str(what) for _, split, what in told if split == "train" and what)
    return set(task for task, split, what in told if split == "test" and str(what) in trained)


def _required(folder, manifest, key, kind):
    value = manifest.get(key)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise PlotError("%s/manifest.json: '%s' is missing or of the wrong type." % (folder, key))
    return value


def _optimal_return(manifest):
    """Mean over the training tasks, or None unless every one knows its own."""
    tasks = manifest.get("tasks")
    if not isinstance(tasks, list):
        return None
    tasks = [task if isinstance(task, dict) else {} for task in tasks]
    values = [task.get("optimal_return") for task in tasks if task.get("split") != "test"]
    if not values or not all(is_number(value) for value in values):
        return None
    return float(np.mean(values))


def is_number(value):
    return (isinstance(value, (int, float)) and not isinstance(value, bool)
            and abs(value) < math.inf)
