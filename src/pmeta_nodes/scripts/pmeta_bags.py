"""Learning curves from a rosbag of /pmeta: from the topic `returns` alone, without our messages.

The bag holds the definitions of its messages, so it reads anywhere that python3-rosbag is.
"""

import os

import numpy as np

from pmeta_files import PlotError, warn
from pmeta_returns import adaptations, key_of, with_stand_ins, words_of

TOPIC = "/returns"
TYPE = "pmeta_msgs/TaskReturn"


class BagRun:
    """The returns of one run, with what a Group asks of a run's curves."""

    seed = None  # the messages do not say it

    def __init__(self, path, run_id, returns):
        self.path = path
        self.run_id = run_id
        self.returns = returns
        curves = {}
        self.rounds = np.array(sorted(set.intersection(*map(set, returns.values()))), dtype=int)
        if not len(self.rounds):
            raise PlotError("%s has no round with returns of every policy." % path)
        lacking = sorted(set(range(1, self.rounds[-1] + 1)) - set(self.rounds))
        if lacking:
            warn("%s lacks %d of the first %d rounds (first: round %d): they were not recorded, or not evaluated."
                 % (path, len(lacking), self.rounds[-1], lacking[0]))
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
    runs = {}
    for _, message, _ in bag.read_messages(topics=chosen):
        # bags of older runs lack these fields
        if not getattr(message, "scheduled", True):
            continue
        key = key_of(message.policy_name, message.split_name,
                     getattr(message, "context_episodes", 0))
        by_task = runs.setdefault(message.run_id, {}).setdefault(key, {}).setdefault(
            message.round, {})
        # an agent that was started again may say it twice: the first counts, as in rounds.csv
        by_task.setdefault(message.task, message.return_mean)
    runs = {run_id: returns for run_id, returns in runs.items()
            if "personal" in returns or adaptations(returns, "train")}
    if not runs:
        raise PlotError("%s holds no returns of training tasks." % path)
    return [BagRun(path, run_id, runs[run_id]) for run_id in sorted(runs)]


def name_of(run):
    """Of its figures: the bag's name and, if that says something else, the run's."""
    stem = os.path.splitext(os.path.basename(run.path))[0]
    return stem if run.run_id == stem else stem + "_" + run.run_id
