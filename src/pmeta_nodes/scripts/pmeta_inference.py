"""How well a meta-policy finds out its task: seed by seed, after each number of exploration episodes."""

import numpy as np

from pmeta_returns import adaptations

LAST = 5           # evaluations
REACHED = 1        # a return: of sparse rewards, where every return is 0 or more


def inference_cells(groups):
    """(heads, lines): PP, MP and MP on test tasks, last and as mean of the last five evaluations; what
    MP is of PP; the lowest of the last quarter, of its mean. A line for each seed, then the mean."""
    group = groups[0]
    keys = columns_of(group.runs[0])
    heads = (("seed",) + tuple(keys) + ("MP of PP", "lowest of the last quarter, PP", "MP"))
    rows = [numbers_of(run, keys.values()) for run in group.runs]
    lines = [(str(run.seed),) + cells_of(row) for run, row in zip(group.runs, rows)]
    mean = [tuple(np.mean(column, axis=0)) for column in zip(*rows)]
    return heads, lines + [("mean of the seeds",) + cells_of(mean)]


def columns_of(run):
    """{head: key of its returns}"""
    after = adaptations(run.returns, "train")
    columns = {"PP": "personal"}
    columns.update({"MP after %d" % n: ("train", n) for n in after})
    word = "unseen" if run.unseen else "test tasks, trained on"
    columns.update({"MP after %d, %s" % (n, word): ("test", n)
                    for n in adaptations(run.returns, "test") if n > 0})
    return columns


def numbers_of(run, keys):
    """[(last, mean of the last), ..., (share, share of the means), (lowest share,) twice]"""
    curves = [run.curves[key] for key in keys]
    rows = [(curve[-1], np.mean(curve[-LAST:])) for curve in curves]
    meta = run.curves["meta"]
    rows.append(tuple(100 * m / p for m, p in zip((meta[-1], np.mean(meta[-LAST:])), rows[0])))
    for curve in (curves[0], meta):
        quarter = curve[-max(1, len(curve) // 4):]
        rows.append((100 * np.min(quarter) / np.mean(quarter),))
    return rows


def cells_of(row):
    returns = ["%.1f (%.1f)" % pair for pair in row[:-3]]
    return tuple(returns + ["%.1f (%.1f) %%" % row[-3]] + ["%.0f %%" % one for one in row[-2:]])


def reached_cells(groups):
    """(heads, lines): of sparse rewards, how many tasks got one in the last evaluation; none else."""
    group = groups[0]
    keys = columns_of(group.runs[0])
    if min(run.curves[key].min() for run in group.runs for key in keys.values()) < 0:
        return (), []
    return ("seed",) + tuple(keys), [
        (str(run.seed),) + tuple(reached_text(run.by_task(key, "last")) for key in keys.values())
        for run in group.runs]


def reached_text(returns):
    return "%d of %d" % (np.sum(returns >= REACHED), len(returns))
