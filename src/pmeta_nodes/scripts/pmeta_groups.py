"""Runs grouped by their settings, and what tells groups apart.

A group is all runs of one experiment whose settings are equal but for the seed; its curves are
seeds x rounds, each entry the mean return over the training tasks, or over the test tasks.
"""

import numpy as np

from pmeta_files import OWN_BEST, PlotError, warn
from pmeta_returns import POLICIES, adaptations
from pmeta_runs import find_folders, is_number, load_convergence, load_runs

# settings that name a run or look at its result, and do not shape it
NAMES = {"experiment", "preset", "algorithm", "seed", "run_id", "fresh_episodes"}
# how far a run goes: where they differ, rounds compare nothing, but environment steps do
LENGTHS = ("rounds", "updates_per_round", "steps_per_round")
# and how often it is looked at
LOOKS = LENGTHS + ("evaluation_interval",)
DEFAULTS = {"personal.lambda": 10, "personal.personal_init": "meta"}
SYMBOLS = {"personal.lambda": "λ", "personal.alpha": "α", "personal.eta": "η",
           "aggregation.beta": "β", "q_learning.gamma": "γ", "q_learning.updates": "K",
           "updates_per_round": "R", "rounds": "C"}


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


class Group:
    """Runs of one algorithm with equal settings, one a seed, in the order of their seeds."""

    def __init__(self, algorithm, settings, runs):
        self.algorithm = algorithm
        self.settings = settings
        self.runs = runs
        self.seeds = [run.seed for run in runs]
        self.figures = runs[0].figures
        # settings that others of the experiment have, and no run of this algorithm
        self.absent = frozenset()
        self.place = None  # among all algorithms, see _tell_places()
        self.label = self.name
        self.policies = [p for p in POLICIES if all(p in r.curves for r in runs)]

    @property
    def name(self):
        """Of the algorithm, for people; the label says also which settings."""
        return self.figures.label

    @property
    def unused(self):
        """Settings by which it cannot be told from others."""
        return self.figures.fixed_settings | self.absent

    @property
    def rounds(self):
        return self.runs[0].rounds

    @property
    def env_steps(self):
        """Environment steps of each task up to each round, mean over seeds."""
        return np.mean([run.env_steps for run in self.runs], axis=0)

    @property
    def total_steps(self):
        """The same over all training tasks."""
        return self.env_steps * self.runs[0].num_tasks

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

    def final(self, policy):
        """Mean over the last tenth of the evaluations."""
        return self.curves(policy)[:, -last_tenth(len(self.rounds)):].mean(axis=1)

    def at_steps(self, policy, steps):
        """Mean over the last tenth of the way to so many steps of all tasks; None before any mark.

        Marks of other methods lie elsewhere: it is read off the lines between one's own.
        """
        marks = self.total_steps
        if steps < marks[0]:
            return None
        places = np.linspace(max(marks[0], 0.9 * steps), steps, 11)
        return np.array([np.interp(places, marks, c).mean() for c in self.curves(policy)])

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

    def optimal(self):
        values = [run.optimal for run in self.runs]
        return None if None in values else float(np.mean(values))

    def context(self):
        """What a baseline shares: the settings but for those that are the algorithm's own."""
        return self.algorithm, tuple(sorted(
            (k, v) for k, v in self.settings.items() if k not in self.figures.own_settings))


def group_runs(runs):
    """{experiment: [Group]}, labelled by the settings that differ within the experiment."""
    buckets = {}
    for run in runs:
        unused = NAMES | run.figures.fixed_settings
        settings = tuple(sorted((k, v) for k, v in run.settings.items() if k not in unused))
        buckets.setdefault(run.experiment, {}).setdefault((run.algorithm, settings), []).append(run)
    experiments = {}
    for experiment in sorted(buckets):
        groups = [Group(algorithm, dict(settings), _one_a_seed(members))
                  for (algorithm, settings), members in buckets[experiment].items()]
        _tell_absent(groups)
        keys = varying(groups)
        groups.sort(key=lambda g: (g.figures.order, g.algorithm,
                                   [sort_key(g.settings.get(k)) for k in keys]))
        for group in groups:
            group.label = " ".join([group.label] + setting_texts(
                group, [key for key in keys if not _goes_without_saying(group, key, groups)]))
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
    _tell_places([group for groups in experiments.values() for group in groups])
    return experiments


