#!/usr/bin/python3
"""What watching a run costs its agents: pairs of runs of cart_pole, with rviz and without, first one
and then the other first. rviz draws on a screen in memory (Xvfb).

The measures are the user CPU time of the task agents' processes, which what else runs on the machine
changes less, and the wall time from their start to the last round. Beside them stands the CPU time
of rviz and the viewer, which run at idle priority: what it got for drawing while the agents trained.
"""

import glob
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

LIMIT = 1800  # seconds of a run
TICKS = os.sysconf("SC_CLK_TCK")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def stat_of(pid):
    """(name, fields from the state on) of /proc/PID/stat; None if the process is gone."""
    try:
        with open("/proc/%s/stat" % pid) as file:
            text = file.read()
    except OSError:
        return None
    return text[text.index("(") + 1:text.rindex(")")], text[text.rindex(")") + 2:].split()


def cpu_of(launch, names):
    """User CPU seconds of each process with one of the names whose parent is the launch."""
    stats = (stat_of(os.path.basename(path)) for path in glob.glob("/proc/[0-9]*"))
    return [int(stat[1][11]) / TICKS for stat in stats
            if stat and stat[0] in names and int(stat[1][1]) == launch]


def finished(folder):
    for path in glob.glob(os.path.join(folder, "*", "*", "manifest.json")):
        with open(path) as file:
            return '"status": "finished"' in file.read()
    return False


def run(with_rviz, display, settings):
    """(user CPU seconds of all agents, wall seconds, user CPU seconds of rviz and the viewer)"""
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, DISPLAY=display, ROS_HOME=folder, XDG_RUNTIME_DIR=folder,
                           ROS_MASTER_URI="http://127.0.0.1:%d" % free_port(),
                           LIBGL_ALWAYS_SOFTWARE="1", QT_X11_NO_MITSHM="1")
        watched = "true" if with_rviz else "false"
        with open(os.path.join(folder, "launch.log"), "w") as log:
            launch = subprocess.Popen(
                ["roslaunch", "pmeta_nodes", "cart_pole.launch", "hold:=true", "rviz:=" + watched,
                 "results_dir:=" + folder] + settings,
                env=environment, stdout=log, stderr=log)
        try:
            limit, start = time.monotonic() + LIMIT, None
            while not finished(folder):
                if launch.poll() is not None or time.monotonic() > limit:
                    with open(os.path.join(folder, "launch.log")) as log:
                        sys.exit("rviz_overhead: the run has not finished:\n" + log.read()[-2000:])
                if start is None and cpu_of(launch.pid, ["task_agent"]):
                    start = time.monotonic()
                time.sleep(0.05)
            wall = time.monotonic() - start
            return (sum(cpu_of(launch.pid, ["task_agent"])), wall,
                    sum(cpu_of(launch.pid, ["rviz", "trajectory_view"])))
        finally:
            launch.send_signal(signal.SIGINT)
            launch.wait()


def main(arguments):
    pairs = int(arguments[0]) if arguments else 5
    settings = arguments[1:]
    read, write = os.pipe()
    screen = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1640x800x24",
                               "+extension", "GLX", "-nolisten", "tcp"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as number:
        display = ":" + number.readline().strip()
    try:
        print("agents' user CPU and wall time in s; load %.1f" % os.getloadavg()[0])
        print("pair   CPU without     with    ratio    wall without     with    ratio    rviz's CPU")
        ratios = []
        for pair in range(pairs):
            order = (False, True) if pair % 2 == 0 else (True, False)
            results = {watched: run(watched, display, settings) for watched in order}
            (cpu, wall, _), (cpu_rviz, wall_rviz, drawing) = results[False], results[True]
            ratios.append((cpu_rviz / cpu, wall_rviz / wall))
            print("%4d %13.2f %8.2f %8.3f %15.1f %8.1f %8.3f %13.2f"
                  % (pair + 1, cpu, cpu_rviz, ratios[-1][0], wall, wall_rviz, ratios[-1][1], drawing),
                  flush=True)
        medians = [statistics.median(column) for column in zip(*ratios)]
        print("median of ratios: CPU %.3f, wall %.3f" % tuple(medians))
    finally:
        screen.terminate()
        screen.wait()


if __name__ == "__main__":
    main(sys.argv[1:])
