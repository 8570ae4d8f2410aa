"""Run folders as pMeta writes them: found, read, checked, and grouped by settings.

A run folder holds config.yaml, manifest.json and rounds.csv, and final.csv if the kept policies
were tried on fresh episodes. A group is all runs of one experiment whose settings are equal but for
the seed; a group's curves are seeds x rounds, each entry the mean return over the training tasks,
or over the test tasks. pmeta_returns says what curves there are.
"""

import math
import os
import re

import numpy as np

from pmeta_files import (OWN_BEST, PlotError, read_columns, read_fresh, read_json, read_rounds,
                         read_text, read_yaml, shown, warn)
from pmeta_returns import POLICIES, adaptations, split_of, with_stand_ins, words_of

CONVERGENCE_MARKS = ("statements.csv", "gradient.csv", "contraction.csv")
CONVERGENCE_FILES = ("contraction.csv", "fixed_point.csv", "gradient.csv", "distance.csv")

# settings that name a run or pace it, and do not shape its result
NAMES = {"experiment", "preset", "algorithm", "seed", "run_id", "results_dir", "pace",
         "publish_trajectories", "fresh_episodes"}
# how far a run goes: where they differ, rounds compare nothing, but environment steps do
LENGTHS = ("rounds", "updates_per_round")
# settings an algorithm fixes or does not use: they tell no two groups of it apart
PROXIMAL = {"personal.lambda", "personal.lambda_actor", "personal.lambda_critic",
            "personal.lambda_encoder", "personal.eta", "personal.personal_init",
            "personal.proximal"}
AGGREGATION = {"aggregation.beta", "aggregation.quorum", "aggregation.round_timeout"}
UNUSED = {
    "model_averaging": PROXIMAL,
    "independent": PROXIMAL | AGGREGATION,
    "pooled": PROXIMAL | AGGREGATION,
}
DEFAULTS = {"personal.lambda": 10, "personal.personal_init": "meta"}
ALGORITHMS = {"pmeta": "pMeta-RL", "model_averaging": "model averaging",
              "independent": "independent", "pooled": "pooled"}
SYMBOLS = {"personal.lambda": "λ", "personal.alpha": "α", "personal.eta": "η",
           "aggregation.beta": "β", "q_learning.gamma": "γ", "q_learning.updates": "K",
           "updates_per_round": "R", "rounds": "C"}


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


def load(dirs):
    """(experiments, convergence): all that has finished in and below `dirs`; throws PlotError."""
    run_folders, convergence_folders = find_folders(dirs)
    where = " or ".join(dirs)
    if not run_folders and not convergence_folders:
        raise PlotError("there are no runs in %s: a run folder holds manifest.json and rounds.csv."
                        % where)
    experiments = group_runs(load_runs(run_folders))
    convergence = load_convergence(convergence_folders)
    if not experiments and not convergence:
        raise PlotError("none of the %d runs in %s has finished."
                        % (len(run_folders) + len(convergence_folders), where))
    return experiments, convergence


