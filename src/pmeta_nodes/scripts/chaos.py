#!/usr/bin/python3
"""Runs an experiment twice, undisturbed and while its nodes are killed and its messages harmed, and
says whether anything was lost: ./pmeta chaos.

With --netns the agents run in a network namespace of their own (as on another machine), and the
link between is slow, loses packets, and goes down and up again; that needs no root but unshare,
iproute2 and, for loss, nftables.
"""
import contextlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import xmlrpc.client

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pmeta_network
from pmeta_files import PlotError as ChaosError
from pmeta_program import Parser, run_program

TOP = pathlib.Path(__file__).resolve().parents[3]
LOCAL = TOP / "devel/lib/pmeta_core/pmeta_local"

# short runs, of which rounds are long enough to be hit
EXPERIMENTS = {
    "gridworld": ["environment.sizes:=[3,4,5,6,7,8,9,10]"],
    "cart_pole": ["preset:=quick", "updates_per_round:=20", "dqn.hidden:=[32,32]",
                  "dqn.buffer_size:=20000"],
}
PACE = 0.3
ROUNDS_PER_KILL = 4
LIMIT = 1200  # seconds for a disturbed run


def call(*command, **kwargs):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, **kwargs)
    if done.returncode != 0:
        raise ChaosError("'%s' failed: %s" % (" ".join(map(str, command)),
                                              (done.stderr or done.stdout).strip()[-500:]))
    return done.stdout


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def rows_of(folder):
    """The lines of rounds.csv below its header, without the wall time."""
    file = folder / "rounds.csv"
    if not file.exists():
        return []
    return [line.rsplit(",", 1)[0] for line in file.read_text().splitlines()[1:]]


class Progress:
    """What is going on, in one line that is written over on a terminal."""

    def __init__(self):
        self.terminal = sys.stdout.isatty()
        self.last = 0

    def show(self, text):
        now = time.monotonic()
        if now - self.last < (0.2 if self.terminal else 10):
            return
        self.last = now
        print("\r\033[K" + text if self.terminal else text, end="" if self.terminal else "\n",
              flush=True)

    def clear(self):
        if self.terminal:
            print("\r\033[K", end="", flush=True)


class Nodes:
    """The nodes of a run, asked for by name."""

    def __init__(self, uri):
        self.master = xmlrpc.client.ServerProxy(uri)

    def pid(self, name):
        """The node's process, or None while it does not answer."""
        socket.setdefaulttimeout(2)
        try:
            code, _, uri = self.master.lookupNode("/chaos", name)
            if code != 1:
                return None
            code, _, pid = xmlrpc.client.ServerProxy(uri).getPid("/chaos")
            return pid if code == 1 else None
        except (OSError, xmlrpc.client.Error):
            return None


class Launch:
    """A roslaunch of our own with a master of our own."""

    def __init__(self, command, log, env, prefix=()):
        self.log = open(str(log), "w")
        self.process = subprocess.Popen([*prefix, *map(str, command)], stdout=self.log,
                                        stderr=subprocess.STDOUT, env=env, preexec_fn=os.setsid)

    def running(self):
        return self.process.poll() is None

    def stop(self):
        if self.running():
            self.process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(timeout=30)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.log.close()


def status_of(folder):
    with contextlib.suppress(OSError, ValueError):
        return json.loads((folder / "manifest.json").read_text()).get("status", "")
    return ""


def check_rounds(rows, rounds, reference):
    """(rounds that are there, are all there just once, bytes of the reference that are missing)"""
    keys = [tuple(row.split(",")[:5]) for row in rows]
    present = {int(key[0]) for key in keys}
    once = len(keys) == len(set(keys)) and present == set(range(1, rounds + 1))
    have = set(rows)
    lost = sum(len(row) + 1 for row in reference if row not in have)
    return len(present), once, lost


