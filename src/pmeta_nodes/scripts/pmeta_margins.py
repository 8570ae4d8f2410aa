"""By how much ours is above every other method, in percent: at equal steps, and at the end."""

import pmeta_methods as pm
import pmeta_statistics as ps
from pmeta_comparisons import with_interval
from pmeta_manifest import data_file

COLUMNS = ("experiment", "ours", "theirs", "seeds", "their_seeds", "when", "steps", "their_steps",
           "return", "their_return", "difference", "difference_low", "difference_high", "percent",
           "percent_low", "percent_high", "paper_percent")
LARGEST = 1000  # percent: beyond, theirs is next to nothing
EQUAL, END = "at equal steps", "at the end"
VERDICTS = ABOVE, BELOW, UNDECIDED, NO_MARK = (
    "above", "below", "not told apart from", "without a common mark with")
LEGEND = [
    "Margin: (ours - theirs) / |theirs| of the mean returns over seeds, on training tasks, with a",
    "95 % interval of a bootstrap over seeds; in returns where theirs is around 0: its seeds differ",
    "in sign, or the margin would be above 1000 %. At equal steps: mean over the last tenth of the",
    "way to the end of the shorter run, in environment steps of all training tasks. At the end: mean",
    "of the last tenth of the evaluations of each. Above, below: the interval of the difference",
    "leaves no doubt."]


def margin_rows(experiment, groups):
    """A dict with COLUMNS for each policy of ours, each other method, and both times."""
    if not pm.are_compared(groups):
        return []
    methods = pm.methods_of(groups)
    count = pm.common_count(methods)
    sides = [(method, pm.policy_name(word, method, "%s of %s"), key)
             for method in methods for word, key in pm.judged_by(method, count)]
    return [row for ours in sides if ours[0].ours for theirs in sides if not theirs[0].ours
            for row in _pair(experiment, ours, theirs)]


def _pair(experiment, ours, theirs):
    groups = [side[0].group for side in (ours, theirs)]
    steps = [group.total_steps[-1] for group in groups]
    for when, at in ((EQUAL, [min(steps)] * 2), (END, steps)):
        values = [group.final(side[2]) if when == END else group.at_steps(side[2], min(steps))
                  for group, side in zip(groups, (ours, theirs))]
        row = dict.fromkeys(COLUMNS)
        row.update(experiment=experiment, ours=ours[1], theirs=theirs[1], when=when,
                   seeds=len(groups[0].runs), their_seeds=len(groups[1].runs),
                   paper_percent=in_paper(experiment, groups, ours[2]))
        row["steps"], row["their_steps"] = map(float, at)
        if all(value is not None for value in values):
            row["return"], row["their_return"] = (float(value.mean()) for value in values)
            for name, found in (("difference", ps.difference(*values)),
                                ("percent", ps.percent_above(*values))):
                if found is not None:
                    row[name], limits = found
                    row[name + "_low"], row[name + "_high"] = limits or (None, None)
        yield row


def in_paper(experiment, groups, key):
    """What the paper says of its personal policy."""
    ours, theirs = (group.algorithm for group in groups)
    margins = data_file("paper.yaml")["margins"]
    known = margins["ours"] == ours and key == "personal"
    return margins["percent"].get(experiment, {}).get(theirs) if known else None


def verdict(row):
    if row["difference"] is None:
        return NO_MARK
    if row["difference_low"] is None or row["difference_low"] <= 0 <= row["difference_high"]:
        return UNDECIDED
    return ABOVE if row["difference_low"] > 0 else BELOW


def who_wins(rows):
    """A sentence for each policy of ours: what it is above and below of, at equal steps."""
    lines = []
    for ours in dict.fromkeys(row["ours"] for row in rows):
        by_verdict = {}
        for row in rows:
            if (row["ours"], row["when"]) == (ours, EQUAL):
                by_verdict.setdefault(verdict(row), []).append(shown_rival(row))
        parts = ["%s %s" % (word, ", ".join(by_verdict[word])) for word in VERDICTS
                 if word in by_verdict]
        lines.append("%s at equal steps: %s." % (ours, "; ".join(parts)))
    return lines


def shown_rival(row):
    return row["theirs"] + " (one seed)" * (min(row["seeds"], row["their_seeds"]) < 2)


def margin_text(row):
    """"+12.59 % [3.10, 20.20]", or the difference where theirs is around 0."""
    known = row["percent"] is not None and abs(row["percent"]) <= LARGEST
    name = "percent" if known else "difference"
    if row[name] is None:
        return "-"
    text = with_interval(row[name], (row[name + "_low"], row[name + "_high"]))
    sign = "+" if row[name] >= 0 else ""
    number, _, limits = text.partition(" ")
    return " ".join(filter(None, [sign + number, "%" if name == "percent" else "return", limits]))


def margin_cells(rows):
    """(heads, lines): a line for each pair."""
    lines, last = [], None
    for equal, end in zip(rows[::2], rows[1::2]):
        paper = equal["paper_percent"]
        label, last = "" if equal["ours"] == last else equal["ours"], equal["ours"]
        lines.append((label, equal["theirs"], "%d, %d" % (equal["seeds"], equal["their_seeds"]),
                      steps_text(equal["steps"]), margin_text(equal),
                      "%s, %s" % (steps_text(end["steps"]), steps_text(end["their_steps"])),
                      margin_text(end), "-" if paper is None else "%+g %%" % paper))
    heads = ("ours", "against", "seeds", "steps", "margin", "steps at the end", "margin at the end",
             "paper")
    return heads, lines


def steps_text(steps):
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if steps >= size:
            return "%.3g%s" % (steps / size, letter)
    return "%.3g" % steps