class Run:
    """A finished run: its settings, and per round the mean returns over its tasks."""

    def __init__(self, folder, manifest):
        self.folder = folder
        config = read_yaml(os.path.join(folder, "config.yaml"))
        self.settings = _flatten(config)
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
        self.started = str(manifest.get("started") or "")
        self.commit = str(manifest.get("commit") or "unknown")
        self.optimal = _optimal_return(manifest)
        path = os.path.join(folder, "rounds.csv")
        returns, steps = read_rounds(path)
        if not steps:
            raise PlotError("%s holds no returns although the run has finished." % path)
        self._check_bounds(path, returns)
        # those that evaluated: every k-th and the last
        interval = self.settings.get("evaluation_interval", 1)
        if not isinstance(interval, int) or interval < 1:
            raise PlotError("%s/config.yaml: evaluation_interval is '%s' but must be a whole "
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
        self.test_names = _task_names(manifest, self.num_tasks + self.num_tests)[self.num_tasks:]
        path = os.path.join(folder, "final.csv")
        self.fresh = (read_fresh(path, self.num_tasks, self.num_tests) if os.path.isfile(path)
                      else {})

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


def _flatten(config, prefix=""):
    flat = {}
    for key, value in config.items():
        if isinstance(value, dict):
            flat.update(_flatten(value, prefix + str(key) + "."))
        else:
            flat[prefix + str(key)] = _plain(value)
    return flat


def _plain(value):
    """A value that can be compared and hashed; YAML 1.1 takes 1e-05 for text, which it is not."""
    if isinstance(value, list):
        return _plain(value[0]) if len(value) == 1 else tuple(_plain(item) for item in value)
    if isinstance(value, dict):
        return tuple(sorted(_flatten(value).items()))
    if isinstance(value, str):
        try:
            return float(value) if math.isfinite(float(value)) else value
        except ValueError:
            return value
    return value


class Group:
    """Runs of one algorithm with equal settings, one a seed, in the order of their seeds."""

    def __init__(self, algorithm, settings, runs):
        self.algorithm = algorithm
        self.settings = settings
        self.runs = runs
        self.seeds = [run.seed for run in runs]
        self.label = ALGORITHMS.get(algorithm, algorithm.replace("_", " "))
        self.policies = [p for p in POLICIES if all(p in r.curves for r in runs)]

    @property
    def rounds(self):
        return self.runs[0].rounds

    @property
    def env_steps(self):
        """Environment steps of each task up to each round, mean over seeds."""
        return np.mean([run.env_steps for run in self.runs], axis=0)

    def adaptations(self, split):
        """Numbers of exploration episodes that the meta-policy was tried after, ascending."""
        return [count for count in adaptations(self.runs[0].curves, split)
                if all((split, count) in run.curves for run in self.runs)]

    def curves(self, policy):
        """Seeds x rounds."""
        return np.array([run.curves[policy] for run in self.runs])

    def last(self, policy):
        return self.curves(policy)[:, -1]

    def auc(self, policy):
        """Mean over the rounds: the area under the curve, in units of return."""
        return self.curves(policy).mean(axis=1)

    def best(self, policy):
        """The largest mean over the tasks in any round: what the paper calls best."""
        return self.curves(policy).max(axis=1)

    def fresh(self, snapshot, policies):
        """Mean over the tasks on fresh episodes, of the seeds that have it."""
        return np.array([run.fresh[snapshot, policies].mean() for run in self.runs
                         if (snapshot, policies) in run.fresh])

    def by_task(self, policies, snapshot):
        """(seeds x tasks, "fresh" or "evaluation"), or None if there is none of it."""
        if all((snapshot, policies) in run.fresh for run in self.runs):
            return np.array([run.fresh[snapshot, policies] for run in self.runs]), "fresh"
        if policies not in self.policies:
            return None
        return np.array([run.by_task(policies, snapshot) for run in self.runs]), "evaluation"

    def scores(self, policies, measure):
        """Seeds x tasks of "last", "best", "auc" or "fresh_…", or None where one is missing."""
        if measure.startswith("fresh_"):
            key = (measure[len("fresh_"):], policies)
            found = [run.fresh[key] for run in self.runs if key in run.fresh]
        elif policies in self.policies:
            found = [run.mean_by_task(policies) if measure == "auc"
                     else run.by_task(policies, measure) for run in self.runs]
        else:
            return None
        known = found and len(set(map(len, found))) == 1 and np.isfinite(found).all()
        return np.array(found) if known else None

    @property
    def deep(self):
        return self.settings.get("learner", "q_learning") != "q_learning"

    def optimal(self):
        values = [run.optimal for run in self.runs]
        return None if None in values else float(np.mean(values))

    def context(self):
        """The settings that a baseline shares."""
        return tuple(sorted((k, v) for k, v in self.settings.items() if k not in PROXIMAL))


def group_runs(runs):
    """{experiment: [Group]}, labelled by the settings that differ within the experiment."""
    buckets = {}
    for run in runs:
        unused = NAMES | UNUSED.get(run.algorithm, set())
        settings = tuple(sorted((k, v) for k, v in run.settings.items() if k not in unused))
        buckets.setdefault(run.experiment, {}).setdefault((run.algorithm, settings), []).append(run)
    experiments = {}
    for experiment in sorted(buckets):
        groups = [Group(algorithm, dict(settings), _one_a_seed(members))
                  for (algorithm, settings), members in buckets[experiment].items()]
        order = list(ALGORITHMS)
        keys = varying(groups)
        groups.sort(key=lambda g: (order.index(g.algorithm) if g.algorithm in order else len(order),
                                   g.algorithm, [sort_key(g.settings.get(k)) for k in keys]))
        for group in groups:
            group.label = " ".join([group.label] + setting_texts(group, keys))
            for known, what, returns in (
                    ([bool(r.fresh) for r in group.runs], "final.csv", "fresh"),
                    ([(OWN_BEST, "personal") in r.fresh for r in group.runs if r.fresh],
                     "own_best in final.csv", "own best")):
                if 0 < sum(known) < len(known):
                    warn("%d of the %d runs of %s, %s, have no %s: %s returns are over the "
                         "others." % (len(known) - sum(known), len(known), experiment, group.label,
                                      what, returns))
            commits = sorted(set(run.commit for run in group.runs))
            if len(commits) > 1:
                warn("the runs of %s, %s, come from %d versions of the code: %s."
                     % (experiment, group.label, len(commits), ", ".join(commits)))
        experiments[experiment] = groups
    return experiments


def _one_a_seed(runs):
    """The newest run of every seed; says so where an older one differs."""
    newest = {}
    for run in sorted(runs, key=lambda r: (r.seed, r.started, r.folder)):
        old = newest.get(run.seed)
        if old is not None and not _same_curves(old, run):
            warn("%s is left out: %s has the same settings and seed, is newer, and differs."
                 % (old.folder, run.folder))
        # the same run once more, without fresh episodes, tells less
        if old is None or run.fresh or not old.fresh or not _same_curves(old, run):
            newest[run.seed] = run
    return list(newest.values())


def _same_curves(a, b):
    return a.curves.keys() == b.curves.keys() and all(
        np.array_equal(a.curves[policy], b.curves[policy]) for policy in a.curves)


def varying(groups):
    """Keys whose value differs between groups that use them: lambda, then by name."""
    keys = sorted(set(key for group in groups for key in group.settings),
                  key=lambda key: (key != "personal.lambda", key))
    return [key for key in keys if len(set(
        group.settings.get(key) for group in groups
        if key not in UNUSED.get(group.algorithm, set()))) > 1]


def setting_texts(group, keys):
    """["λ=10", …] of the keys it uses; lambda always, being what makes pMeta-RL."""
    shown = list(keys)
    if "personal.lambda" in group.settings and "personal.lambda" not in keys:
        shown.insert(0, "personal.lambda")
    unused = UNUSED.get(group.algorithm, set())
    return [setting_text(k, group.settings.get(k)) for k in shown if k not in unused]


def fixed_texts(group, groups, key):
    """["η=0.08", …]: the settings besides `key` that differ between `groups`."""
    return [setting_text(k, group.settings.get(k)) for k in varying(groups) if k != key]


def short_name(key):
    return key.split(".")[-1]


def symbol(key):
    return SYMBOLS.get(key, short_name(key))


def setting_text(key, value):
    return symbol(key) + "=" + value_text(value)


def value_text(value):
    if isinstance(value, tuple):
        return "[" + ",".join(value_text(item) for item in value) + "]"
    if is_number(value):
        return "%.6g" % value
    return "unset" if value is None else str(value)


def sort_key(value):
    return (0, value, "") if is_number(value) else (1, 0, value_text(value))


def reference(groups):
    """The group whose settings most runs share; among equals the default, then the middle one."""
    keys = varying(groups)

    def score(group):
        shared = sum(len(other.runs) for key in keys for other in groups
                     if other.settings.get(key) == group.settings.get(key))
        return shared, sum(group.settings.get(k) == v for k, v in DEFAULTS.items())

    best = max(score(group) for group in groups)
    candidates = [group for group in groups if score(group) == best]
    return candidates[(len(candidates) - 1) // 2]


def baseline_of(group, groups, algorithm="model_averaging", free=()):
    """The group of `algorithm` with the settings of `group` in all that it uses, or None.

    Those in `free` may differ; of several such groups, the one that goes furthest.
    """
    unused = UNUSED.get(algorithm, set()) | set(free)

    def used(settings):
        return {k: v for k, v in settings.items() if k not in unused}

    found = [other for other in groups
             if other.algorithm == algorithm and used(other.settings) == used(group.settings)]
    return max(found, key=lambda other: other.env_steps[-1], default=None)


def differ_in_length(groups):
    """Do their rounds stand for different numbers of updates, or are there more of them?"""
    return len(set(tuple(group.settings.get(k) for k in LENGTHS) for group in groups)) > 1


def pmeta_only(groups):
    return [group for group in groups if group.algorithm == "pmeta"]


def chief(groups, limit):
    """All groups in their order, or of too many the reference, its baselines, and the next."""
    if len(groups) <= limit:
        return groups
    first = reference(pmeta_only(groups) or groups)
    first = [first] + [baseline_of(first, groups, name) for name in ALGORITHMS]
    chosen = [g for g in groups if g in first] + [g for g in groups if g not in first]
    return [g for g in groups if g in chosen[:limit]]


def slices(groups, key):
    """Lists of groups that differ in `key` alone, each sorted by it; only where it does vary."""
    by_rest = {}
    for group in groups:
        rest = tuple(sorted((k, v) for k, v in group.settings.items() if k != key))
        by_rest.setdefault(rest, []).append(group)
    found = [sorted(members, key=lambda g: sort_key(g.settings.get(key)))
             for members in by_rest.values()]
    return [members for members in found if len(members) > 1]
