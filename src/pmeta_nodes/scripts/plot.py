#!/usr/bin/python3
"""Figures and tables from pMeta's run folders; `plot.py --help` says how."""

import argparse
import csv
import io
import os
import sys
import textwrap

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_runs as pr
from pmeta_runs import PlotError

KINDS = ("curves", "sweep", "convergence")
FORMATS = ("png", "pdf")

# Okabe and Ito's colours, told apart by colour-blind readers as well
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#000000", "#666666"
PALETTE = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)
PP = {"color": RED, "linestyle": "-", "marker": "o"}
MP = {"color": BLUE, "linestyle": "-", "marker": "s"}
BASELINES = {  # algorithm: (the policy it is judged by, label, style)
    "model_averaging": ("meta", "MP, model averaging",
                        {"color": GREEN, "linestyle": "--", "marker": "^"}),
    "independent": ("personal", "PP, independent",
                    {"color": PURPLE, "linestyle": "-.", "marker": "D"}),
}
STYLE = {
    "font.size": 10, "axes.titlesize": 10.5, "axes.labelsize": 10, "legend.fontsize": 9.5,
    "xtick.labelsize": 9.5, "ytick.labelsize": 9.5, "axes.grid": True, "grid.linewidth": 0.4,
    "grid.color": "#cccccc", "axes.axisbelow": True, "axes.spines.top": False,
    "axes.spines.right": False, "axes.linewidth": 0.8, "lines.linewidth": 1.7,
    "lines.markersize": 4.5, "legend.frameon": False, "savefig.dpi": 150, "pdf.fonttype": 42,
}
RETURN = "return (mean over tasks)"
MAX_PANELS = 3
MAX_SLICES = 4


class Figures:
    """Writes figures into one folder and remembers what it wrote."""

    def __init__(self, out, formats):
        self.out = out
        self.formats = formats
        self.written = []

    def save(self, figure, name):
        os.makedirs(os.path.dirname(os.path.join(self.out, name)), exist_ok=True)
        for extension in self.formats:
            path = os.path.join(self.out, name + "." + extension)
            # no date in the file: the same runs give the same bytes
            figure.savefig(path, metadata={"CreationDate": None} if extension == "pdf" else None)
            self.written.append(path)
        plt.close(figure)


def panels(rows, columns, sharey=True):
    """Axes rows x columns with room for a legend on the right."""
    width = 3.3 * columns + 2.6 if columns > 1 else 7.2
    figure, axes = plt.subplots(rows, columns, squeeze=False, sharey=sharey,
                                figsize=(width, 3.4 * rows + 0.3), constrained_layout=True)
    return figure, axes


def legend_right(axes):
    """One legend for all panels of a row, beside the last."""
    entries = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    axes[-1].legend(entries.values(), entries.keys(), loc="center left", bbox_to_anchor=(1.02, 0.5),
                    borderaxespad=0, handlelength=2.6)


def headline(figure, text):
    figure.suptitle(text, x=0.01, ha="left", fontsize=11)


def seeds_text(groups):
    counts = [len(group.runs) for group in groups]
    if max(counts) == 1:
        return "1 seed"
    return "%s%d seeds" % ("" if min(counts) == max(counts) else "%d to " % min(counts), max(counts))


def over_seeds(what, groups):
    """"mean ± what over 5 seeds", or of one seed the value itself."""
    seeds = seeds_text(groups)
    return seeds if seeds == "1 seed" else "%s over %s" % (what, seeds)


