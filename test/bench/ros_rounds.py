#!/usr/bin/python3
"""What rounds cost over ROS beside the training in them: half_cheetah_dir, preset inference, for each
number of updates a round and each size of the hidden layers. A case runs until its time is over,
without evaluations and checkpoints, and is stopped.

Wall time of the rounds and the training in them are of the same rounds of the same run: a round's
training is that of the agent that trained longest, as the agents give it (AgentStatus.train_s).
Page faults, system time, memory and bytes are the kernel's and ROS's own counts, of the agents that
train. This program listens at idle priority.
"""

import argparse
import os
import queue
import signal
import subprocess
import sys
import tempfile
import time
import xmlrpc.client

from rviz_overhead import TICKS, free_port, stat_of

SETTLE = 5  # seconds from the first round on that do not count
PATIENCE = 600  # seconds that a round may take
MANY = 1000000  # rounds: more than anybody waits for
NAME = "/ros_rounds"
LEGEND = """over ROS, %d cores, load %.1f. A round: the longest training in it, and how long it took in all; minor
page faults of an agent; bytes of models sent; CPU time of the aggregator. An agent: system time as a
share of its CPU time; its largest resident memory, and that at the end."""
HEADER = ("updates  parameters  rounds  training s  round s  ratio  faults  sent kB  aggregator ms"
          "  system %  most MB  end MB")


def options(arguments):
    parser = argparse.ArgumentParser(prog="./pmeta bench --ros", description=__doc__,
                                     usage="%(prog)s [OPTION ...] [key=value ...]",
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--experiment", default="half_cheetah_dir", help="(half_cheetah_dir)")
    parser.add_argument("--preset", default="inference", help="(inference)")
    parser.add_argument("--seconds", type=float, default=30, help="of each case (30)")
    parser.add_argument("--updates", type=int, nargs="+", default=[20, 100, 400],
                        help="R, updates a round (20 100 400)")
    parser.add_argument("--hidden", type=int, nargs="+", default=[128, 560],
                        help="units of each of the two hidden layers (128 560)")
    # by their look: behind --hidden 128 they would be taken for a number
    settings = [word for word in arguments if "=" in word and not word.startswith("-")]
    chosen = parser.parse_args([word for word in arguments if word not in settings])
    chosen.settings = settings
    return chosen


class Node:
    """A node of the run, by its XML-RPC interface and its process."""

    def __init__(self, master, name):
        self.api = xmlrpc.client.ServerProxy(master.lookupNode(NAME, name)[2])
        self.pid = self.api.getPid(NAME)[2]

    def counts(self):
        """(minor faults, user seconds, system seconds, bytes of models sent) so far"""
        stat = stat_of(self.pid)
        if stat is None:
            sys.exit("ros_rounds: a node has died.")
        publications = self.api.getBusStats(NAME)[0]
        sent = sum(connection[1] for topic, connections in publications
                   if topic in ("/pmeta/meta_policy", "/pmeta/auxiliary")
                   for connection in connections)
        fields = stat[1]
        return [int(fields[7]), int(fields[11]) / TICKS, int(fields[12]) / TICKS, sent]

    def memory(self):
        """(largest, present) resident memory in MB"""
        with open("/proc/%d/status" % self.pid) as file:
            values = dict(line.split(":", 1) for line in file)
        return [int(values[key].split()[0]) / 1e3 for key in ("VmHWM", "VmRSS")]


class Listener:
    """When rounds were complete, and how long each agent trained in each."""

    def __init__(self):
        import rospy
        from pmeta_msgs.msg import AgentStatus, RoundSummary
        self.run_id = None
        self.rounds = queue.Queue()  # (round, when it was complete)
        self.training = {}           # (round, task): seconds
        self.waiting = AgentStatus.WAITING
        rospy.Subscriber("/pmeta/agent_status", AgentStatus, self.on_status, queue_size=None)
        rospy.Subscriber("/pmeta/round", RoundSummary, self.on_round, queue_size=None)

    def begin(self, run_id):
        self.training = {}
        self.rounds = queue.Queue()
        self.run_id = run_id

    def on_status(self, msg):
        if msg.run_id == self.run_id and msg.state == self.waiting and msg.round > 0:
            self.training[msg.round, msg.task] = msg.train_s

    def on_round(self, msg):
        if msg.run_id == self.run_id and msg.round > 0:
            self.rounds.put((msg.round, msg.header.stamp.to_sec()))


def counts_of(nodes):
    return [node.counts() for node in nodes]


def measure(listener, seconds):
    """Of a run that has just been launched: the rounds between two moments, their wall time, the
    longest training of each, the parameters, what agents and aggregator counted meanwhile, and the
    memory of the agent with most."""
    import rospy
    from pmeta_msgs.msg import MetaPolicy
    listener.rounds.get(timeout=PATIENCE)
    master = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])
    publishers = dict(master.getSystemState(NAME)[2][0])
    tasks = {task for _, task in list(listener.training)}  # of agents that train, not those of test tasks
    agents = [Node(master, "/pmeta/task_agent_%d" % task) for task in tasks]
    nodes = agents + [Node(master, publishers["/pmeta/meta_policy"][0])]
    model = rospy.wait_for_message("/pmeta/meta_policy", MetaPolicy, PATIENCE).model
    time.sleep(SETTLE)
    while not listener.rounds.empty():
        listener.rounds.get()
    first, start = listener.rounds.get(timeout=PATIENCE)
    before = counts_of(nodes)
    last, end = first, start
    while end - start < seconds:
        last, end = listener.rounds.get(timeout=PATIENCE)
    after = counts_of(nodes)
    memory = max(agent.memory() for agent in agents)
    time.sleep(0.5)  # the last round's times of training are on their way
    longest = [max(listener.training[number, task] for task in tasks)
               for number in range(first + 1, last + 1)]
    counted = [[b - a for a, b in zip(*pair)] for pair in zip(before, after)]
    return longest, end - start, len(model.float32_values), counted, memory


