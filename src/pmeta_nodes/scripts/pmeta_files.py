"""The files of a run folder, read and checked: what is wrong is named by file and line."""

import contextlib
import json
import math
import os
import sys

import numpy as np
import yaml

from pmeta_returns import key_of

# those of older runs lack a column
HEADERS = ("round,task,split,policy,context_episodes,return_mean,return_std,episodes,env_steps,"
           "updates,wall_s",
           "round,task,split,policy,return_mean,return_std,episodes,env_steps,updates,wall_s")
FRESH_HEADERS = (
    "snapshot,round,policy,trained_task,task,split,return_mean,return_std,episodes",
    "snapshot,round,policy,trained_task,task,return_mean,return_std,episodes")
PATH_COLUMNS = ("policy", "split", "task", "context_episodes", "step")
SNAPSHOTS = ("best", "last")
OWN_BEST = "own_best"
WORD_COLUMNS = ("diversity", "step", "update")


class PlotError(Exception):
    """What is wrong with the input, in one sentence."""


_receivers = [lambda text: print("pmeta: warning: " + text, file=sys.stderr)]


def warn(text):
    _receivers[-1](text)


@contextlib.contextmanager
def warnings_to(receiver):
    """Within it, warn(text) calls receiver(text)."""
    _receivers.append(receiver)
    try:
        yield
    finally:
        _receivers.pop()


def read_columns(path):
    """{column: values} of a convergence file: words, or floats where NaN is fair."""
    columns = {name: [] for name in read_text(path).split("\n", 1)[0].split(",")}
    for number, row in read_csv(path):
        for name, text in row.items():
            if name not in WORD_COLUMNS:
                try:
                    text = float(text)
                except ValueError:
                    raise PlotError("%s line %d: %s is '%s', not a number."
                                    % (path, number, name, text))
            columns[name].append(text)
    return {name: np.array(values) for name, values in columns.items()}


def require_columns(path, columns, names):
    for name in names:
        if name not in columns:
            raise PlotError("%s line 1: the column '%s' is missing." % (path, name))


def read_rounds(path):
    """(returns, steps) of a rounds.csv.

    returns: {key of pmeta_returns: {round: {task: return_mean}}}; steps: {round: {training task:
    environment steps up to then}}.
    """
    returns, steps = {}, {}
    for number, row in read_csv(path, HEADERS):
        where = "%s line %d" % (path, number)
        round_, task, context = (to_int(where, key, row.get(key, "0"))
                                 for key in ("round", "task", "context_episodes"))
        for key in ("return_mean", "return_std", "episodes", "env_steps", "updates", "wall_s"):
            row[key] = to_number(where, key, row[key])
        policy, split = row["policy"], row["split"]
        if policy not in ("personal", "meta") or split not in ("train", "test"):
            raise PlotError("%s: split and policy are '%s' and '%s' but must be train or test, and "
                            "personal or meta." % (where, split, policy))
        if round_ < 1 or task < 0 or context < 0:
            raise PlotError("%s: round %d, task %d, context_episodes %d is out of range."
                            % (where, round_, task, context))
        if policy == "personal" and (split, context) != ("train", 0):
            raise PlotError("%s: a personal policy neither adapts nor has test tasks." % where)
        by_task = returns.setdefault(key_of(policy, split, context), {}).setdefault(round_, {})
        if task in by_task:
            raise PlotError("%s repeats round %d, task %d, %s." % (where, round_, task, policy))
        by_task[task] = row["return_mean"]
        if split == "train":
            steps.setdefault(round_, {})[task] = row["env_steps"]
    return returns, steps


def read_fresh(path, tasks, tests):
    """{(snapshot, policies): return of each task} of a final.csv with so many tasks and test tasks.

    `policies` is personal (each on its own task), meta, meta_test (on the test tasks), or all: the
    mean over the personal policies of all tasks.
    """
    found = {}
    for number, row in read_csv(path, FRESH_HEADERS):
        where = "%s line %d" % (path, number)
        trained, task = (to_int(where, key, row[key]) for key in ("trained_task", "task"))
        value = to_number(where, "return_mean", row["return_mean"])
        snapshot, policy, split = row["snapshot"], row["policy"], row.get("split", "train")
        if snapshot not in SNAPSHOTS + (OWN_BEST,) or policy not in ("personal", "meta"):
            raise PlotError("%s: snapshot and policy are '%s' and '%s' but must be last, best or "
                            "own_best, and personal or meta." % (where, snapshot, policy))
        if split not in ("train", "test"):
            raise PlotError("%s: split is '%s' but must be train or test." % (where, split))
        known = range(tasks) if split == "train" else range(tasks, tasks + tests)
        if task not in known or not (0 <= trained < tasks or policy == "meta"):
            raise PlotError("%s: task %d (%s) or trained_task %d is out of range."
                            % (where, task, split, trained))
        if snapshot == OWN_BEST and (policy, trained) != ("personal", task):
            raise PlotError("%s: own_best is of a personal policy on its own task." % where)
        for name in _fresh_names(snapshot, policy, split, trained == task):
            by_pair = found.setdefault((snapshot, name), {})
            if (trained, task) in by_pair:
                raise PlotError("%s repeats an earlier line." % where)
            by_pair[trained, task] = value
    fresh = {}
    for (snapshot, name), by_pair in found.items():
        known = range(tasks, tasks + tests) if name == "meta_test" else range(tasks)
        complete = tasks * tasks if name == "all" else len(known)
        if len(by_pair) == complete and (name != "all" or tasks > 1):
            fresh[snapshot, name] = np.array([
                np.mean([by_pair[pair] for pair in sorted(by_pair) if pair[1] == task])
                for task in known])
        elif snapshot == OWN_BEST:
            # a task that never reported has no best round
            warn("%s has the own_best returns of %d of %d tasks: they are left out."
                 % (path, len(by_pair), complete))
        elif name != "all":
            raise PlotError("%s has the %s returns (%s) of %d of %d tasks."
                            % (path, name, snapshot, len(by_pair), complete))
    return fresh


