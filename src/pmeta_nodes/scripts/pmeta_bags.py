"""Learning curves from a rosbag of /pmeta: from the topic `returns` alone, without our messages.

The bag holds the definitions of its messages, so it reads anywhere that python3-rosbag is.
"""

import math
import os
import re
from types import SimpleNamespace

import numpy as np

from pmeta_files import PlotError, shown, warn
from pmeta_returns import adaptations, key_of, with_stand_ins, words_of

TOPIC = "/returns"
TYPE = "pmeta_msgs/TaskReturn"
KNOWN = (("personal", "train"), ("meta", "train"), ("meta", "test"))


class BagRun:
    """The returns of one run, with what a Group asks of a run's curves."""

    # the messages do not say these
    seed = None
    figures = SimpleNamespace(label="")

    def __init__(self, path, run_id, returns):
        self.path = path
        self.run_id = shown(run_id)
        self.returns = returns
        curves = {}
        self.rounds = np.array(sorted(set.intersection(*map(set, returns.values()))), dtype=int)
        if not len(self.rounds):
            raise PlotError("%s has no round with returns of every policy." % path)
        last = int(self.rounds[-1])
        if len(self.rounds) < last:
            # a message may say any round: only those that are there are gone through
            first = next((i for i, r in enumerate(self.rounds, start=1) if r != i), None)
            warn("%s lacks %d of the first %d rounds (first: round %d): they were not recorded, "
                 "or not evaluated." % (path, last - len(self.rounds), last, first))
        for key, by_round in returns.items():
            tasks = max(len(by_task) for by_task in by_round.values())
            short = [r for r in self.rounds if len(by_round[r]) < tasks]
            if short:
                warn("%s: %s returns of some tasks are missing in %d rounds (first: round %d); "
                     "their means are over the tasks that were recorded."
                     % (path, words_of(key), len(short), min(short)))
            # summed in the order of the tasks, as in rounds.csv: the same bits
            curves[key] = np.array([
                np.mean([by_round[r][task] for task in sorted(by_round[r])]) for r in self.rounds])
        self.curves = with_stand_ins(curves)


def read_bag(path):
    """A BagRun for each run in the bag, in the order of their names; throws PlotError."""
    try:
        import rosbag
    except ImportError:
        raise PlotError("reading %s needs rosbag for Python: ./pmeta setup installs it." % path)
    try:
        with rosbag.Bag(path) as bag:
            return _runs_of(path, bag)
    except rosbag.ROSBagUnindexedException:
        raise PlotError("%s is cut off, or its recording was: mend it with rosbag reindex." % path)
    except (PlotError, OSError):
        raise
    except Exception as error:  # rosbag and genpy let through whatever damaged bytes cause
        raise PlotError("%s is not a readable bag (%s)." % (path, str(error).rstrip(".")))


def _runs_of(path, bag):
    topics = bag.get_type_and_topic_info().topics
    chosen = [name for name, info in topics.items() if name.endswith(TOPIC)
              and info.msg_type == TYPE]
    if not chosen:
        raise PlotError("%s has no topic returns of type %s; its topics are: %s."
                        % (path, TYPE, ", ".join(sorted(topics)) or "none"))
    runs, strange = {}, 0
    for _, message, _ in bag.read_messages(topics=chosen):
        # bags of older runs lack these fields
        if not getattr(message, "scheduled", True):
            continue
        if ((message.policy_name, message.split_name) not in KNOWN or message.round < 1
                or not math.isfinite(message.return_mean)):
            strange += 1
            continue
        key = key_of(message.policy_name, message.split_name,
                     getattr(message, "context_episodes", 0))
        by_task = runs.setdefault(message.run_id, {}).setdefault(key, {}).setdefault(
            message.round, {})
        # an agent that was started again may say it twice: the first counts, as in rounds.csv
        by_task.setdefault(message.task, message.return_mean)
    if strange:
        warn("%s holds %d returns that are none of a run's (no such policy, round 0, or no finite "
             "number): they are left out." % (path, strange))
    runs = {run_id: returns for run_id, returns in runs.items()
            if "personal" in returns or adaptations(returns, "train")}
    if not runs:
        raise PlotError("%s holds no returns of training tasks." % path)
    return [BagRun(path, run_id, runs[run_id]) for run_id in sorted(runs)]


def names_of(runs):
    """Of their figures: the bag's name and, if that says something else, the run's, made plain.

    What a message says is never a path, and no two runs share a name.
    """
    names = []
    for run in runs:
        stem = os.path.splitext(os.path.basename(run.path))[0]
        name = stem if run.run_id == stem else stem + "_" + re.sub(r"[^\w.+-]", "_", run.run_id)
        number = 1 + sum(other == name or other.startswith(name + "~") for other in names)
        names.append(name if number == 1 else "%s~%d" % (name, number))
    return names
