"""The sections of a report: what was run, its returns in tables, and its figures, as HTML."""

import os

import pmeta_comparisons as pc
import pmeta_tables as pt
from pmeta_files import read_text
from pmeta_html import details, facts, heading, link, preformatted, table, text

POLICY_WORDS = {"personal": "PP", "meta": "MP", "meta_test": "MP", "all": "all"}
MANY_RUNS = 4  # more are folded away


def experiment_sections(experiment, groups, rows, folder):
    """Everything of one experiment but its figures; `folder` is where the report will lie."""
    members = [row for row in rows if row["experiment"] == experiment]
    return ([heading(2, experiment), facts(experiment_facts(groups))]
            + return_tables(members, groups) + task_tables(experiment, groups)
            + [heading(3, "Runs and settings"), runs_table(groups, folder)]
            + [settings_of(group) for group in groups])


def experiment_facts(groups):
    runs = [run for group in groups for run in group.runs]
    ended = [str(run.manifest.get("ended") or run.started) for run in runs]
    dates = sorted(filter(None, [run.started for run in runs] + ended))
    pairs = [("algorithms", "; ".join(text(group.label) for group in groups)),
             ("tasks", "<br>".join(task_texts(groups))),
             ("rounds", text(", ".join(map(str, sorted(set(run.num_rounds for run in runs)))))),
             ("seeds", text(number_ranges(run.seed for run in runs))),
             ("runs", text(len(runs))),
             ("commit", text(", ".join(sorted(set(run.commit for run in runs))))),
             ("versions", text("; ".join(sorted(set(map(versions_text, runs)))))),
             ("date (UTC)", text(" to ".join(dict.fromkeys([dates[0], dates[-1]]))
                                 if dates else "unknown"))]
    return pairs


def task_texts(groups):
    """Of every task its number and what its manifest says of it, or how many there are."""
    found = [group.runs[0] for group in groups]
    if len(set(tuple(run.task_names) for run in found)) > 1:
        return ["several sets, see below"]
    most = max(found, key=lambda run: run.num_tests)
    return [text("%s: %s" % (head, name) if name != "task %d" % i else head)
            for i, (head, name) in enumerate(zip(task_heads(most),
                                                 most.task_names + most.test_names))]


def task_heads(run):
    """"task 0" of each training task, "test task 5" of each test task."""
    return ["task %d" % i for i in run.tasks_of("personal")] + [
        "test task %d" % i for i in run.tasks_of("meta_test")]


def versions_text(run):
    versions = run.manifest.get("versions")
    return ", ".join("%s %s" % item for item in sorted(versions.items())) if isinstance(
        versions, dict) else "unknown"


def number_ranges(values):
    """"0–4, 7" of 0, 1, 2, 3, 4, 7."""
    found = []
    for value in sorted(set(values)):
        if found and value == found[-1][1] + 1:
            found[-1][1] = value
        else:
            found.append([value, value])
    return ", ".join("%d" % a if a == b else "%d–%d" % (a, b) for a, b in found)


def return_tables(rows, groups):
    heads, lines = pt.best_cells(rows)
    found = [heading(3, "Returns: best and last round"), html_table(heads, lines, words=2),
            heading(3, "Learning: mean over the rounds (AUC)"),
            html_table(*pt.learning_cells(rows)),
            heading(3, "Interquartile means, with 95 % intervals"),
            html_table(*pc.iqm_cells(rows), words=2)]
    heads, lines = pc.comparison_cells(groups)
    if lines:
        found += [heading(3, "Comparisons"), html_table(heads, lines, words=3)]
    return found


def html_table(heads, lines, words=1):
    return table([text(h) for h in heads], [[text(cell) for cell in line] for line in lines], words)


def task_tables(experiment, groups):
    """Returns task by task; a table for each set of tasks, which is named above it if several."""
    by_names = {}
    for group in groups:
        by_names.setdefault(tuple(group.runs[0].task_names), []).append(group)
    found = [heading(3, "Returns task by task")]
    for names, members in by_names.items():
        lines = {}
        for row in pt.task_rows(experiment, members):
            key = row["group"], POLICY_WORDS[row["policies"]], row["snapshot"], row["episodes"]
            lines.setdefault(key, {})[row["task"]] = pt.plus_minus(row["mean"], row["std"])
        if len(by_names) > 1:
            found.append(facts(("task %d" % i, text(name)) for i, name in enumerate(names)))
        heads = task_heads(max((g.runs[0] for g in members), key=lambda run: run.num_tests))
        made, last = [], None
        for key, cells in lines.items():
            label, last = "" if key[0] == last else key[0], key[0]
            made.append((label,) + key[1:] + tuple(cells.get(i, "-") for i in range(len(heads))))
        found.append(html_table(("group", "policy", "round", "episodes") + tuple(heads), made,
                                words=4))
    return found


def runs_table(groups, folder):
    """Every run with its files."""
    lines = []
    for group in groups:
        for run in group.runs:
            files = [link(os.path.join(run.folder, name), folder, name)
                     for name in ("rounds.csv", "losses.csv", "final.csv", "config.yaml",
                                  "manifest.json")
                     if os.path.isfile(os.path.join(run.folder, name))]
            name = os.path.basename(os.path.normpath(run.folder))
            lines.append([link(run.folder, folder, name), text(group.label), text(run.seed),
                          text(run.started), text(run.commit), " ".join(files)])
    made = table(["run", "group", "seed", "started", "commit", "files"], lines, words=6)
    return details("all %d runs, with their CSV files" % len(lines), made) if len(
        lines) > MANY_RUNS else made


def settings_of(group):
    run = group.runs[0]
    return details("effective settings of %s (seed %d)" % (group.label, run.seed),
                   preformatted(read_text(os.path.join(run.folder, "config.yaml"))))


def convergence_section(convergence, folder):
    """The files of the runs that measured the theory."""
    lines = []
    for place, files in convergence.items():
        names = sorted(set(files) | {"statements.csv"})
        links = [link(os.path.join(place, name), folder, name) for name in names
                 if os.path.isfile(os.path.join(place, name))]
        lines.append([link(place, folder, os.path.basename(os.path.normpath(place))),
                      " ".join(links)])
    return [heading(2, "Theory, measured"), table(["run", "files"], lines, words=2)]
