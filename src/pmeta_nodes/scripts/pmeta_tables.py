"""Tables of pMeta's runs: the summary as text and CSV, the paper's two tables as LaTeX."""

import csv
import io
import os
import textwrap

import numpy as np

import pmeta_comparisons as pc
import pmeta_groups as pg
import pmeta_margins as pm
import pmeta_methods as pms
from pmeta_files import OWN_BEST, SNAPSHOTS
from pmeta_manifest import data_file, plain

WIDTH = 120
BEST_HEADS = {"best": "best", "last": "last", "fresh_best": "fresh (best)",
              "fresh_own_best": "fresh (own best)", "fresh_last": "fresh (last)"}
ALL_LEGEND = ("all: every personal policy on every task, mean over all pairs.",)
TEX_HEADS = {"best": "best", "fresh_best": "fresh", "fresh_own_best": "fresh, own best"}
LEARNING = {  # head: columns of the mean and of its spread
    "PP last": ("pp_last_mean", "pp_last_std"), "MP last": ("mp_last_mean", "mp_last_std"),
    "MP test last": ("mp_test_last_mean", "mp_test_last_std"),
    "PP AUC": ("pp_auc_mean", "pp_auc_std"), "MP AUC": ("mp_auc_mean", "mp_auc_std"),
    "MP - MA": ("mp_minus_ma_auc", "mp_minus_ma_auc_se"),
    "PP - MA": ("pp_minus_ma_auc", "pp_minus_ma_auc_se")}
# columns that are left out where there is none of these: without PP none is set against averaging
NEEDED = {"MP test last": "mp_test_last_mean", "PP last": "pp_last_mean", "PP AUC": "pp_last_mean",
          "MP - MA": "pp_last_mean", "PP - MA": "pp_last_mean"}
COLUMNS = ("experiment", "group", "algorithm", "lambda", "seeds", "pp_last_mean", "pp_last_std",
           "mp_last_mean", "mp_last_std", "pp_auc_mean", "pp_auc_std", "mp_auc_mean",
           "mp_auc_std", "pairs", "mp_minus_ma_auc", "mp_minus_ma_auc_se", "pp_minus_ma_auc",
           "pp_minus_ma_auc_se", "pp_best_mean", "pp_best_std", "mp_best_mean", "mp_best_std",
           "fresh_seeds") + tuple(
               "%s_fresh_%s_%s" % (name, snapshot, what) for snapshot in SNAPSHOTS
               for name in ("pp", "mp", "all") for what in ("mean", "std")) + tuple(
                   "%s_%s" % (measure, what) for measure in (
                       "pp_fresh_own_best", "mp_test_last", "mp_test_fresh_best",
                       "mp_test_fresh_last") for what in ("mean", "std")) + pc.IQM_COLUMNS
TASK_COLUMNS = ("experiment", "group", "snapshot", "policies", "episodes", "task", "name", "seeds",
                "mean", "std", "min", "max")

PAPER = data_file("paper.yaml")
LATEX = str.maketrans({
    "\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", "α": r"$\alpha$",
    "β": r"$\beta$", "γ": r"$\gamma$", "η": r"$\eta$", "λ": r"$\lambda$",
    **{c: "\\" + c for c in "_%&#${}"}})


def summary_rows(experiments):
    """A dict a group with COLUMNS; what is not known (one seed, no baseline) is None."""
    rows = []
    for experiment, groups in experiments.items():
        for group in groups:
            row = dict.fromkeys(COLUMNS)
            row.update(experiment=experiment, group=group.label, algorithm=group.algorithm,
                       seeds=len(group.runs), fresh_seeds=sum(bool(r.fresh) for r in group.runs))
            row["lambda"] = group.settings.get("personal.lambda")
            # only the summary's text and LaTeX ask for these
            row["as_paper"] = as_in_paper(experiment, group)
            row["learner"] = group.settings.get("learner")
            row["adapts"] = len(group.adaptations("train")) > 1
            row.update(pc.iqm_columns(group))
            for name, policy in pc.POLICIES.items():
                if policy in group.policies:
                    # of test tasks no round is chosen
                    for measure in ("last", "auc", "best")[:1 if name == "mp_test" else None]:
                        _enter(row, "%s_%s" % (name, measure), getattr(group, measure)(policy))
                # those of pMeta-RL are not run on each other's tasks, or not in every seed
                for snapshot in SNAPSHOTS + (OWN_BEST,):
                    _enter(row, "%s_fresh_%s" % (name, snapshot), group.fresh(snapshot, policy))
            if not group.figures.baseline:
                row.update(paired_differences(group, pg.reference_line(group, groups)))
            rows.append(row)
    return rows


