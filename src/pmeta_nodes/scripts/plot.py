#!/usr/bin/python3
"""Figures and tables from pMeta's run folders; `plot.py --help` says how."""

import argparse
import csv
import io
import os
import sys

import numpy as np

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_runs as pr
from pmeta_runs import PlotError

KINDS = ("curves", "sweep", "convergence")
FORMATS = ("png", "pdf")
NEEDS = {"curves": "it has no finished run",
         "sweep": "no numeric setting of pMeta-RL differs between its runs",
         "convergence": "it has no finished convergence run"}
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


def write_summary(rows, out):
    written = []
    for name, content in (("summary.txt", summary_text(rows)), ("summary.csv", summary_csv(rows))):
        written.append(os.path.join(out, name))
        with open(written[-1], "w", encoding="utf-8") as file:
            file.write(content)
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
    convergence = pr.load_convergence(convergence_folders)
    if not experiments and not convergence:
        raise PlotError("none of the %d runs in %s has finished."
                        % (len(run_folders) + len(convergence_folders), where))

    # slow to load, and of no use to a wrong argument
    import pmeta_figures as pf
    os.makedirs(options.out, exist_ok=True)
    rows = summary_rows(experiments)
    written = write_summary(rows, options.out) if rows else []
    drawn = pf.draw(experiments, convergence, kinds, options.out, options.formats)
    for kind in kinds:
        written += drawn[kind]
    if rows:
        print(summary_text(rows))
    for path in written:
        print("wrote " + path)
    for kind in options.asked:
        if not drawn[kind]:
            raise PlotError("there is nothing to draw for %s in %s: %s."
                            % (kind, where, NEEDS[kind]))


def main(arguments):
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")
    try:
        run(parse_arguments(arguments))
        sys.stdout.flush()
    except PlotError as error:
        print("plot: " + str(error), file=sys.stderr)
        return 1
    except BrokenPipeError:
        # the reader has seen enough, and every file has been written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        print("plot: cannot use %s (%s)." % (error.filename or "the output", error.strerror),
              file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