def last_tenth(marks):
    return max(1, marks // 10)


def _tell_places(groups):
    """The order of each algorithm, which no other has, though runs of other versions differ in it."""
    places = {}
    for order, algorithm in sorted((g.figures.order, g.algorithm) for g in groups):
        if algorithm not in places:
            places[algorithm] = order
            while places[algorithm] in [p for a, p in places.items() if a != algorithm]:
                places[algorithm] += 1
    for group in groups:
        group.place = places[group.algorithm]


def _tell_absent(groups):
    """What an algorithm has no use for at all is no difference between it and others."""
    known = {}
    for group in groups:
        known.setdefault(group.algorithm, set()).update(group.settings)
    every = frozenset().union(*known.values())
    for group in groups:
        group.absent = every - known[group.algorithm]


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
        if key not in group.unused)) > 1]


def _goes_without_saying(group, key, groups):
    """Is a group's value that of most groups, and of all of its algorithm?"""
    value = group.settings.get(key)
    users = [other for other in groups if key not in other.unused]
    alike = [other for other in users if other.settings.get(key) == value]
    return 2 * len(alike) > len(users) and all(
        other in alike for other in users if other.algorithm == group.algorithm)


def setting_texts(group, keys):
    """["λ=10", …] of the keys it uses; lambda always: how much the personal policies are pulled."""
    shown = list(keys)
    if "personal.lambda" in group.settings and "personal.lambda" not in keys:
        shown.insert(0, "personal.lambda")
    return [setting_text(k, group.settings.get(k)) for k in shown
            if k not in group.unused]


def fixed_texts(group, groups, key):
    """["η=0.08", …]: the settings besides `key` that differ between `groups`."""
    return [setting_text(k, group.settings.get(k)) for k in varying(groups)
            if k != key and k not in group.absent]


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


def baseline_of(group, groups, algorithm, free=()):
    """The group of `algorithm` with the settings of `group` in all that both use, or None.

    Those in `free` may differ; of several such groups, the one that goes furthest.
    """
    def same(other):
        unused = other.unused | group.absent | set(free)
        return {k: v for k, v in other.settings.items() if k not in unused} == {
            k: v for k, v in group.settings.items() if k not in unused}

    found = [other for other in groups if other.algorithm == algorithm and same(other)]
    return max(found, key=lambda other: other.env_steps[-1], default=None)


def rival_of(group, groups, algorithm):
    """The same, or of another length, for what is drawn over environment steps."""
    return baseline_of(group, groups, algorithm) or baseline_of(group, groups, algorithm, LOOKS)


def baselines(groups):
    """The algorithms that others are compared with, in their order."""
    return list(dict.fromkeys(group.algorithm for group in groups if group.figures.baseline))


def reference_line(group, groups):
    """The baseline with the settings of `group` whose meta-policy is drawn as a line, or None."""
    algorithms = dict.fromkeys(g.algorithm for g in groups if g.figures.reference_line)
    found = [baseline_of(group, groups, algorithm) for algorithm in algorithms]
    return next((b for b in found if b is not None and "meta" in b.policies), None)


def differ_in_length(groups):
    """Do their rounds stand for different numbers of updates, or are there more of them?"""
    return len(set(tuple(group.settings.get(k) for k in LENGTHS) for group in groups)) > 1


def without_baselines(groups):
    return [group for group in groups if not group.figures.baseline]


def chief(groups, limit):
    """All groups in their order, or of too many the reference, its baselines, and the next."""
    if len(groups) <= limit:
        return groups
    first = reference(without_baselines(groups) or groups)
    first = [first] + [rival_of(first, groups, name) for name in baselines(groups)]
    chosen = [g for g in groups if g in first] + [g for g in groups if g not in first]
    return [g for g in groups if g in chosen[:limit]]


def slices(groups, key):
    """Lists of groups that differ in `key` alone, each sorted by it; only where it does vary."""
    by_rest = {}
    for group in groups:
        rest = group.algorithm, tuple(sorted((k, v) for k, v in group.settings.items()
                                             if k != key))
        by_rest.setdefault(rest, []).append(group)
    found = [sorted(members, key=lambda g: sort_key(g.settings.get(key)))
             for members in by_rest.values()]
    return [members for members in found if len(members) > 1]
