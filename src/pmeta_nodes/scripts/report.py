#!/usr/bin/python3
"""One HTML file about pMeta's runs, with tables and figures; `report.py --help` says how."""

import os
import sys

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_groups as pg
import pmeta_tables as pt
from pmeta_files import warn, warnings_to
from pmeta_program import Parser, run_program


def parse_arguments(arguments):
    parser = Parser(
        prog="report", description="Writes one self-contained HTML file about runs of pMeta: "
        "settings, tables of returns, figures.",
        epilog="Runs are grouped by the settings that differ, seeds apart. Runs whose status is "
        "not 'finished' are left out and named.")
    parser.add_argument("dirs", metavar="RUN_DIR", nargs="+",
                        help="a run folder, or any folder above run folders")
    parser.add_argument("-o", "--out", metavar="FILE",
                        help="the file to write (default: FIRST_RUN_DIR/report.html)")
    options = parser.parse_args(arguments)
    options.out = options.out or os.path.join(options.dirs[0], "report.html")
    return options


def report(dirs, folder):
    """The page as text; `folder` is where it will lie, which its links start from."""
    notes = []
    with warnings_to(notes.append):
        experiments, convergence = pg.load(dirs)
        # slow to load, and of no use to a wrong argument
        import pmeta_html as ph
        import pmeta_sections as ps
        rows = pt.summary_rows(experiments)
        body = []
        for experiment, groups in experiments.items():
            body += ps.experiment_sections(experiment, groups, rows, folder)
            body += [ph.heading(3, "Figures")] + figures_of({experiment: groups}, {})
        if rows:
            body += [ph.heading(2, "How to read the tables"),
                     ph.paragraph(" ".join(pt.legend_lines(rows, experiments)))]
        if convergence:
            body += ps.convergence_section(convergence, folder) + figures_of({}, convergence)
    names = list(experiments) + ["convergence"] * bool(convergence)
    for note in notes:
        warn(note)
    return ph.page("pMeta: " + ", ".join(names),
                   [ph.paragraph("Note: " + note, "note") for note in dict.fromkeys(notes)] + body)


def figures_of(experiments, convergence):
    import pmeta_html as ph
    import pmeta_kinds as pk
    figures = ph.InlineFigures()
    pk.draw(experiments, convergence, pk.KINDS, dict.fromkeys(pk.KINDS, figures))
    return figures.written


def run(arguments):
    options = parse_arguments(arguments)
    folder = os.path.dirname(options.out)
    text = report(options.dirs, folder)
    if folder:
        os.makedirs(folder, exist_ok=True)
    with open(options.out, "w", encoding="utf-8") as file:
        file.write(text)
    print("wrote " + options.out)


def main(arguments):
    return run_program("report", run, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
