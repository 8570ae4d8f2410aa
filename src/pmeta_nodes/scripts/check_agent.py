#!/usr/bin/python3
"""check_agent: may agents start here? What agent.launch runs while it is read, and over ssh check_machines.

Checks that this machine and the one of the run reach each other, both ways, and that they have the same
version and settings. Prints this machine's name; exits with 1 and one sentence if something is wrong.
"""
import os
import signal
import socket
import sys
import time

import roslib.packages
import rosgraph
import rospy

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from pmeta_program import Parser, run_program
from pmeta_reach import (FIREWALL, PATIENCE, ReachError, address_towards, ask, compare, connect, host_of,
                         is_here, is_loopback, own_host, require_own_address, wait_until)
from pmeta_msgs.msg import AgentStatus, RoundSummary


def program(name):
    found = roslib.packages.find_node("pmeta_nodes", name)
    if not found:
        raise ReachError("pMeta is not built here: there is no %s." % name)
    return found[0]


class Run:
    """The run on the ROS master, or a sentence about why there is none."""

    def __init__(self, namespace):
        self.master = rosgraph.get_master_uri()
        self.namespace = namespace
        self.aggregator = namespace + "/meta_aggregator"
        host = host_of(self.master)
        if ask(self.master, "getPid") is None:
            raise ReachError(
                "there is no answer from the ROS master at %s: %s." % (self.master, (
                    "that is this machine; type 'export ROS_MASTER_URI=http://ADDRESS:11311' with "
                    "the address of the one that has the run" if is_here(host) else
                    "launch the run there after 'export ROS_IP=%s', set ROS_MASTER_URI to where it is, "
                    "or see whether, there, %s" % (host, FIREWALL))))
        self.uri = ask(self.master, "lookupNode", self.aggregator)
        self.settings = ask(self.master, "getParam", namespace + "/config")
        self.origin = ask(self.master, "getParam", namespace + "/origin")
        if self.uri and self.settings and not self.origin:
            raise ReachError("the run on the ROS master at %s was launched by a version of pMeta that does "
                             "not say which: install the same one on both." % self.master)
        if not (self.uri and self.settings):
            raise ReachError("there is no run below %s on the ROS master at %s: launch it first with "
                             "agents:=false (and give its ns), or wait for it with roslaunch --wait."
                             % (namespace, self.master))
        self.require_answer(host)

    def require_answer(self, master_host):
        host = host_of(self.uri)
        if is_loopback(host) and not is_here(master_host):
            raise ReachError(
                "the run on %s gives out the address %s, where only that machine reaches it: launch it "
                "again there after 'export ROS_IP=%s'." % (master_host, host, master_host))
        if ask(self.uri, "getPid") is None:
            raise ReachError(
                "the run's aggregator does not answer at %s: launch it after 'export ROS_IP=ADDRESS' "
                "with one that this machine reaches, or see whether %s." % (self.uri, FIREWALL))

    def require_both_ways(self):
        """By what agents do: the aggregator hears one here, and is heard."""
        rospy.init_node("check_agent", anonymous=True, disable_signals=True, log_level=rospy.FATAL)
        status = rospy.Publisher(self.namespace + "/agent_status", AgentStatus, queue_size=1)
        news = rospy.Subscriber(self.namespace + "/round", RoundSummary)
        try:
            heard = wait_until(lambda: any(link[1] == self.aggregator
                                           for link in status.impl.get_stats_info()), PATIENCE)
            if not heard:
                host = host_of(self.uri)
                raise ReachError(
                    "%s cannot connect to nodes here, which give out the address %s: type 'export "
                    "ROS_IP=%s' and launch again, or see whether, on this machine, %s."
                    % (host, own_host(), address_towards(host), FIREWALL))
            if not wait_until(lambda: news.get_num_connections() > 0, PATIENCE):
                raise ReachError("nodes here cannot connect to the run's data at %s: see whether, there, "
                                 "%s." % (host_of(self.uri), FIREWALL))
        finally:
            rospy.signal_shutdown("checked")


def waits():
    """Was roslaunch, which has started this, told to wait for its master?"""
    try:
        with open("/proc/%d/cmdline" % os.getppid(), "rb") as file:
            return b"--wait" in file.read().split(b"\0")
    except OSError:
        return False


def find_run(namespace):
    told = ""
    while True:
        try:
            return Run(namespace)
        except ReachError as trouble:
            if not waits():
                raise
            if str(trouble) != told:
                told = str(trouble)
                print("pmeta: waiting for the run; now %s" % told, file=sys.stderr, flush=True)
            time.sleep(1)


def answer_launcher(launcher):
    """Lets check_machines on the launching machine connect here, after connecting there."""
    host, port, word = launcher.rsplit(":", 2)
    require_own_address(host)
    try:
        link = connect(host, int(port))
    except OSError as error:
        raise ReachError("%s, which launches the run, cannot be reached from there (%s): set ROS_IP on it "
                         "to an address that this machine reaches, or see whether, on it, %s."
                         % (host, error.strerror or error, FIREWALL))
    with link, socket.create_server(("", 0)) as server:
        link.sendall(("%s %s %d" % (word, own_host(), server.getsockname()[1])).encode())
        server.settimeout(2 * PATIENCE)
        try:
            server.accept()[0].close()
        except OSError:
            raise ReachError("%s cannot connect to it at %s: see whether, on it, %s."
                             % (host, own_host(), FIREWALL))


def check_agent(arguments):
    parser = Parser(prog="check_agent.py", description=__doc__)
    parser.add_argument("--namespace", default="pmeta", help="of the run (pmeta)")
    parser.add_argument("--launcher", metavar="HOST:PORT:WORD",
                        help="where check_machines waits, and for which word, with the run's origin and "
                             "settings on standard input; without it both are those of the run on the "
                             "ROS master")
    parser.add_argument("places", nargs="*", metavar="key:=value",
                        help="results_dir and key_file here, where they are not those of the run")
    options = parser.parse_args(arguments)
    places = [word for word in options.places if not word.endswith(":=")]
    if options.launcher:
        origin, settings = sys.stdin.read().split("\n", 1)
        answer_launcher(options.launcher)
        sys.stderr.write(compare(program("compare_run"), origin, settings, places))
    else:
        run = find_run(rosgraph.names.resolve_name(options.namespace, rosgraph.names.get_ros_namespace()))
        if not is_here(host_of(run.master)):
            require_own_address(host_of(run.master))
        sys.stderr.write(compare(program("compare_run"), run.origin, run.settings, places))
        run.require_both_ways()
    print(socket.gethostname())


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while it waits needs no words
    sys.exit(run_program("pmeta", check_agent, sys.argv[1:]))
