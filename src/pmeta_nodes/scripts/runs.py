#!/usr/bin/python3
"""Lists runs and sweeps, and removes those no longer wanted; `runs.py --help` says how."""

import json
import os
import sys
import time

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_run_list as rl
from pmeta_files import PlotError, shown, warn
from pmeta_program import Parser, run_program

COLUMNS = ("run", "rounds", "PP", "MP", "size", "changed", "status")


def parse_arguments(arguments):
    parser = Parser(
        prog="runs", description="Lists the runs and sweeps of a results folder, the one that "
        "changed last at the end: rounds done of all, the last returns of the personal policies "
        "(PP) and of the meta-policy (MP), and whether it has finished, was stopped, has failed "
        "and why, is running and in which process, or was interrupted, i.e. its process died.",
        epilog="Give the folder of a sweep as DIR for the runs in it. What is going on is never "
        "removed. Runs that were stopped or interrupted can be resumed as long as they are there.")
    parser.add_argument("dir", metavar="DIR", nargs="?",
                        help="the results folder (default: $ROS_HOME/pmeta or ~/.ros/pmeta)")
    parser.add_argument("--older-than", metavar="DAYS", type=float,
                        help="only what has not changed for so many days")
    parser.add_argument("--json", action="store_true", help="a list for programs")
    removal = parser.add_mutually_exclusive_group()
    removal.add_argument("--remove", metavar="RUN", nargs="+",
                         help="remove these runs or sweeps, as listed or as paths")
    removal.add_argument("--remove-unfinished", action="store_true",
                         help="remove what was stopped, has failed or was interrupted, also in "
                         "sweeps")
    removal.add_argument("--remove-all", action="store_true",
                         help="remove all that is listed, e.g. with --older-than 90")
    parser.add_argument("--yes", action="store_true", help="remove without asking")
    options = parser.parse_args(arguments)
    if options.older_than is not None and not 0 <= options.older_than < 1e6:
        raise PlotError("--older-than is %g but must be a number of days, at least 0."
                        % options.older_than)
    options.removes = bool(options.remove or options.remove_unfinished or options.remove_all)
    if options.json and options.removes:
        raise PlotError("--json lists: leave it out to remove.")
    if options.yes and not options.removes:
        raise PlotError("--yes is for removing: give --remove, --remove-unfinished or --remove-all.")
    return options


def default_dir():
    home = os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")
    return os.path.join(home, "pmeta")


def name_of(entry, top):
    return os.path.relpath(entry.folder, os.path.realpath(top))


def old_enough(entries, options):
    return [entry for entry in entries
            if options.older_than is None or rl.days_since(entry) >= options.older_than]


def table(entries, top):
    rows = [COLUMNS]
    for entry in entries:
        rows.append((
            shown(name_of(entry, top), 200),
            "-" if entry.rounds is None else "%d/%d" % (entry.rounds_done, entry.rounds),
            *("-" if value is None else "%.4g" % value for value in (entry.personal, entry.meta)),
            rl.size_text(entry.size), rl.age(time.time() - entry.changed), entry.text))
    widths = [max(map(len, column)) for column in zip(*rows)]
    # names and what is said last begin at the left, numbers end at the right
    return "\n".join("  ".join(
        word.ljust(width) if place == 0 else word if place == len(COLUMNS) - 1 else
        word.rjust(width) for place, (word, width) in enumerate(zip(row, widths))) for row in rows)


def as_json(entries, top):
    found = []
    for entry in entries:
        item = {"name": name_of(entry, top), "folder": entry.folder, "size": entry.size,
                "changed": entry.changed, "rounds_done": entry.rounds_done, "rounds": entry.rounds,
                "personal_return": entry.personal, "meta_return": entry.meta}
        if isinstance(entry, rl.Sweep):
            item.update(runs=len(entry.runs), statuses=entry.counts)
        else:
            item.update(seed=entry.seed, status=entry.status, reason=entry.reason or None,
                        holder=entry.holder or None)
        found.append(item)
    return json.dumps(found, indent=2)


def named(names, entries, top):
    """The entries, or runs of sweeps, that the user named, each once."""
    known = {run.folder: run for entry in entries for run in entry.runs}
    known.update((entry.folder, entry) for entry in entries)
    found = {}
    for name in names:
        folders = [os.path.realpath(os.path.join(top, name)), os.path.realpath(name)]
        folder = next((folder for folder in folders if folder in known), None)
        if folder is None:
            raise PlotError("there is no run or sweep '%s' in %s: give its name as the list has it."
                            % (shown(name, 200), top))
        found[folder] = known[folder]
    return [entry for folder, entry in found.items()
            if not any(folder.startswith(other + os.sep) for other in found)]


def chosen(entries, options, top):
    """What is to be removed."""
    if options.remove:
        found = old_enough(named(options.remove, entries, top), options)
        for run in (run for entry in found for run in entry.runs if run.holder):
            raise PlotError("the run %s is being written by %s: wait until that has ended, or stop "
                            "it." % (run.folder, run.holder))
        return found
    if options.remove_unfinished:
        return old_enough([run for entry in entries for run in entry.runs
                           if run.status not in (rl.FINISHED, rl.RUNNING)], options)
    found = old_enough(entries, options)
    for entry in found:
        if any(run.holder for run in entry.runs):
            warn("%s is left alone: it is running." % name_of(entry, top))
    return [entry for entry in found if not any(run.holder for run in entry.runs)]


def remove(entries, options, top):
    if not entries:
        print("there is nothing to remove in %s." % top)
        return
    what = "%s with %s" % (rl.counted(sum(len(entry.runs) for entry in entries), "run"),
                           rl.size_text(sum(entry.size for entry in entries)))
    if not options.yes:
        if not sys.stdin.isatty():
            raise PlotError("nobody can be asked here whether to remove %s: give --yes." % what)
        print(table(entries, top))
        print("Remove %s for good? [y/N] " % what, end="", flush=True)
        if sys.stdin.readline().strip().lower() not in ("y", "yes"):
            raise PlotError("nothing was removed.")
    for entry in entries:
        rl.remove(entry, top)
    print("removed " + what)


def run(arguments):
    options = parse_arguments(arguments)
    top = options.dir or default_dir()
    # before the first run there is no results folder
    entries = rl.find(top) if options.dir or os.path.isdir(top) else []
    if options.removes:
        remove(chosen(entries, options, top), options, top)
        return
    entries = old_enough(entries, options)
    if options.json:
        print(as_json(entries, top))
    elif entries:
        print(table(entries, top))
    else:
        print("there are no runs in %s%s." % (top, "" if options.older_than is None else
                                              " that old"))


def main(arguments):
    return run_program("runs", run, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
