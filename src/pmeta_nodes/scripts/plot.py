#!/usr/bin/python3
"""Figures and tables from pMeta's run folders; `plot.py --help` says how."""

import argparse
import os
import sys

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_runs as pr
import pmeta_tables as pt
from pmeta_files import PlotError

KINDS = ("curves", "sweep", "tasks", "convergence")
FORMATS = ("png", "pdf")
NEEDS = {"curves": "it has no finished run",
         "sweep": "no numeric setting of pMeta-RL differs between its runs",
         "tasks": "it has neither networks nor fresh episodes",
         "convergence": "it has no finished convergence run"}


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
    import pmeta_convergence as pc
    import pmeta_drawing as pd
    import pmeta_figures as pf
    os.makedirs(options.out, exist_ok=True)
    rows = pt.summary_rows(experiments)
    written = pt.write_tables(experiments, rows, options.out)
    figures = {kind: pd.Figures(options.out, options.formats) for kind in KINDS}
    with pd.style():
        pf.draw_runs(experiments, kinds, figures)
        if "convergence" in kinds:
            pc.draw_convergence(convergence, figures["convergence"])
    for kind in kinds:
        written += figures[kind].written
    if rows:
        print(pt.summary_text(rows))
    for path in written:
        print("wrote " + path)
    for kind in options.asked:
        if not figures[kind].written:
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
