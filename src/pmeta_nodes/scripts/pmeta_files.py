"""The files of a run folder, read and checked: what is wrong is named by file and line."""

import contextlib
import math
import sys

import numpy as np
import yaml

HEADER = "round,task,split,policy,return_mean,return_std,episodes,env_steps,updates,wall_s"
FRESH_HEADER = "snapshot,round,policy,trained_task,task,return_mean,return_std,episodes"
SNAPSHOTS = ("best", "last")
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
    header = tuple(read_text(path).split("\n", 1)[0].split(","))
    columns = {name: [] for name in header}
    for number, fields in read_csv(path):
        for name, text in zip(header, fields):
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
    """{policy: {round: {task: return_mean}}} of the training split of a rounds.csv."""
    returns = {}
    skipped = 0
    for number, fields in read_csv(path, HEADER):
        where = "%s line %d" % (path, number)
        row = dict(zip(HEADER.split(","), fields))
        round_, task = to_int(where, "round", row["round"]), to_int(where, "task", row["task"])
        for key in ("return_mean", "return_std", "episodes", "env_steps", "updates", "wall_s"):
            row[key] = to_number(where, key, row[key])
        if row["policy"] not in ("personal", "meta") or row["split"] not in ("train", "test"):
            raise PlotError("%s: split and policy are '%s' and '%s' but must be train or test, and "
                            "personal or meta." % (where, row["split"], row["policy"]))
        if round_ < 1 or task < 0:
            raise PlotError("%s: round %d, task %d is out of range." % (where, round_, task))
        if row["split"] == "test":
            skipped += 1
            continue
        by_task = returns.setdefault(row["policy"], {}).setdefault(round_, {})
        if task in by_task:
            raise PlotError("%s repeats round %d, task %d, %s." % (where, round_, task,
                                                                  row["policy"]))
        by_task[task] = row["return_mean"]
    if skipped:
        warn("%s: %d rows of test tasks are not drawn." % (path, skipped))
    return returns


def read_fresh(path, tasks):
    """{(snapshot, policies): return of each task} of a final.csv.

    `policies` is personal (each on its own task), meta, or all: the mean over the personal
    policies of all tasks.
    """
    found = {}
    for number, fields in read_csv(path, FRESH_HEADER):
        where = "%s line %d" % (path, number)
        row = dict(zip(FRESH_HEADER.split(","), fields))
        trained, task = to_int(where, "trained_task", row["trained_task"]), to_int(where, "task",
                                                                                   row["task"])
        value = to_number(where, "return_mean", row["return_mean"])
        if row["snapshot"] not in SNAPSHOTS or row["policy"] not in ("personal", "meta"):
            raise PlotError("%s: snapshot and policy are '%s' and '%s' but must be last or best, "
                            "and personal or meta." % (where, row["snapshot"], row["policy"]))
        if not 0 <= task < tasks or not (0 <= trained < tasks or row["policy"] == "meta"):
            raise PlotError("%s: task %d or trained_task %d is out of range." % (where, task,
                                                                                trained))
        names = [row["policy"]] if row["policy"] == "meta" else (
            ["all"] + ["personal"] * (trained == task))
        for name in names:
            by_pair = found.setdefault((row["snapshot"], name), {})
            if (trained, task) in by_pair:
                raise PlotError("%s repeats an earlier line." % where)
            by_pair[trained, task] = value
    fresh = {}
    for (snapshot, name), by_pair in found.items():
        complete = tasks * tasks if name == "all" else tasks
        if len(by_pair) == complete and (name != "all" or tasks > 1):
            fresh[snapshot, name] = np.array([
                np.mean([by_pair[pair] for pair in sorted(by_pair) if pair[1] == task])
                for task in range(tasks)])
        elif name != "all":
            raise PlotError("%s has the %s returns (%s) of %d of %d tasks."
                            % (path, name, snapshot, len(by_pair), tasks))
    return fresh


def read_text(path):
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except UnicodeDecodeError:
        raise PlotError("%s is not a text file." % path)


def read_csv(path, header=None):
    """(line number, fields) of every row below the header; without `header` any will do."""
    text = read_text(path)
    if not text:
        raise PlotError("%s line 1: the file is empty." % path)
    lines = text.split("\n")
    if header is not None and lines[0] != header:
        raise PlotError("%s line 1: the header must be '%s'." % (path, header))
    if lines[-1] != "":
        raise PlotError("%s line %d is truncated: it does not end." % (path, len(lines)))
    columns = lines[0].count(",") + 1
    rows = []
    for number, line in enumerate(lines[1:-1], start=2):
        fields = line.split(",")
        if len(fields) != columns:
            raise PlotError("%s line %d has %d fields instead of %d."
                            % (path, number, len(fields), columns))
        rows.append((number, fields))
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


def read_yaml(path):
    try:
        data = yaml.safe_load(read_text(path))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = " line %d" % (mark.line + 1) if mark else ""
        raise PlotError("%s%s is not valid YAML." % (path, line))
    if not isinstance(data, dict):
        raise PlotError("%s must hold settings as 'key: value' lines." % path)
    return data
