"""The runs and sweeps below a folder, as a list: how each stands, its size, when it last changed."""

import contextlib
import os
import shutil
import time

import pmeta_lock
from pmeta_files import PlotError, read_json, read_text, shown, warn
from pmeta_runs import CONVERGENCE_MARKS, find_folders

FINISHED, RUNNING, INTERRUPTED = "finished", "running", "interrupted"


class Run:
    """A run folder, of whatever status."""

    def __init__(self, folder):
        self.folder = os.path.realpath(folder)
        self.runs = [self]
        self.size, self.changed = _measure(folder)
        self.holder = pmeta_lock.holder_of(folder)
        manifest = {}
        if os.path.isfile(os.path.join(folder, "manifest.json")):
            manifest = _read_or_warn(read_json, folder, "manifest.json", {})
        self.status = _word(manifest, "status") or INTERRUPTED
        if self.holder:
            self.status = RUNNING
        elif self.status == RUNNING:
            self.status = INTERRUPTED  # its process died without a word
        self.reason = _word(manifest, "reason")
        self.seed = manifest.get("seed")
        self.rounds_done = self.rounds = self.personal = self.meta = None
        if not any(os.path.isfile(os.path.join(folder, name)) for name in CONVERGENCE_MARKS):
            text = _read_or_warn(read_text, folder, "rounds.csv", "")
            last, self.personal, self.meta = last_returns(text)
            # a run that goes on writes its manifest now and then alone
            self.rounds_done = max(last, _count(manifest, "rounds_done"))
            self.rounds = _count(manifest, "rounds")

    @property
    def text(self):
        if self.status == RUNNING:
            return "running, " + self.holder
        return "%s: %s" % (self.status, shown(self.reason, 150)) if self.reason else self.status


class Sweep:
    """The runs of one folder below sweeps/."""

    def __init__(self, folder, runs):
        self.folder = folder
        self.runs = runs
        self.size, self.changed = _measure(folder)
        self.personal = self.meta = None  # settings differ
        self.rounds_done = sum(run.rounds_done or 0 for run in runs)
        self.rounds = sum(run.rounds or 0 for run in runs)

    @property
    def counts(self):
        """{status: number of runs}"""
        statuses = [run.status for run in self.runs]
        return {status: statuses.count(status) for status in sorted(set(statuses))}

    @property
    def text(self):
        seeds = len(set(str(run.seed) for run in self.runs))
        return "sweep of %s, %s: %s" % (
            counted(len(self.runs), "run"), counted(seeds, "seed"),
            ", ".join("%d %s" % (number, shown(status)) for status, number in self.counts.items()))


def counted(number, what):
    return "%d %s%s" % (number, what, "" if number == 1 else "s")


def find(top):
    """Runs and sweeps in and below `top`, the one that last changed at the end; of a folder in or
    below a sweep, its runs."""
    entries, sweeps = [], {}
    top = os.path.realpath(top)
    for folder in sum(find_folders([top]), []):
        run = Run(folder)
        sweep = _sweep_of(top, run.folder)
        if sweep:
            sweeps.setdefault(sweep, []).append(run)
        else:
            entries.append(run)
    entries += [Sweep(folder, runs) for folder, runs in sweeps.items()]
    return sorted(entries, key=lambda entry: (entry.changed, entry.folder))


def _sweep_of(top, folder):
    """The folder of the sweep that the run belongs to, if that is below `top`; else None."""
    below = os.path.relpath(folder, top).split(os.sep)
    if os.path.basename(top) == "sweeps":
        return os.path.join(top, below[0])
    if "sweeps" in below[:-2]:
        return os.path.join(top, *below[:below.index("sweeps") + 2])
    return None


def last_returns(text):
    """(round, PP, MP) of the last round in the text of a rounds.csv, as means over the training
    tasks, MP after the most episodes of exploration; 0 or None for what is not there."""
    lines = text.split("\n")[:-1]  # what is behind the last line's end is being written
    columns = lines[0].split(",") if lines else []
    last, returns = None, {}
    for line in reversed(lines[1:]):
        row = dict(zip(columns, line.split(",")))
        if last is None:
            last = row.get("round")
        if row.get("round") != last:
            break
        try:
            if row["split"] == "train":
                key = row["policy"], int(row.get("context_episodes", 0))
                returns.setdefault(key, []).append(float(row["return_mean"]))
        except (KeyError, ValueError):
            return 0, None, None

    def mean(policy):
        key = max((key for key in returns if key[0] == policy), default=None)
        return sum(returns[key]) / len(returns[key]) if key else None

    return int(last) if last and last.isdigit() else 0, mean("personal"), mean("meta")


def remove(entry, top):
    """Removes a run, or a sweep with all that is in it, and the folder above where that is empty
    then; throws PlotError, before anything is gone, if somebody writes it."""
    with contextlib.ExitStack() as stack:
        for run in entry.runs:
            # nobody may begin there in the meantime
            stack.enter_context(pmeta_lock.held(run.folder))
        shutil.rmtree(entry.folder)
    above = os.path.dirname(entry.folder)
    while above.startswith(os.path.join(os.path.realpath(top), "")) and not os.listdir(above):
        os.rmdir(above)
        above = os.path.dirname(above)


def _measure(folder):
    """(bytes of all files below, when the last of them changed)"""
    size, changed = 0, os.lstat(folder).st_mtime
    for where, _, names in os.walk(folder):
        for name in names:
            try:
                found = os.lstat(os.path.join(where, name))
            except FileNotFoundError:
                continue  # a run that goes on renames its files
            size += found.st_size
            changed = max(changed, found.st_mtime)
    return size, changed


def _read_or_warn(read, folder, name, otherwise):
    """One file that cannot be read hides none of the other runs."""
    try:
        return read(os.path.join(folder, name))
    except PlotError as error:
        warn(str(error))
        return otherwise


def _word(manifest, key):
    value = manifest.get(key)
    return value if isinstance(value, str) else ""


def _count(manifest, key):
    value = manifest.get(key)
    return value if isinstance(value, int) and not isinstance(value, bool) else 0


def age(seconds):
    """"now", "5 min", "3 h", "12 d" """
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return "%d %s" % (seconds // length, unit)
    return "now"


def size_text(size):
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return "%.3g %s" % (size, unit)
        size /= 1000
    return "%.3g GB" % size


def days_since(entry):
    return (time.time() - entry.changed) / 86400