def run(listener, updates, hidden, chosen):
    """Launches one case and measures it; returns its line of the table."""
    with tempfile.TemporaryDirectory() as folder:
        run_id = "r%d_h%d" % (updates, hidden)
        listener.begin(run_id)
        settings = dict({"updates_per_round": updates, "sac.hidden": "[%d,%d]" % (hidden, hidden),
                         "evaluation_interval": MANY, "checkpoint.interval": 0},
                        **dict(setting.split("=", 1) for setting in chosen.settings))
        command = ["chrt", "--other", "0", "roslaunch", "pmeta_nodes", chosen.experiment + ".launch",
                   "preset:=" + chosen.preset, "rounds:=%d" % MANY, "results_dir:=" + folder,
                   "run_id:=" + run_id,
                   "settings:=" + " ".join("%s=%s" % setting for setting in settings.items())]
        log_file = os.path.join(folder, "launch.log")
        with open(log_file, "w") as log:
            launch = subprocess.Popen(command, stdout=log, stderr=log,
                                      env=dict(os.environ, ROS_HOME=folder))
        try:
            longest, wall, parameters, counted, memory = measure(listener, chosen.seconds)
        except queue.Empty:
            with open(log_file) as log:
                sys.exit("ros_rounds: the rounds have stopped coming:\n" + log.read()[-2000:])
        finally:
            launch.send_signal(signal.SIGINT)
            launch.wait()
    rounds, agents = len(longest), counted[:-1]
    faults, user, system, sent = (sum(column) for column in zip(*agents))
    aggregator = counted[-1]
    return ("%7d %11d %7d %11.4f %8.4f %6.3f %7.0f %8.0f %14.2f %9.1f %8.0f %7.0f"
            % (updates, parameters, rounds, sum(longest) / rounds, wall / rounds,
               wall / sum(longest), faults / rounds / len(agents),
               (sent + aggregator[3]) / rounds / 1e3,
               1e3 * (aggregator[1] + aggregator[2]) / rounds,
               100 * system / (user + system), *memory))


def main(arguments):
    chosen = options(arguments)
    os.environ["ROS_MASTER_URI"] = "http://127.0.0.1:%d" % free_port()
    os.environ.setdefault("ROS_IP", "127.0.0.1")
    import rospy
    with tempfile.TemporaryDirectory() as folder:
        os.environ["ROS_LOG_DIR"] = folder
        port = os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]
        master = subprocess.Popen(["roscore", "-p", port], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL)
        try:
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
            rospy.init_node(NAME[1:], disable_signals=True)
            listener = Listener()
            print(LEGEND % (os.cpu_count(), os.getloadavg()[0]))
            print(HEADER, flush=True)
            for hidden in chosen.hidden:
                for updates in chosen.updates:
                    print(run(listener, updates, hidden, chosen), flush=True)
        finally:
            master.send_signal(signal.SIGINT)
            master.wait()


if __name__ == "__main__":
    main(sys.argv[1:])