def as_in_paper(experiment, group):
    """May the paper's numbers stand beside those of the group?"""
    return experiment in PAPER["experiments"] and all(
        group.settings.get(k) == plain(v) for k, v in PAPER["settings"].items()) and (
            int(group.rounds[-1]) * group.settings.get("updates_per_round", 1)
            == PAPER["experiments"][experiment]["updates"])


def _enter(row, name, values):
    if len(values):
        row[name + "_mean"] = float(values.mean())
    if len(values) > 1:
        row[name + "_std"] = float(values.std(ddof=1))


def paired_differences(group, baseline):
    """AUC less that of the baseline's meta-policy, seed by seed."""
    if baseline is None:
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


def csv_text(columns, rows):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow("" if row[c] is None else row[c] for c in columns)
    return text.getvalue()


def summary_text(rows, experiments):
    """For each experiment tables of its learning, its best returns, and what few seeds allow."""
    lines = []
    for experiment in dict.fromkeys(row["experiment"] for row in rows):
        members = [row for row in rows if row["experiment"] == experiment]
        lines += ["experiment %s: learning" % experiment]
        lines += aligned(*learning_cells(members))
        lines += ["", "experiment %s: best returns" % experiment]
        # the last returns stand in the table above
        lines += aligned(*best_cells(members, [m for m in BEST_HEADS if m != "last"]),
                         left=2)
        if any(row["seeds"] > 1 for row in members):
            lines += ["", "experiment %s: interquartile means" % experiment]
            lines += aligned(*pc.iqm_cells(members), left=2)
        heads, compared = pc.comparison_cells(experiments[experiment])
        if compared:
            lines += ["", "experiment %s: comparisons" % experiment]
            lines += aligned(heads, compared, left=3)
        margins = pm.margin_rows(experiment, experiments[experiment])
        if margins:
            lines += ["", "experiment %s: margins over other methods" % experiment]
            lines += ["  " + line for line in wrapped(pm.who_wins(margins))]
            lines += aligned(*pm.margin_cells(margins), left=2)
        lines.append("")
    return "\n".join(lines + legend_lines(rows, experiments)) + "\n"


def wrapped(sentences):
    return [line for sentence in sentences for line in textwrap.wrap(sentence, WIDTH - 2)]


def legend_lines(rows, experiments):
    """What the tables of returns mean."""
    lines = ["Returns are means over the training tasks, as mean ± standard deviation over seeds.",
             "PP: personal policies. MP: meta-policy. last: at the last round. AUC: mean over the",
             "rounds. MP - MA, PP - MA: AUC less that of model averaging's meta-policy, paired by",
             "seed, as mean ± standard error. best: the largest in any round, on that round's",
             "evaluation episodes, as the paper has it."]
    if any(row["mp_test_last_mean"] is not None for row in rows):
        lines += ["MP test last, MP on test tasks: the same over the test tasks, which nobody",
                  "trained on; they have no say in which round is best."]
    if any(row["adapts"] for row in rows):
        lines += ["MP is after adaptation from the most exploration episodes of the run."]
    if any(row["fresh_seeds"] for row in rows):
        lines += ["fresh (best), fresh (last): the policies of that round and of the last round,",
                  "on episodes that had no part in the choice."]
    if any(row["pp_fresh_own_best_mean"] is not None for row in rows):
        lines += ["fresh (own best): the same where each robot keeps its personal policy of the",
                  "round in which it did best on its own task."]
    legends = [tuple(paper_names(row).get("legend", ALL_LEGEND)) for row in rows
               if row["all_fresh_best_mean"] is not None]
    lines += [line for legend in sorted(set(legends), reverse=True) for line in legend]
    if any(row["as_paper"] for row in rows):
        lines += ["paper, λ and paper, best: its table by λ and its table of best returns, beside runs",
                  "with its networks, batch and number of updates, whatever their other settings."]
    if any(map(pms.are_compared, experiments.values())):
        lines += pm.LEGEND
    return lines + pc.LEGEND + ["-: not run."]


def learning_cells(rows):
    """(heads, lines): a line for each group; PP and test tasks have columns where there are any."""
    shown = {head: keys for head, keys in LEARNING.items()
             if head not in NEEDED or any(row[NEEDED[head]] is not None for row in rows)}
    return ("group", "seeds") + tuple(shown), [
        (row["group"], str(row["seeds"])) + tuple(
            plus_minus(row[mean], row[spread]) for mean, spread in shown.values()) for row in rows]