def round_axis(axis, rounds):
    axis.set_xlabel("round")
    axis.set_xlim(rounds[0] - 0.3, rounds[-1] + 0.3)
    if len(rounds) <= 10:
        axis.set_xticks(rounds)
    else:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def draw_curve(axis, group, policy, label, band=True, **style):
    """Mean over seeds, and the sample standard deviation as a band."""
    curves = group.curves(policy)
    mean = curves.mean(axis=0)
    style.setdefault("markevery", max(1, len(mean) // 15))
    axis.plot(group.rounds, mean, label=label, **style)
    if band and len(curves) > 1:
        std = curves.std(axis=0, ddof=1)
        axis.fill_between(group.rounds, mean - std, mean + std, color=style["color"], alpha=0.16,
                          linewidth=0)


def draw_optimum(axis, groups):
    values = set(group.optimal() for group in groups)
    if len(values) == 1 and None not in values:
        axis.axhline(values.pop(), color=BLACK, linestyle=(0, (4, 3)), linewidth=1,
                     label="optimum")


def learning_curves(experiment, groups, figures, prefix):
    """pMeta-RL against its baselines, a panel for every setting that they share."""
    pmeta = pmeta_only(groups)
    contexts = {}
    for group in pmeta:
        contexts.setdefault(group.context(), []).append(group)
    shown = [pr.reference(members) for members in contexts.values()]
    if len(shown) > MAX_PANELS:
        shown = [pr.reference(pmeta)]
    # tasks that differ between panels have scales of their own
    sharey = not any(key.startswith("environment.") for key in pr.varying(shown))

    figure, axes = panels(1, max(1, len(shown)), sharey)
    drawn = []
    for axis, group in zip(axes[0], shown):
        name = " ".join([pr.ALGORITHMS["pmeta"]] + pr.setting_texts(group, []))
        panel = [group]
        for policy, label, style in (("meta", "MP, ", MP), ("personal", "PP, ", PP)):
            if policy in group.policies:
                draw_curve(axis, group, policy, label + name, zorder=3, **style)
        for algorithm, (policy, label, style) in BASELINES.items():
            baseline = pr.baseline_of(group, groups, algorithm)
            if baseline is not None and policy in baseline.policies:
                draw_curve(axis, baseline, policy, label, **style)
                panel.append(baseline)
        draw_optimum(axis, panel)
        axis.set_title(_wrapped(pr.fixed_texts(group, pmeta, "personal.lambda")), loc="left")
        round_axis(axis, group.rounds)
        drawn += panel
    if not shown:
        for group, color in zip(groups, PALETTE):
            draw_curve(axes[0][0], group, group.policies[-1], group.label, color=color, marker="o")
        drawn = groups[:len(PALETTE)]
        draw_optimum(axes[0][0], drawn)
        round_axis(axes[0][0], max((group.rounds for group in drawn), key=len))
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    headline(figure, "%s: %s" % (experiment, over_seeds("mean ± standard deviation", drawn)))
    figures.save(figure, prefix + "learning_curves")


def setting_curves(experiment, key, members, groups, figures, name):
    """Curves of PP and MP for every value of one setting."""
    figure, axes = panels(1, 2)
    numeric = all(pr.is_number(group.settings.get(key)) for group in members)
    for axis, policy, title in zip(axes[0], ("personal", "meta"),
                                   ("PP, personal policies", "MP, meta-policy")):
        for i, group in enumerate(members):
            if policy not in group.policies:
                continue
            # ordered values get an ordered colour map that keeps its order in grey, too
            color = (plt.get_cmap("viridis")(0.87 * i / (len(members) - 1)) if numeric
                     else PALETTE[i % len(PALETTE)])
            draw_curve(axis, group, policy, pr.setting_text(key, group.settings.get(key)),
                       band=False, color=color, marker="osD^vP*X"[i % 8])
        baseline = pr.baseline_of(members[0], groups)
        if baseline is not None and all(pr.baseline_of(g, groups) is baseline for g in members):
            draw_curve(axis, baseline, "meta", "MP, model averaging", band=False, color=GREY,
                       linestyle="--", linewidth=1.4)
        draw_optimum(axis, members)
        axis.set_title(title, loc="left")
        round_axis(axis, max((group.rounds for group in members), key=len))
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    fixed = pr.fixed_texts(members[0], pmeta_only(groups), key)
    headline(figure, "%s: %s, %s" % (experiment, " ".join(["pMeta-RL"] + fixed),
                                     over_seeds("mean", members)))
    figures.save(figure, name)


def pmeta_only(groups):
    return [group for group in groups if group.algorithm == "pmeta"]


def _wrapped(texts):
    return textwrap.fill(" ".join(texts), 38)


def mean_and_error(values):
    """Mean and standard error over seeds; the error of one seed is 0 wide, not known."""
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0


def sweep_figure(experiment, key, found, groups, figures, name):
    """Return against one numeric setting: at the last round, and as the mean over the rounds."""
    figure, axes = panels(len(found), 2)
    for row, members in zip(axes, found):
        for axis, measure, title in zip(row, ("last", "auc"),
                                        ("at the last round", "mean over all rounds")):
            draw_sweep(axis, key, members, measure, groups)
            fixed = pr.fixed_texts(members[0], pmeta_only(groups), key)
            axis.set_title("\n".join([title] + ([_wrapped(fixed)] if fixed else [])), loc="left")
            axis.set_xlabel("%s (%s)" % (pr.symbol(key), key) if pr.symbol(key) != key else key)
        row[0].set_ylabel(RETURN)
    legend_right(axes[0])
    drawn = [group for members in found for group in members]
    headline(figure, "%s: %s" % (experiment, over_seeds("mean ± standard error", drawn)))
    figures.save(figure, name)


def draw_sweep(axis, key, members, measure, groups):
    values = np.array([group.settings[key] for group in members], dtype=float)
    for policy, label, style in (("meta", "MP", MP), ("personal", "PP", PP)):
        if all(policy in group.policies for group in members):
            draw_points(axis, values, members, measure, policy,
                        label + ", " + pr.ALGORITHMS.get(members[0].algorithm,
                                                         members[0].algorithm), style)
    baselines = [pr.baseline_of(group, groups) for group in members]
    known = [b for b in baselines if b is not None]
    if known and all(b is known[0] for b in baselines):
        mean, error = mean_and_error(getattr(known[0], measure)("meta"))
        axis.axhline(mean, color=GREEN, linestyle="--", linewidth=1.4,
                     label="MP, model averaging")
        axis.axhspan(mean - error, mean + error, color=GREEN, alpha=0.16, linewidth=0)
    elif known:
        draw_points(axis, [v for v, b in zip(values, baselines) if b is not None], known, measure,
                    *BASELINES["model_averaging"])
    if values.min() > 0 and values.max() / values.min() >= 30:
        axis.set_xscale("log")
        axis.minorticks_off()
    axis.set_xticks(_spread_ticks(axis, values))
    axis.set_xticklabels(["%g" % v for v in axis.get_xticks()])


def _spread_ticks(axis, values):
    """The values themselves as ticks, without those that would touch."""
    place = np.log(values) if axis.get_xscale() == "log" else values
    gap = 0.035 * (max(len("%g" % v) for v in values) + 0.7) * (place.max() - place.min())
    ticks, last = [], -np.inf
    for value, x in zip(values, place):
        if x - last >= gap:
            ticks.append(value)
            last = x
    return ticks


def draw_points(axis, values, members, measure, policy, label, style):
    points = [mean_and_error(getattr(group, measure)(policy)) for group in members]
    axis.errorbar(values, [p[0] for p in points], yerr=[p[1] for p in points], label=label,
                  capsize=2.5, elinewidth=1.2, **style)


def draw_runs(experiments, kinds, figures):
    """Curves and sweeps of every experiment; with several, each in a folder of its own."""
    for experiment, groups in experiments.items():
        prefix = experiment + os.sep if len(experiments) > 1 else ""
        if "curves" in kinds:
            learning_curves(experiment, groups, figures, prefix)
        pmeta = pmeta_only(groups)
        keys = pr.varying(pmeta)
        names = [pr.short_name(key) for key in keys]
        for key in keys:
            # two settings may share the last part of their name
            name = pr.short_name(key) if names.count(pr.short_name(key)) == 1 else key
            found = pr.slices(pmeta, key)
            if not found:
                continue
            numeric = [m for m in found if all(pr.is_number(g.settings.get(key)) for g in m)]
            # curves of unlike tasks in one panel would compare nothing
            if "curves" in kinds and (numeric or not key.startswith("environment.")):
                members = max(found, key=lambda m: (len(m), pr.reference(pmeta) in m))
                setting_curves(experiment, key, members, groups, figures, prefix + name + "_curves")
            if "sweep" in kinds and numeric:
                numeric.sort(key=len, reverse=True)
                if len(numeric) > MAX_SLICES:
                    pr.warn("sweep_%s shows %d of the %d combinations of the other settings."
                            % (name, MAX_SLICES, len(numeric)))
                sweep_figure(experiment, key, numeric[:MAX_SLICES], groups, figures,
                             prefix + "sweep_" + name)


COLUMNS = ("experiment", "group", "seeds", "pp_last_mean", "pp_last_std", "mp_last_mean",
           "mp_last_std", "pp_auc_mean", "pp_auc_std", "mp_auc_mean", "mp_auc_std", "pairs",
           "mp_minus_ma_auc", "mp_minus_ma_auc_se", "pp_minus_ma_auc", "pp_minus_ma_auc_se")


def summary_rows(experiments):
    """A dict a group with COLUMNS; what is not known (one seed, no baseline) is None."""
    rows = []
    for experiment, groups in experiments.items():
        for group in groups:
            row = dict.fromkeys(COLUMNS)
            row.update(experiment=experiment, group=group.label, seeds=len(group.runs))
            for policy, name in (("personal", "pp"), ("meta", "mp")):
                if policy in group.policies:
                    for measure in ("last", "auc"):
                        values = getattr(group, measure)(policy)
                        row["%s_%s_mean" % (name, measure)] = float(values.mean())
                        if len(values) > 1:
                            row["%s_%s_std" % (name, measure)] = float(values.std(ddof=1))
            if group.algorithm == "pmeta":
                row.update(paired_differences(group, pr.baseline_of(group, groups)))
            rows.append(row)
    return rows


def paired_differences(group, baseline):
    """AUC of pMeta-RL less that of model averaging's meta-policy, seed by seed."""
    if baseline is None or "meta" not in baseline.policies:
        return {}
    seeds = [seed for seed in group.seeds if seed in baseline.seeds]
    found = {"pairs": len(seeds)}
    for policy, name in (("meta", "mp"), ("personal", "pp")):
        if not seeds or policy not in group.policies:
            continue
        ours = dict(zip(group.seeds, group.auc(policy)))
        theirs = dict(zip(baseline.seeds, baseline.auc("meta")))
        differences = np.array([ours[seed] - theirs[seed] for seed in seeds])
        found["%s_minus_ma_auc" % name] = float(differences.mean())
        if len(seeds) > 1:
            found["%s_minus_ma_auc_se" % name] = float(
                differences.std(ddof=1) / np.sqrt(len(seeds)))
    return found


def summary_csv(rows):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        writer.writerow("" if row[c] is None else row[c] for c in COLUMNS)
    return text.getvalue()


def summary_text(rows):
    """The rows as an aligned table for each experiment."""
    heads = ("group", "seeds", "PP last", "MP last", "PP AUC", "MP AUC", "MP - MA", "PP - MA")
    lines = []
    for experiment in dict.fromkeys(row["experiment"] for row in rows):
        members = [row for row in rows if row["experiment"] == experiment]
        table = [heads] + [(row["group"], str(row["seeds"])) + tuple(
            _plus_minus(row, *pair) for pair in (
                ("pp_last_mean", "pp_last_std"), ("mp_last_mean", "mp_last_std"),
                ("pp_auc_mean", "pp_auc_std"), ("mp_auc_mean", "mp_auc_std"),
                ("mp_minus_ma_auc", "mp_minus_ma_auc_se"),
                ("pp_minus_ma_auc", "pp_minus_ma_auc_se"))) for row in members]
        widths = [max(len(line[i]) for line in table) for i in range(len(heads))]
        lines.append("experiment " + experiment)
        for line in table:
            cells = [line[0].ljust(widths[0])] + [c.rjust(w) for c, w in zip(line[1:], widths[1:])]
            lines.append("  " + "  ".join(cells).rstrip())
        lines.append("")
    lines += ["Returns are means over the training tasks, as mean ± standard deviation over seeds.",
              "PP: personal policies. MP: meta-policy. last: at the last round. AUC: mean over the",
              "rounds. MP - MA, PP - MA: AUC less that of model averaging's meta-policy, paired by",
              "seed, as mean ± standard error. -: not run."]
    return "\n".join(lines) + "\n"


def _plus_minus(row, mean, spread):
    if row[mean] is None:
        return "-"
    decimals = 2 if abs(row[mean]) < 1000 else 1
    text = "%.*f" % (decimals, row[mean])
    return text if row[spread] is None else text + " ± %.*f" % (decimals, row[spread])


def write_summary(experiments, out):
    rows = summary_rows(experiments)
    text = summary_text(rows)
    written = []
    for name, content in (("summary.txt", text), ("summary.csv", summary_csv(rows))):
        written.append(os.path.join(out, name))
        with open(written[-1], "w", encoding="utf-8") as file:
            file.write(content)
    print(text)
    return written


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise PlotError("%s; see --help." % message)


def parse_arguments(arguments):
    parser = Parser(
        prog="plot", description="Draws figures and tables from run folders of pMeta.",
        epilog="Runs are grouped by the settings that differ, seeds apart. Runs whose status is "
        "not 'finished' are left out and named.")
    parser.add_argument("dirs", metavar="DIR", nargs="+",
                        help="a run folder, or any folder above run folders")
    parser.add_argument("--out", metavar="DIR", help="where to write (default: FIRST_DIR/figures)")
    parser.add_argument("--what", metavar="LIST",
                        help="some of %s (default: all that the data allow)" % ",".join(KINDS))
    parser.add_argument("--format", metavar="LIST", default=",".join(FORMATS),
                        help="some of %s (default: both)" % ",".join(FORMATS))
    options = parser.parse_args(arguments)
    options.out = options.out or os.path.join(options.dirs[0], "figures")
    options.asked = _choices("--what", options.what, KINDS) if options.what is not None else ()
    options.formats = _choices("--format", options.format, FORMATS)
    return options


def _choices(name, text, known):
    chosen = [word.strip() for word in text.split(",")]
    for word in chosen:
        if word not in known:
            raise PlotError("%s knows %s, but not '%s'." % (name, ", ".join(known), word))
    return chosen


def run(options):
    kinds = options.asked or KINDS
    run_folders, convergence_folders = pr.find_folders(options.dirs)
    where = " or ".join(options.dirs)
    if not run_folders and not convergence_folders:
        raise PlotError("there are no runs in %s: a run folder holds manifest.json and rounds.csv."
                        % where)
    experiments = pr.group_runs(pr.load_runs(run_folders))
    if not experiments and not convergence_folders:
        raise PlotError("none of the %d runs in %s has finished." % (len(run_folders), where))

    os.makedirs(options.out, exist_ok=True)
    figures = Figures(options.out, options.formats)
    with plt.rc_context(STYLE):
        draw_runs(experiments, kinds, figures)
    written = write_summary(experiments, options.out) if experiments else []
    for path in written + figures.written:
        print("wrote " + path)


def main(arguments):
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")
    try:
        run(parse_arguments(arguments))
    except PlotError as error:
        print("plot: " + str(error), file=sys.stderr)
        return 1
    except OSError as error:
        print("plot: cannot use %s (%s)." % (error.filename, error.strerror), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
