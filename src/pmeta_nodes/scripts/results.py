#!/usr/bin/python3
"""The pages of docs/results from committed data, and the runs that give it; see --help."""

import os
import signal
import subprocess
import sys
import time

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_archives as pa
import pmeta_plan as pp
from pmeta_files import PlotError
from pmeta_program import Parser, run_program

TOP = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), *[".."] * 3))
LOCAL = os.path.join(TOP, "devel", "lib", "pmeta_core", "pmeta_local")
# after the round, or at once: on a second Ctrl-C, or one before it was ready for it
STOPPED = (130, -signal.SIGINT)


def parse_arguments(arguments):
    parser = Parser(
        prog="results", description="Writes the tables and figures of docs/results anew from the "
        "data that are committed there.",
        epilog="--run works plan.yaml off by priority. What was cut off goes on, and what has "
        "finished is packed into docs/results/data; then call without options.")
    parser.add_argument("--check", action="store_true",
                        help="only tell whether pages and data agree")
    parser.add_argument("--status", action="store_true", help="what is done, and what is missing")
    parser.add_argument("--run", action="store_true", help="run what is missing, and pack it")
    parser.add_argument("--import", dest="source", metavar="DIR",
                        help="pack what has finished in this results_dir")
    parser.add_argument("--only", metavar="NAME", help="of the plan this sweep alone")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N",
                        help="runs at a time (default: one a core)")
    parser.add_argument("--hours", type=float, metavar="H",
                        help="stop after so long; the same command goes on")
    parser.add_argument("--results-dir", metavar="DIR", default="~/.ros/pmeta/results",
                        help="where runs are kept until they are packed (default: %(default)s)")
    parser.add_argument("--folder", default=os.path.join(TOP, "docs", "results"),
                        help="with plan.yaml, data and pages (default: docs/results)")
    options = parser.parse_args(arguments)
    if not 1 <= options.jobs <= 1024:
        raise PlotError("--jobs must be from 1 to 1024.")
    if options.hours is not None and not 0 < options.hours < 1e5:
        raise PlotError("--hours must be above 0.")
    return options


def sweep_words(sweep, results_dir):
    """pmeta_local's command for it."""
    words = pp.command_of(sweep)
    return ([LOCAL, "sweep", os.path.join(TOP, "config", words[0] + ".yaml")] + words[1:]
            + ["results_dir:=" + os.path.abspath(os.path.expanduser(results_dir))])