def _fresh_names(snapshot, policy, split, own):
    """What one line of final.csv counts among."""
    if policy == "meta":
        return ["meta" if split == "train" else "meta_test"]
    return ["all"] * (snapshot != OWN_BEST) + ["personal"] * own


def read_trajectories(path, tasks, tests):
    """{key of pmeta_returns: {task: its observations, steps x size}} of a trajectories.csv."""
    found = {}
    for number, row in read_csv(path):
        where = "%s line %d" % (path, number)
        require_columns(path, row, PATH_COLUMNS + ("observation_0",))
        task, count, step = (to_int(where, k, row[k]) for k in PATH_COLUMNS[2:])
        policy, split = row["policy"], row["split"]
        known = {"train": range(tasks), "test": range(tasks, tasks + tests)}.get(split, ())
        if (policy not in ("personal", "meta") or task not in known or count < 0
                or (policy == "personal" and (split, count) != ("train", 0))):
            raise PlotError("%s: there is no such policy, split, task or context_episodes." % where)
        path_of_task = found.setdefault(key_of(policy, split, count), {}).setdefault(task, [])
        if step != len(path_of_task):
            raise PlotError("%s: step is %d but must be %d." % (where, step, len(path_of_task)))
        path_of_task.append([to_number(where, name, value) for name, value in row.items()
                             if name not in PATH_COLUMNS])
    return {key: {task: np.array(rows) for task, rows in by_task.items()}
            for key, by_task in found.items()}


def read_text(path):
    """The text of a regular file, without the mark that some editors put before it."""
    if os.path.exists(path) and not os.path.isfile(path):
        # to open a pipe would wait for its other end
        raise PlotError("%s is not a regular file." % path)
    try:
        with open(path, encoding="utf-8-sig") as file:
            return file.read()
    except UnicodeDecodeError:
        raise PlotError("%s is not a text file in UTF-8." % path)


def shown(text, length=60):
    """A stranger's text for a sentence or a figure: cut, and without control characters."""
    plain = "".join(c if c.isprintable() else "?" for c in text[:length])
    return plain + "…" * (len(text) > length)


def read_csv(path, headers=()):
    """(line number, {column: text}) of every row; without `headers` any header will do."""
    text = read_text(path)
    if not text:
        raise PlotError("%s line 1: the file is empty." % path)
    lines = text.split("\n")
    if headers and lines[0] not in headers:
        raise PlotError("%s line 1: the header is '%s' but must be '%s'."
                        % (path, shown(lines[0]), headers[0]))
    if lines[-1] != "":
        raise PlotError("%s line %d is truncated: it does not end." % (path, len(lines)))
    while lines and not lines[-1].strip():
        lines.pop()
    columns = lines[0].split(",")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        fields = line.split(",")
        if len(fields) != len(columns):
            raise PlotError("%s line %d %s." % (path, number, "has %d fields instead of %d" % (
                len(fields), len(columns)) if line.strip() else "is blank: remove it"))
        rows.append((number, dict(zip(columns, fields))))
    return rows


def to_number(where, key, text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlotError("%s: %s is '%s', not a finite number." % (where, key, text))
    return value


def to_int(where, key, text):
    try:
        return int(text)
    except ValueError:
        raise PlotError("%s: %s is '%s', not a whole number." % (where, key, text))


def read_json(path):
    """The object that a JSON file holds."""
    try:
        data = json.loads(read_text(path))
    except ValueError as error:
        raise PlotError("%s is not valid JSON: %s." % (path, error))
    except RecursionError:
        raise PlotError("%s is nested too deeply to be read." % path)
    if not isinstance(data, dict):
        raise PlotError("%s must hold a JSON object." % path)
    return data


class _Loader(yaml.SafeLoader):
    """Without aliases, by which a short file can stand for an endless one."""

    def compose_node(self, parent, index):
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.composer.ComposerError(None, None, "aliases are not read", event.start_mark)
        return super().compose_node(parent, index)


def read_yaml(path):
    data = parse_yaml(read_text(path), path)
    if not isinstance(data, dict):
        raise PlotError("%s must hold settings as 'key: value' lines." % path)
    return data


def parse_yaml(text, where):
    """The value of a YAML text; `where` names it in errors."""
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = " line %d" % (mark.line + 1) if mark else ""
        problem = getattr(error, "problem", None)
        raise PlotError("%s%s is not valid YAML%s."
                        % (where, line, ": " + problem if problem else ""))
    except RecursionError:
        raise PlotError("%s is nested too deeply to be read." % where)
