"""The pages of docs/results: tables made from the packed sweeps, between markers in the prose.

A block begins with <!-- generated: KIND NAME ... --> and ends with <!-- end -->. What lies between
is written anew; all else is prose. Verdicts are computed from the numbers, never typed.
"""

import glob
import os
import re

import pmeta_archives as pa
import pmeta_comparisons as pc
import pmeta_groups as pg
import pmeta_inference as pi
import pmeta_margins as pm
import pmeta_runs as pr
import pmeta_statistics as ps
import pmeta_tables as pt
from pmeta_files import PlotError, shown
from pmeta_plan import command_of, command_text, runs_of, seeds_of
from pmeta_sections import number_ranges

BLOCK = re.compile(r"(<!-- generated: ([^\n]*?) -->\n)(.*?)(<!-- end -->)", re.S)
NOT_RUN = "not run"


class Data:
    """The packed sweeps of a plan, each read once."""

    def __init__(self, folder, plan):
        self.folder = folder
        self.plan = plan
        self._runs = {}
        self._words = {}

    def has(self, name):
        return os.path.isfile(pa.archive_of(self.folder, self.plan.sweep(name)["name"]))

    def words(self, name):
        """The command that gave the data."""
        if name not in self._words:
            self._words[name] = pa.packed_command(pa.archive_of(self.folder, name))
        return self._words[name]

    def runs(self, name):
        if name not in self._runs:
            with pa.unpacked([pa.archive_of(self.folder, name)]) as top:
                self._runs[name] = pr.load_runs(pr.find_folders([top])[0])
        return self._runs[name]

    def can_draw(self, entry):
        """Figures need the first of their sweeps; the others are added once they are there."""
        return self.has(entry["sweeps"][0])

    def experiments(self, names):
        """Groups of all runs of the sweeps that there are, in one."""
        return pg.group_runs([run for name in names if self.has(name) for run in self.runs(name)])

    def group(self, side):
        """The one group of an aim or of a side of a claim; None if it has not been run."""
        names, settings = runs_of(side)
        if not all(self.has(name) for name in names):
            return None
        found = [group for groups in self.experiments(names).values() for group in groups
                 if all(_has_setting(group, k, v) for k, v in settings.items())]
        if len(found) != 1:
            raise PlotError("%s: %s are the settings of %d groups of runs, not of one."
                            % (self.plan.path, side["runs"], len(found)))
        return found[0]


def _has_setting(group, name, value):
    if name == "algorithm":
        return group.algorithm == value
    return any(setting == value for key, setting in group.settings.items()
               if name in (key, pg.short_name(key)))


def pages_of(folder):
    return sorted(glob.glob(os.path.join(glob.escape(folder), "*.md")))