def best_cells(rows, measures=tuple(BEST_HEADS)):
    """(heads, lines): a line for each group and policy, the paper's numbers where there are any."""
    measures = known_measures(rows, measures)
    heads = ("group", "policy") + tuple(BEST_HEADS[m] for m in measures)
    paper = any(row["as_paper"] for row in rows)
    if paper:
        heads += ("paper, λ", "paper, best")
    lines = []
    for row in rows:
        label = row["group"]
        for name, policy in best_policies(row, measures):
            cells = (label, policy) + tuple(value_of(row, name, m) for m in measures)
            if paper:
                cells += tuple(plus_minus(*pair) for pair in paper_values(row, name))
            lines.append(cells)
            label = ""
    return heads, lines


def known_measures(rows, measures):
    """Those of which a row has a return; fresh ones are shown together."""
    fresh = any(row["fresh_seeds"] for row in rows)
    own = any(row["pp_fresh_own_best_mean"] is not None for row in rows)
    return [m for m in measures
            if (own if m == "fresh_own_best" else fresh or not m.startswith("fresh"))]


def best_policies(row, measures):
    """[(pp, mp, mp_test or all, its name)] of which the group has a return."""
    names = dict({"pp": "PP", "mp": "MP", "mp_test": "MP on test tasks", "all": "all"},
                 **paper_names(row))
    names.pop("legend", None)
    return [(name, text) for name, text in names.items()
            if any(row.get("%s_%s_mean" % (name, m)) is not None for m in measures)]


def value_of(row, name, measure):
    key = "%s_%s_" % (name, measure)
    return plus_minus(row.get(key + "mean"), row.get(key + "std"))


def paper_values(row, name):
    """Mean and deviation in the paper's table by lambda, and in its table of best returns."""
    unknown = (None, None)
    if not row["as_paper"]:
        return unknown, unknown
    known, strength = PAPER["experiments"][row["experiment"]], row["lambda"]
    by_lambda = known["by_lambda"].get(name, {}).get(strength, unknown)
    if strength not in (None, PAPER["lambda"]):
        return by_lambda, unknown
    return by_lambda, known["best"].get(row["algorithm"], {}).get(name, unknown)


def paper_names(row):
    """What its policies are called there: {pp, all or legend: words}."""
    return PAPER["names"].get(row["algorithm"], {}).get(row["learner"], {})


def aligned(heads, lines, left=1):
    """Lines of a table at most WIDTH wide: where it would be wider, labels stand above."""
    table = [heads] + lines
    widths = [max(len(line[i]) for line in table) for i in range(len(heads))]
    above = 2 * len(widths) + sum(widths) > WIDTH
    first = 1 if above else 0
    found = []
    for line in table:
        if above and line[0]:
            found.append("  " + line[0])
        cells = [c.ljust(w) if i < left else c.rjust(w)
                 for i, (c, w) in enumerate(zip(line, widths))]
        found.append(("  " * (1 + first) + "  ".join(cells[first:])).rstrip())
    return found


def plus_minus(mean, spread, sign="±"):
    if mean is None:
        return "-"
    decimals = 2 if abs(mean) < 1000 else 1
    text = "%.*f" % (decimals, mean)
    return text if spread is None else text + " %s %.*f" % (sign, decimals, spread)


def latex(text):
    return text.translate(LATEX)


def latex_cell(row, name, measure, bold=False):
    if row is None or row.get("%s_%s_mean" % (name, measure)) is None:
        return "--"
    key = "%s_%s_" % (name, measure)
    text = "$" + plus_minus(row[key + "mean"], row[key + "std"], r"\pm") + "$"
    return r"{\boldmath %s}" % text if bold else text


def best_returns_tex(rows):
    """Rows algorithms and columns experiments, as the paper's table of best returns."""
    experiments = list(dict.fromkeys(row["experiment"] for row in rows))
    columns = [(e, m) for e in experiments
               for m in known_measures([r for r in rows if r["experiment"] == e], TEX_HEADS)]
    found = {}
    for row in rows:
        for name, policy in best_policies(row, TEX_HEADS):
            found.setdefault("%s, %s" % (row["group"], policy), {})[row["experiment"]] = row, name
    lines = [" & ".join(["Algorithm"] + [r"\multicolumn{%d}{c}{%s}" % (
        sum(c[0] == e for c in columns), latex(e)) for e in experiments]) + r" \\"]
    lines.append(" & ".join([""] + [TEX_HEADS[m] for _, m in columns]) + r" \\")
    lines.append(r"\midrule")
    for label, by_experiment in found.items():
        cells = [latex_cell(*by_experiment.get(e, (None, "")), m) for e, m in columns]
        lines.append(" & ".join([latex(label)] + cells) + r" \\")
    caption = ("Best average returns, mean $\\pm$ standard deviation over seeds. Best: the largest "
               "in any round; fresh: the policies of that round on fresh episodes")
    if any(m == "fresh_own_best" for _, m in columns):
        caption += "; own best: each robot's policy of the round in which it did best on its task"
    caption += "."
    return latex_table(caption, "l" + "c" * len(columns), lines)