class Run:
    """One disturbed run beside its undisturbed twin."""

    def __init__(self, experiment, options, work):
        self.experiment = experiment
        self.options = options
        self.work = work / experiment
        self.work.mkdir()
        self.random = random.Random("%d %s" % (options.seed, experiment))
        self.rounds = options.rounds or max(20, ROUNDS_PER_KILL * options.kills)
        self.tasks = 0
        self.settings = EXPERIMENTS[experiment] + [
            "seed:=%d" % options.seed, "rounds:=%d" % self.rounds, "checkpoint.interval:=1",
            "run_id:=chaos"]
        self.folder = self.work / "disturbed" / experiment / "chaos"
        self.progress = Progress()
        self.kills = {"agent": 0, "aggregator": 0}
        self.downs = 0
        self.deadline = 0

    def reference(self):
        call(LOCAL, "run", TOP / "config" / (self.experiment + ".yaml"), *self.settings,
             "results_dir:=%s" % (self.work / "undisturbed"))
        folder = self.work / "undisturbed" / self.experiment / "chaos"
        self.tasks = len(json.loads((folder / "manifest.json").read_text())["tasks"])
        return rows_of(folder)

    def launch_arguments(self):
        return self.settings + ["pace:=%g" % PACE, "results_dir:=%s" % (self.work / "disturbed"),
                                "key_file:=%s" % (self.work.parent / "key")]

    def environment(self, address, port):
        env = dict(os.environ, ROS_MASTER_URI="http://%s:%d" % (address, port), ROS_IP=address,
                   ROS_HOME=str(self.work / "ros"))
        env.pop("ROS_HOSTNAME", None)
        return env

    def note(self):
        rows = rows_of(self.folder)
        done = rows[-1].split(",")[0] if rows else "0"
        harm = ("link down %d times" % self.downs if self.options.netns else
                "%d of %d kills" % (sum(self.kills.values()), self.options.kills))
        self.progress.show("%s: round %s of %d, %s" % (self.experiment, done, self.rounds, harm))
        if time.monotonic() > self.deadline:
            raise ChaosError("%s is not done after %d s; see %s." % (self.experiment, LIMIT,
                                                                     self.work))

    def wait(self, seconds, launch):
        end = time.monotonic() + seconds
        while time.monotonic() < end and launch.running():
            self.note()
            time.sleep(0.05)

    def kill_nodes(self, launch, nodes):
        """Kills one of the nodes at a time, again and again; it comes back by itself."""
        agents = ["/pmeta/task_agent_%d" % task for task in range(self.tasks)]
        self.wait(3, launch)
        while sum(self.kills.values()) < self.options.kills and launch.running():
            name = self.random.choice(agents + ["/pmeta/meta_aggregator"] * 2)
            pid = nodes.pid(name)
            if pid is None:
                self.wait(0.2, launch)
                continue
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                self.kills["agent" if name in agents else "aggregator"] += 1
            self.wait(self.random.uniform(0.1, 1.5), launch)

    def local(self):
        port = free_port()
        env = self.environment("127.0.0.1", port)
        relay_log = self.work / "relay.json"
        launch = Launch(["roslaunch", "-p", port, "pmeta_nodes", self.experiment + ".launch",
                         "uplink:=_sent"] + self.launch_arguments(), self.work / "launch.log", env)
        with open(str(relay_log), "w") as out:
            relay = subprocess.Popen(
                [sys.executable, str(pathlib.Path(__file__).with_name("chaos_relay.py")),
                 "--seed", str(self.options.seed), "--delay", str(self.options.delay),
                 "--corrupt", str(self.options.corrupt), "--drop", str(self.options.drop)],
                stdout=out, stderr=subprocess.STDOUT, env=env)
        try:
            self.kill_nodes(launch, Nodes(env["ROS_MASTER_URI"]))
            while launch.running():
                self.wait(1, launch)
        finally:
            relay.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                relay.wait(timeout=10)
            relay.kill()
            launch.stop()
        match = re.search(r"^\{.*\}$", relay_log.read_text(), re.M)
        return json.loads(match.group()) if match else {}

    def agents_launch(self):
        """One launch file for all agents, as they are launched on a machine of their own."""
        agents = ["""  <include file="$(find pmeta_nodes)/launch/agent.launch">
    <arg name="task" value="%d"/>
    <arg name="check" value="%s"/>
  </include>
""" % (task, "true" if task == 0 else "false") for task in range(self.tasks)]
        file = self.work / "agents.launch"
        file.write_text("<launch>\n%s</launch>\n" % "".join(agents))
        return file

    def over_link(self):
        """Aggregator here, agents beyond a link that is slow, loses packets, and goes down and up."""
        port = free_port()
        options = self.options
        with pmeta_network.Network(options.latency, options.loss) as network:
            here = self.environment(pmeta_network.HERE, port)
            there = dict(here, ROS_IP=pmeta_network.THERE)
            launches = [Launch(["roslaunch", "-p", port, "pmeta_nodes",
                                self.experiment + ".launch", "agents:=false"] +
                               self.launch_arguments(), self.work / "launch.log", here)]
            try:
                launches += [Launch(["roslaunch", "--wait", self.agents_launch()],
                                    self.work / "agents.log", there, network.there)]
                while not rows_of(self.folder) and launches[0].running():
                    self.wait(0.5, launches[0])
                for _ in range(options.downs):
                    self.wait(self.random.uniform(1, 3), launches[0])
                    network.set_link("down")
                    self.downs += 1
                    self.wait(options.down_seconds or self.random.uniform(1, 4), launches[0])
                    network.set_link("up")
                while launches[0].running():
                    self.wait(1, launches[0])
            finally:
                for launch in reversed(launches):
                    launch.stop()
        return {}

    def report(self):
        """The row of the table."""
        reference = self.reference()
        started = time.monotonic()
        self.deadline = started + LIMIT
        harm = self.over_link() if self.options.netns else self.local()
        self.progress.clear()
        rows = rows_of(self.folder)
        present, once, lost = check_rounds(rows, self.rounds, reference)
        return {
            "experiment": self.experiment,
            "kills": "%d agents, %d aggregator" % (self.kills["agent"], self.kills["aggregator"]),
            "link down": self.downs,
            "late": harm.get("delayed", 0),
            "twice": harm.get("repeated", 0),
            "dropped": harm.get("dropped", 0),
            "corrupted": harm.get("corrupted", 0),
            "rounds": "%d of %d%s" % (present, self.rounds, "" if once else ", NOT once each"),
            "result": "identical" if rows == reference else "DIFFERENT",
            "bytes lost": lost,
            "status": status_of(self.folder) or "none",
            "seconds": "%.0f" % (time.monotonic() - started),
            "good": once and rows == reference and status_of(self.folder) == "finished" and
                    sum(self.kills.values()) >= (0 if self.options.netns else self.options.kills),
        }