def statuses(sweep, results_dir):
    """[(status, folder)] of the runs that the sweep consists of."""
    done = subprocess.run(sweep_words(sweep, results_dir) + ["--dry-run"], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0:
        raise PlotError("sweep '%s' of the plan: %s"
                        % (sweep["name"], done.stderr.strip() or "pmeta_local failed."))
    return [tuple(line.split(" ", 1)) for line in done.stdout.splitlines()]


def is_packed(folder, sweep):
    """Are its data there, and of the command that the plan has now?"""
    path = pa.archive_of(folder, sweep["name"])
    return os.path.isfile(path) and pa.packed_command(path) == pp.command_of(sweep)


def pack(plan, options, sweep, results_dir):
    """Packs a sweep whose runs have all finished; True if they have."""
    runs = statuses(sweep, results_dir)
    finished = [folder for status, folder in runs if status == "finished"]
    if len(finished) < len(runs):
        print("%s: %d of %d runs have finished" % (sweep["name"], len(finished), len(runs)))
        return False
    if any(sweep["name"] in figure["sweeps"] and "trajectories" in figure["kinds"]
           for figure in plan.figures.values()):
        for folder in finished:
            trace(folder)
    path = pa.archive_of(options.folder, sweep["name"])
    pa.pack(path, sweep["name"], pp.command_of(sweep), finished)
    print("packed %d runs into %s (%d kB)" % (len(runs), path, os.path.getsize(path) // 1000 + 1))
    return True


def trace(folder):
    """Has the run's last policies act once more, for the figures that show their ways."""
    done = subprocess.run([LOCAL, "trace", folder], stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0:
        raise PlotError("%s: %s" % (folder, done.stderr.strip() or "pmeta_local failed."))


def chosen(plan, options):
    return [plan.sweep(options.only)] if options.only else plan.in_order()


def tell_status(plan, options):
    for sweep in chosen(plan, options):
        path = pa.archive_of(options.folder, sweep["name"])
        if is_packed(options.folder, sweep):
            state = "done"
        elif os.path.isfile(path):
            state = "out of date: the data are of another command than the plan's"
        else:
            runs = statuses(sweep, options.results_dir)
            state = "%d of %d runs have finished, about %.3g core hours in all" % (
                sum(status == "finished" for status, _ in runs), len(runs), sweep["core_hours"])
        print("%-28s priority %d, %-9s seeds %s: %s" % (
            sweep["name"], sweep["priority"], sweep["use"], pp.seeds_of(sweep), state))


def run_missing(plan, options):
    """Works off what is not packed, as long as it may."""
    end = time.monotonic() + 3600 * options.hours if options.hours else None
    missing = [s for s in chosen(plan, options) if not is_packed(options.folder, s)]
    for number, sweep in enumerate(missing, start=1):
        left = sum(s["core_hours"] for s in missing[number - 1:])
        print("[%d/%d] %s; about %.3g core hours are left, %.3g h with %d jobs" % (
            number, len(missing), sweep["name"], left, left / options.jobs, options.jobs),
            flush=True)
        words = sweep_words(sweep, options.results_dir) + ["--resume", "--jobs", str(options.jobs)]
        code = run_until(words, end)
        if code in STOPPED:
            print("stopped; the same command goes on")
            return
        if code != 0:
            raise PlotError("sweep '%s' failed with exit code %d." % (sweep["name"], code))
        pack(plan, options, sweep, options.results_dir)


def run_until(words, end):
    """The exit code. At the end of the time, or with Ctrl-C, rounds are finished and kept."""
    # a shell has its background jobs ignore Ctrl-C, and whatever these start
    process = subprocess.Popen(
        words, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    while True:
        try:
            left = None if end is None else max(0, end - time.monotonic())
            return process.wait(left)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            end = None
        except KeyboardInterrupt:
            end = None  # the terminal has told the process, too


def write_pages(plan, options):
    import pmeta_pages as pg
    data = pg.Data(options.folder, plan)
    texts = {path: pg.renewed(path, data) for path in pg.pages_of(options.folder)}
    changed = []
    for path, text in texts.items():
        with open(path, encoding="utf-8") as file:
            if file.read() != text:
                changed.append(path)
    if options.check:
        if changed:
            raise PlotError("%s: tables and data differ; ./pmeta results writes them anew."
                            % ", ".join(changed))
        print("all %d pages agree with the data" % len(texts))
        return
    for path in changed:
        with open(path, "w", encoding="utf-8") as file:
            file.write(texts[path])
        print("wrote " + path)
    draw_figures(plan, data, options)


def draw_figures(plan, data, options):
    import pmeta_drawing as pd
    import pmeta_kinds as pk

    class Chosen(pd.Figures):
        """Writes those that the pages show."""

        def __init__(self, entry):
            super().__init__(os.path.join(options.folder, "figures", entry["folder"]), ["png"])
            self.names = entry["keep"]

        def save(self, figure, name):
            if name in self.names:
                super().save(figure, name)
            else:
                pd.plt.close(figure)

        def write(self, text, name):
            pass

    for entry in plan.figures.values():
        if data.can_draw(entry):
            experiments = data.experiments(entry["sweeps"])
            figures = Chosen(entry)
            pk.draw(experiments, {}, entry["kinds"], dict.fromkeys(pk.KINDS, figures))
            for path in figures.written:
                print("wrote " + path)


def run(arguments):
    options = parse_arguments(arguments)
    plan = pp.plan_in(options.folder)
    if options.status:
        tell_status(plan, options)
    elif options.source:
        for sweep in chosen(plan, options):
            pack(plan, options, sweep, options.source)
    elif options.run:
        run_missing(plan, options)
    else:
        write_pages(plan, options)


def main(arguments):
    return run_program("results", run, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