def renewed(path, data):
    """The page's text with its blocks made anew."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if text.count("<!-- generated: ") != len(BLOCK.findall(text)):
        raise PlotError("%s has a block without <!-- end -->." % path)

    def renew(match):
        words = match.group(2).split()
        if not words or words[0] not in KINDS:
            raise PlotError("%s: '%s' is none of the blocks: %s."
                            % (path, shown(match.group(2)), ", ".join(KINDS)))
        return match.group(1) + KINDS[words[0]](data, *words[1:]) + "\n" + match.group(4)

    return BLOCK.sub(renew, text)


def markdown(heads, lines, words=1):
    """A table; cells of numbers get a true minus, and nothing where there is nothing."""
    def row(cells):
        return "| " + " | ".join(cells) + " |"

    def cell(i, text):
        if i < words:
            return text.replace("|", "\\|")
        return "" if text == "-" else re.sub(r"(?<![\w.])-(?=\d)", "−", text)

    return "\n".join([row(heads), "|" + "|".join("---" if i < words else "---:" for i in range(
        len(heads))) + "|"] + [row([cell(i, c) for i, c in enumerate(line)]) for line in lines])


def not_run(data, names):
    missing = [name for name in names if not data.has(name)]
    return ["Not run yet: %s (`./pmeta results --run`)." % ", ".join(missing)] * bool(missing)


def of_sweeps(make):
    """A kind of block that is made from the groups of all its sweeps."""
    def block(data, *names):
        experiments = data.experiments(names)
        parts = []
        for experiment, groups in experiments.items():
            rows = pt.summary_rows({experiment: groups})
            made = make(rows, groups)
            parts += [made] if made else []
        return "\n\n".join(parts + not_run(data, names))

    return block


def comparisons_of(rows, groups):
    heads, lines = pc.comparison_cells(groups)
    return markdown(heads, lines, 3) if lines else ""


def inference_of(_, groups):
    reached = pi.reached_cells(groups)
    parts = [markdown(*pi.inference_cells(groups))]
    if reached[1]:
        parts += ["Tasks whose last return is at least %d:" % pi.REACHED, markdown(*reached)]
    return "\n\n".join(parts)


def wins_block(data, *names):
    """Who wins where, in sentences."""
    found = margins_of(data, names)
    lines = ["* **%s**: %s" % (experiment, " ".join(pm.who_wins(rows)))
             for experiment, rows in found.items()]
    return "\n".join(lines or ["None of these runs can be compared yet."])


def margins_block(data, *names):
    """By how much, in a table for each experiment."""
    parts = ["%s:\n\n%s" % (experiment, markdown(*pm.margin_cells(rows), words=2))
             for experiment, rows in margins_of(data, names).items()]
    return "\n\n".join(parts + not_run(data, names))


def margins_of(data, names):
    found = {experiment: pm.margin_rows(experiment, groups)
             for experiment, groups in data.experiments(names).items()}
    return {experiment: rows for experiment, rows in found.items() if rows}


def commands_block(data, *names):
    """The commands, and what they were run with."""
    commands, lines = [], []
    for name in names:
        known = data.has(name)
        commands.append(command_text(data.words(name) if known else command_of(
            data.plan.sweep(name))))
        lines.append(provenance(data, name))
    return "\n".join(["```"] + commands + ["```", "", markdown(PROVENANCE, lines, 6)])


PROVENANCE = ("sweep", "seeds", "for", "runs", "commit", "date")


def provenance(data, name):
    use = data.plan.sweep(name)["use"]
    if not data.has(name):
        seeds = seeds_of(data.plan.sweep(name)).replace("-", "–")
        return name, seeds, use, NOT_RUN, "", ""
    runs = data.runs(name)
    return (name, number_ranges(run.seed for run in runs), use, str(len(runs)),
            ", ".join(sorted(set(run.commit for run in runs))),
            ", ".join(sorted(set(run.started[:10] for run in runs))))


def plan_block(data):
    lines = []
    for sweep in data.plan.in_order():
        name, seeds, use, runs, commit, date = provenance(data, sweep["name"])
        lines.append(("[%s](%s)" % (name, sweep["page"]), seeds, use,
                      "%g" % sweep["core_hours"], runs, commit, date))
    return markdown(("sweep", "seeds", "for", "core hours, about", "runs", "commit", "date"),
                    lines, 7)


def verdict(mean, limits, number):
    """"worse" only where the interval leaves no doubt."""
    if mean >= number:
        return "reached"
    return "worse" if limits is not None and limits[1] < number else "not reached"


def summary_block(data):
    """Every aim with the number aimed at, ours, and what follows."""
    lines = []
    for aim in data.plan.aims:
        names, _ = runs_of(aim)
        sweeps = ", ".join("[%s](%s)" % (n, data.plan.sweep(n)["page"]) for n in names)
        number = "%.2f" % aim["number"]
        group = data.group(aim)
        if group is None:
            lines.append((aim["aim"], aim["source"], sweeps, "", number, "", "", "", NOT_RUN))
            continue
        scores = group.scores(pc.POLICIES[aim["policy"]], aim["measure"])
        if scores is None:
            raise PlotError("%s: the runs of '%s' have no %s returns of %s." % (
                data.plan.path, aim["aim"], aim["measure"], aim["policy"]))
        means = scores.mean(axis=1)
        limits = ps.interval(scores, ps.overall_mean)
        std = float(means.std(ddof=1)) if len(means) > 1 else None
        lines.append((aim["aim"], aim["source"], sweeps,
                      ", ".join(sorted(set(run.commit for run in group.runs))), number,
                      pt.plus_minus(float(means.mean()), std),
                      pc.with_interval(float(ps.interquartile_mean(scores)), ps.interval(scores)),
                      str(len(means)), verdict(float(means.mean()), limits, aim["number"])))
    return markdown(("aim", "number from", "sweep", "commit", "number", "ours", "ours, IQM",
                     "seeds", "verdict"), lines, 4)


def claims_block(data):
    """What is said of one algorithm against another, by the probability of improvement."""
    lines = []
    for claim in data.plan.claims:
        ours, theirs = data.group(claim["ours"]), data.group(claim["theirs"])
        if ours is None or theirs is None:
            lines.append((claim["claim"], pc.MEASURES[claim["measure"]], "", "", NOT_RUN))
            continue
        found = pc.compare(ours, theirs, claim["ours"]["policy"], claim["theirs"]["policy"],
                           (claim["measure"],))
        if found is None:
            raise PlotError("%s: '%s' cannot be judged by %s: a side has no such returns."
                            % (data.plan.path, claim["claim"], claim["measure"]))
        _, value, limits = found
        lines.append((claim["claim"], pc.MEASURES[claim["measure"]],
                      "%d, %d" % (len(ours.runs), len(theirs.runs)),
                      pc.with_interval(value, limits), holds(limits)))
    return markdown(("claim", "returns", "seeds", "P(improvement)", "verdict"), lines, 2)


def holds(limits):
    if limits is None or limits[0] <= 0.5 <= limits[1]:
        return "not established"
    return "holds" if limits[0] > 0.5 else "the other way round"


def figure_block(data, folder, *names):
    """Links to figures, once there are data to draw."""
    entry = data.plan.figures.get(folder)
    if entry is None or not set(names) <= set(entry["keep"]):
        raise PlotError("%s: there are no figures %s in '%s'."
                        % (data.plan.path, ", ".join(names), folder))
    if not data.can_draw(entry):
        return "\n".join(not_run(data, entry["sweeps"][:1]))
    return "\n".join("![%s](figures/%s/%s.png)" % (
        (folder + ", " + name).replace("_", " "), folder, name) for name in names)


KINDS = {
    "summary": summary_block, "claims": claims_block, "plan": plan_block,
    "commands": commands_block, "figure": figure_block,
    "learning": of_sweeps(lambda rows, groups: markdown(*pt.learning_cells(rows))),
    "returns": of_sweeps(lambda rows, groups: markdown(*pt.best_cells(rows), words=2)),
    "iqm": of_sweeps(lambda rows, groups: markdown(*pc.iqm_cells(rows), words=2)),
    "inference": of_sweeps(inference_of), "comparisons": of_sweeps(comparisons_of), "wins": wins_block,
    "margins": margins_block,
}