def print_table(reports):
    columns = [key for key in reports[0] if key != "good"]
    lines = [columns] + [[str(report[key]) for key in columns] for report in reports]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    for line in lines:
        print("  ".join(word.ljust(width) for word, width in zip(line, widths)).rstrip())


def chaos(arguments):
    parser = Parser(prog="./pmeta chaos", description=__doc__)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT",
                        help="of %s; default: all" % ", ".join(EXPERIMENTS))
    parser.add_argument("--kills", type=int, default=10, help="SIGKILLs in each run (10)")
    parser.add_argument("--seed", type=int, default=0, help="of the run and of the harm (0)")
    parser.add_argument("--delay", type=float, default=0.2, help="most seconds a message is late (0.2)")
    parser.add_argument("--corrupt", type=float, default=0.1,
                        help="share of messages that are followed by an altered copy (0.1)")
    parser.add_argument("--drop", type=float, default=0.02, help="share that never arrives (0.02)")
    parser.add_argument("--netns", action="store_true",
                        help="instead of kills: the agents beyond a link that goes down and up")
    parser.add_argument("--downs", type=int, default=4, help="with --netns: how often (4)")
    parser.add_argument("--down-seconds", type=float, default=0,
                        help="with --netns: for how long; by default 1 to 4 s each")
    parser.add_argument("--latency", type=float, default=0.05,
                        help="with --netns: seconds that a packet takes either way (0.05)")
    parser.add_argument("--loss", type=int, default=5, help="with --netns: percent of packets lost (5)")
    parser.add_argument("--rounds", type=int, default=0,
                        help="of the run; by default %d a kill, at least 20" % ROUNDS_PER_KILL)
    parser.add_argument("--keep", metavar="DIR", help="keep logs and results in DIR")
    options = parser.parse_args(arguments)
    for name in options.experiments:
        if name not in EXPERIMENTS:
            raise ChaosError("unknown experiment '%s': chaos knows %s." % (name,
                                                                          ", ".join(EXPERIMENTS)))
    if options.netns:
        options.kills = 0
        pmeta_network.enter()
    work = pathlib.Path(options.keep) if options.keep else pathlib.Path(tempfile.mkdtemp())
    if options.keep and work.exists():
        raise ChaosError("%s exists already: choose another folder." % work)
    work.mkdir(parents=True, exist_ok=True)
    call(LOCAL, "key", work / "key")
    reports = [Run(name, options, work).report() for name in options.experiments or EXPERIMENTS]
    print_table(reports)
    if not all(report["good"] for report in reports):
        raise ChaosError("something was lost; logs and results are in %s." % work)
    if not options.keep:
        shutil.rmtree(str(work))


if __name__ == "__main__":
    sys.exit(run_program("pmeta", chaos, sys.argv[1:]))
