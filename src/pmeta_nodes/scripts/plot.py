#!/usr/bin/python3
"""Figures and tables from pMeta's run folders and bags; `plot.py --help` says how."""

import os
import sys

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_groups as pg
import pmeta_tables as pt
from pmeta_files import PlotError
from pmeta_program import Parser, run_program

# as in pmeta_kinds, which is slow to load, and of no use to a wrong argument
NEEDS = {"curves": "it has no finished run",
         "comparison": "it has no method that learns all tasks at once, beside another",
         "sweep": "no numeric setting of pMeta-RL differs between its runs",
         "tasks": "it has neither networks nor fresh episodes",
         "unseen": "it has neither test tasks nor an inference network",
         "trajectories": "it has no run of sparse_point_robot with a trajectories.csv",
         "values": "it has no run of mountain_car or sparse_point_robot with policies",
         "convergence": "it has no finished convergence run"}
FORMATS = ("png", "pdf")


def parse_arguments(arguments):
    parser = Parser(
        prog="plot", description="Draws figures and tables from run folders and bags of pMeta.",
        epilog="Runs are grouped by the settings that differ, seeds apart. Runs whose status is "
        "not 'finished' are left out and named. A bag gives learning curves from its topic returns "
        "alone.")
    parser.add_argument("dirs", metavar="DIR", nargs="+",
                        help="a run folder, any folder above run folders, or a rosbag of a run")
    parser.add_argument("--out", metavar="DIR",
                        help="where to write (default: FIRST_DIR/figures, for a bag beside it)")
    parser.add_argument("--what", metavar="LIST",
                        help="some of %s (default: all that the data allow)" % ",".join(NEEDS))
    parser.add_argument("--format", metavar="LIST", default=",".join(FORMATS),
                        help="some of %s (default: both)" % ",".join(FORMATS))
    options = parser.parse_args(arguments)
    for path in options.dirs:
        if path.endswith(".bag.active") and os.path.isfile(path):
            raise PlotError("%s is still being recorded, or its recording was cut off: end the "
                            "recording, or mend it with rosbag reindex and rename it to .bag."
                            % path)
    options.bags = [path for path in options.dirs if is_bag(path)]
    first = options.dirs[0]
    options.dirs = [path for path in options.dirs if path not in options.bags]
    options.out = options.out or os.path.join(
        os.path.dirname(first) if first in options.bags else first, "figures")
    options.asked = _choices("--what", options.what, NEEDS) if options.what is not None else ()
    options.formats = _choices("--format", options.format, FORMATS)
    return options


def is_bag(path):
    return os.path.isfile(path) and path.endswith(".bag")


def _choices(name, text, known):
    chosen = [word.strip() for word in text.split(",")]
    for word in chosen:
        if word not in known:
            raise PlotError("%s knows %s, but not '%s'." % (name, ", ".join(known), word))
    return chosen


def plot_folders(options):
    experiments, convergence = pg.load(options.dirs)
    import pmeta_drawing as pd
    import pmeta_kinds as pk
    os.makedirs(options.out, exist_ok=True)
    rows = pt.summary_rows(experiments)
    written = pt.write_tables(experiments, rows, options.out)
    figures = {kind: pd.Figures(options.out, options.formats) for kind in pk.KINDS}
    pk.draw(experiments, convergence, options.asked or pk.KINDS, figures)
    if rows:
        print(pt.summary_text(rows, experiments))
    for path in written + [path for kind in pk.KINDS for path in figures[kind].written]:
        print("wrote " + path)
    for kind in options.asked:
        if not figures[kind].written:
            raise PlotError("there is nothing to draw for %s in %s: %s."
                            % (kind, " or ".join(options.dirs), NEEDS[kind]))


def plot_bags(options):
    import pmeta_bags as pb
    runs = [run for path in options.bags for run in pb.read_bag(path)]
    import pmeta_drawing as pd
    import pmeta_figures as pf
    os.makedirs(options.out, exist_ok=True)
    figures = pd.Figures(options.out, options.formats)
    with pd.style():
        for run, name in zip(runs, pb.names_of(runs)):
            pf.bag_curves(run, name, figures)
    for path in figures.written:
        print("wrote " + path)


def run(arguments):
    options = parse_arguments(arguments)
    if options.asked and "curves" not in options.asked and not options.dirs:
        raise PlotError("a bag gives curves alone.")
    if options.bags:
        plot_bags(options)
    if options.dirs:
        plot_folders(options)


def main(arguments):
    return run_program("plot", run, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
