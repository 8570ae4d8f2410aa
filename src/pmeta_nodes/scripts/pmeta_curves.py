"""Learning curves in a panel: over rounds or environment steps, before and after adaptation."""

import numpy as np
from matplotlib.ticker import EngFormatter, MaxNLocator

import pmeta_statistics as ps
from pmeta_drawing import BLACK, MP_COLOR, PP_COLOR, SKY

PP = {"color": PP_COLOR, "linestyle": "-", "marker": "o"}
MP = {"color": MP_COLOR, "linestyle": "-", "marker": "s"}
SPLIT_STYLES = {"train": MP, "test": {"color": SKY, "linestyle": "-", "marker": "D"}}
BEFORE_LINE, BETWEEN_LINES = ":", ("--", "-.", (0, (6, 1.5)), (0, (4, 1, 1, 1, 1, 1)))
MANY_ROUNDS = 200  # thick lines would hide each other's ups and downs
RETURN = "return per episode, mean over tasks"
SPREAD = "mean and its 95 % interval"


def seeds_text(groups):
    counts = [len(group.runs) for group in groups]
    if max(counts) == 1:
        return "1 seed"
    fewest = "" if min(counts) == max(counts) else "%d to " % min(counts)
    return "%s%d seeds" % (fewest, max(counts))


def over_seeds(what, groups):
    """"what over 5 seeds", or of one seed the value itself."""
    seeds = seeds_text(groups)
    return seeds if seeds == "1 seed" else "%s over %s" % (what, seeds)


def draw_curve(axis, group, policy, label, band=True, steps=False, x=None, **style):
    """Mean over seeds, with the interval of pmeta_statistics as a band.

    Over `x`, or else over what progress_axis says of `steps`.
    """
    curves = group.curves(policy)
    mean = curves.mean(axis=0)
    if x is None:
        x = group.env_steps if steps else group.rounds
    style.setdefault("markevery", max(1, len(mean) // 15))
    if len(mean) > MANY_ROUNDS:
        style.setdefault("linewidth", 1)
    axis.plot(x, mean, label=label, **style)
    limits = ps.curve_interval(curves) if band else None
    if limits is not None:
        axis.fill_between(x, *limits, color=style["color"], alpha=0.16, linewidth=0)


def progress_axis(axis, groups, steps=False):
    """Rounds; or the environment steps of each task, where rounds are of different lengths."""
    if steps:
        axis.set_xlabel("environment steps a task")
        axis.set_xlim(0, 1.02 * max(group.env_steps[-1] for group in groups))
        axis.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axis.xaxis.set_major_formatter(EngFormatter(sep=""))
        return
    rounds = max((group.rounds for group in groups), key=len)
    axis.set_xlabel("round")
    axis.set_xlim(rounds[0] - 0.3, rounds[-1] + 0.3)
    if len(rounds) <= 10:
        axis.set_xticks(rounds)
    else:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def draw_optimum(axis, groups):
    values = [group.optimal() for group in groups]
    if None not in values and np.allclose(values, values[0], rtol=1e-9, atol=0):
        axis.axhline(values[0], color=BLACK, linestyle=(0, (4, 3)), linewidth=1,
                     label="optimum")


def meta_label(split, count, counts):
    """"MP, test tasks, after 2 episodes"; `counts` are all that there are."""
    words = ["MP"] + ["test tasks"] * (split == "test")
    if counts[-1] > 0:
        words.append("after %d episode%s" % (count, "" if count == 1 else "s"))
    return ", ".join(words)


def meta_style(split, count, counts):
    """A colour for each split, a line for each count, and hollow marks before the last."""
    style = dict(SPLIT_STYLES[split])
    if count != counts[-1]:
        between = BETWEEN_LINES[(counts.index(count) - 1) % len(BETWEEN_LINES)]
        style.update(linestyle=BEFORE_LINE if count == 0 else between, markerfacecolor="white")
    return style


def adaptation_curves(group):
    """[((split, count), label, style)]: what PP and MP do not show of the meta-policy."""
    found = []
    counts = group.adaptations("train")
    if counts and counts[0] == 0 < counts[-1]:
        found.append((("train", 0), "MP before adaptation", meta_style("train", 0, counts)))
    counts = group.adaptations("test")
    return found + [(("test", n), meta_label("test", n, counts), meta_style("test", n, counts))
                    for n in counts]