def lambda_table_tex(experiments, rows):
    """Columns lambda and rows MP and PP, as the paper's "Effect of regularization", or None."""
    by_label = {(row["experiment"], row["group"]): row for row in rows}
    blocks = []
    for experiment, groups in experiments.items():
        ours = pg.without_baselines(groups)
        for members in pg.slices(ours, "personal.lambda"):
            fixed = pg.fixed_texts(members[0], ours, "personal.lambda")
            blocks.append((" ".join([experiment] + fixed),
                           [by_label[experiment, group.label] for group in members]))
    if not blocks:
        return None
    width = max(len(members) for _, members in blocks)
    lines = []
    for i, (label, members) in enumerate(blocks):
        lines += [r"\midrule"] if i else []
        pad = [""] * (width - len(members))
        lines.append(" & ".join([latex(label)] + [r"$\lambda=%s$" % pg.value_text(row["lambda"])
                                                  for row in members] + pad) + r" \\")
        lines.append(r"\cmidrule{2-%d}" % (len(members) + 1))
        for measure, suffix in (("best", ""), ("fresh_best", ", fresh")):
            for name in ("mp", "pp"):
                values = [row["%s_%s_mean" % (name, measure)] for row in members]
                if any(value is not None for value in values):
                    top = max(round(v, 2) for v in values if v is not None)
                    cells = [latex_cell(row, name, measure, v is not None and round(v, 2) == top)
                             for row, v in zip(members, values)]
                    lines.append(" & ".join([name.upper() + suffix] + cells + pad) + r" \\")
    caption = ("Effect of regularization $\\lambda$: best average return of pMeta-RL, mean $\\pm$ "
               "standard deviation over seeds.")
    return latex_table(caption, "l" + "c" * width, lines)


def latex_table(caption, columns, lines):
    return "\n".join(
        ["% from summary.csv; needs \\usepackage{booktabs}", r"\begin{table}[htbp]",
         r"  \centering", r"  \caption{%s}" % caption, r"  \begin{tabular}{%s}" % columns,
         r"    \toprule"] + ["    " + line for line in lines]
        + [r"    \bottomrule", r"  \end{tabular}", r"\end{table}"]) + "\n"


def task_rows(experiment, groups):
    """A dict with TASK_COLUMNS for every group, snapshot, policy and task."""
    rows = []
    for group in groups:
        for snapshot in SNAPSHOTS:
            for policies in pc.POLICIES.values():
                data = group.by_task(policies, snapshot)
                names = group.runs[0].test_names if policies == "meta_test" else (
                    group.runs[0].task_names)
                for i, task in enumerate(group.runs[0].tasks_of(policies) if data else ()):
                    values = data[0][:, i]
                    values = values[np.isfinite(values)]
                    if len(values):
                        std = float(values.std(ddof=1)) if len(values) > 1 else None
                        rows.append(dict(zip(TASK_COLUMNS, (
                            experiment, group.label, snapshot, policies, data[1], task,
                            names[i], len(values), float(values.mean()), std,
                            float(values.min()), float(values.max())))))
    return rows


def margins_csv(experiments):
    """Or None, where there is nothing to compare."""
    rows = [row for experiment, groups in experiments.items()
            for row in pm.margin_rows(experiment, groups)]
    return csv_text(pm.COLUMNS, rows) if rows else None


def write_tables(experiments, rows, out):
    """Writes what there are rows for; returns the paths."""
    texts = {"summary.txt": summary_text(rows, experiments), "summary.csv": csv_text(COLUMNS, rows),
             "best_returns.tex": best_returns_tex(rows),
             "lambda_table.tex": lambda_table_tex(experiments, rows),
             "margins.csv": margins_csv(experiments)} if rows else {}
    written = []
    for name, text in texts.items():
        if text is not None:
            written.append(os.path.join(out, name))
            with open(written[-1], "w", encoding="utf-8") as file:
                file.write(text)
    return written
