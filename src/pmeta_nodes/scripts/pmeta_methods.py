"""The methods of an experiment beside each other: which runs stand for each, judged by what.

Algorithms that learn all tasks at once have no personal policies, go on for other numbers of rounds
and adapt from other numbers of episodes: they are compared over the environment steps of all
training tasks, after the same number of episodes.
"""

import pmeta_groups as pg
from pmeta_files import warn

LIKE_FOR_LIKE = 2  # exploration episodes, where all that explore were tried after so many


class Method:
    """One algorithm, and one way to know the task: it is told, or explores."""

    def __init__(self, group, both_ways):
        self.group = group
        self.explores = explores(group)
        way = ", explores" if self.explores else ", told its task"
        self.name = group.name + way * both_ways

    @property
    def ours(self):
        return not self.group.figures.baseline


def explores(group):
    return any(count > 0 for count in group.adaptations("train"))


def learns_at_once(group):
    """All tasks in one process: none has a policy of its own."""
    return "personal" not in group.policies


def methods_of(groups):
    """Methods with the same training tasks, in the order of their algorithms, ours first."""
    anchor = pg.reference(pg.without_baselines(groups) or groups)
    found = {}
    for group in groups:
        if tasks_of(group) == tasks_of(anchor):
            found.setdefault((group.algorithm, explores(group)), []).append(group)
    return [Method(pg.baseline_of(pg.reference(members), members, algorithm, pg.LOOKS),
                   (algorithm, not explored) in found)
            for (algorithm, explored), members in found.items()]


def tell_left_out(experiment, groups, methods):
    if len(methods) < len(groups):
        warn("the comparison of %s shows %d of its %d groups: %s."
             % (experiment, len(methods), len(groups), "; ".join(m.group.label for m in methods)))


def policy_name(word, method, text="%s, %s"):
    """"PP, pMeta-RL"; of those that have no personal policies, the name alone."""
    return method.name if learns_at_once(method.group) else text % (word, method.name)


def tasks_of(group):
    """The settings of the environment, but for those of test tasks."""
    return {k: v for k, v in group.settings.items()
            if k.startswith("environment.") and not k.startswith("environment.test_")}


def are_compared(groups):
    """Is one that learns all tasks at once there, and another?"""
    return (any(learns_at_once(group) for group in groups)
            and len(set(group.algorithm for group in groups)) > 1)


def common_count(methods, split="train"):
    """The number of episodes after which all that explore are judged; None if they share none."""
    counts = [set(m.group.adaptations(split)) - {0} for m in methods if m.explores]
    shared = set.intersection(*counts) if counts else set()
    return LIKE_FOR_LIKE if LIKE_FOR_LIKE in shared else max(shared, default=None)


def after(group, split, count):
    """The key of the meta-policy's returns after so many episodes, or the most that it has."""
    known = group.adaptations(split)
    return (split, count if count in known else known[-1]) if known else None


def judged_by(method, count):
    """[("PP" or "MP", key of its returns)]: of ours both, of others what they are compared by."""
    known = {"PP": "personal" if "personal" in method.group.policies else None,
             "MP": after(method.group, "train", count)}
    asked = ("PP", "MP") if method.ours else (
        {"personal": "PP", "meta": "MP"}[method.group.figures.compared_by],)
    return [(word, known[word]) for word in asked if known[word] is not None]
