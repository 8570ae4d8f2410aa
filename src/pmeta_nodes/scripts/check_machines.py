#!/usr/bin/python3
"""check_machines: are a launch file's machines ready for agents? What the launch file of a run with
`machines` runs while it is read.

Logs in as roslaunch will, and has check_agent there look whether both machines reach each other and have
the same version and settings. Exits with 1 and a sentence for each machine that is not ready.
"""
import concurrent.futures
import contextlib
import os
import secrets
import select
import shlex
import socket
import sys
import time
from xml.etree import ElementTree

import yaml

from roslaunch import core, remoteprocess

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from pmeta_program import Parser, run_program
from pmeta_reach import FIREWALL, PATIENCE, ReachError, connect, lines_of, own_host

LOGIN = 8  # seconds
ANSWER = 30  # for what is asked there: a small computer takes a while to start a program


def first_words(link):
    with link:
        link.settimeout(PATIENCE)
        try:
            return link.recv(512).decode(errors="replace").split()
        except OSError:
            return []


class Machine:
    def __init__(self, element, root):
        self.name = element.get("name")
        self.entry = core.Machine(self.name, element.get("address"), element.get("env-loader"),
                                  int(element.get("ssh-port")), element.get("user"))
        # here, since it heeds signals, which only the first thread may
        self.child = remoteprocess.SSHChildROSLaunchProcess("", self.name, "", self.entry)
        node = root.find("node[@machine='%s']" % self.name)
        self.places = [] if node is None else [
            shlex.quote("%s:=%s" % (param.get("name"), param.get("value")))
            for param in node.findall("param") if param.get("name") in ("results_dir", "key_file")]

    def __str__(self):
        return "machine %s (%s)" % (self.name, self.entry.address)

    def is_local(self):
        try:
            return core.is_machine_local(self.entry)
        except core.RLException:
            raise ReachError("%s has a name that cannot be resolved here: write its address." % self)

    def login(self, command):
        """Input, output and errors of a command there, called as roslaunch will call its own."""
        streams, trouble = self.child._ssh_exec(command, self.entry.address, self.entry.ssh_port,
                                                self.entry.user)
        if streams is None:
            raise ReachError("%s cannot be logged in to: %s." % (self, lines_of(trouble).rstrip(".")))
        return streams

    def check(self, asked):
        """Throws ReachError; gives its warnings. `asked`: origin and settings of the run."""
        if self.is_local():
            return ""
        with socket.create_server(("", 0)) as server:
            word = secrets.token_hex(8)
            ssh, to_it, _, errors = self.login(
                "%s rosrun pmeta_nodes check_agent.py --launcher %s:%d:%s %s"
                % (self.entry.env_loader, own_host(), server.getsockname()[1], word, " ".join(self.places)))
            try:
                channel = to_it.channel
                with contextlib.suppress(OSError):  # it has ended: why is told below
                    to_it.write(asked)
                    channel.shutdown_write()
                self.meet(server, word, channel)
                limit = time.monotonic() + ANSWER
                while not channel.exit_status_ready() and time.monotonic() < limit:
                    time.sleep(0.05)
                if not channel.exit_status_ready():
                    raise ReachError("%s does not answer within %d s." % (self, ANSWER))
                said = errors.read().decode(errors="replace")
                if channel.recv_exit_status() != 0:
                    raise ReachError("%s: %s" % (self, lines_of(said) or "check_agent failed there."))
                return said
            finally:
                ssh.close()

    def meet(self, server, word, channel):
        """Waits for check_agent to connect here with the word, and connects there; what it did not like it
        says itself."""
        limit = time.monotonic() + ANSWER
        while not channel.exit_status_ready() and time.monotonic() < limit:
            if not select.select([server], [], [], 0.05)[0]:
                continue
            said = first_words(server.accept()[0])
            if len(said) != 3 or said[0] != word:
                continue  # a stranger
            host, port = said[1:]
            try:
                connect(host, int(port)).close()
            except OSError as error:
                raise ReachError(
                    "%s gives out the address %s, where nodes here do not reach it (%s): see whether, on "
                    "it, %s, or set ROS_IP in its env_loader." % (self, host, error.strerror or error,
                                                                  FIREWALL))
            return


def check_machines(arguments):
    parser = Parser(prog="check_machines.py", description=__doc__)
    parser.add_argument("file", help="launch file that prepare_run has written")
    root = ElementTree.parse(parser.parse_args(arguments).file).getroot()
    asked = "%s\n%s" % (yaml.safe_load(root.find("rosparam[@param='origin']").text),
                        root.find("rosparam[@ns='settings']").text)
    machines = [Machine(element, root) for element in root.findall("machine")]
    # roslaunch would wait longer, and print what it calls where the value of a parameter is to be
    remoteprocess.TIMEOUT_SSH_CONNECT = LOGIN
    remoteprocess.printlog = lambda _: None
    print("checking %s" % ", ".join(map(str, machines)), file=sys.stderr, flush=True)
    with concurrent.futures.ThreadPoolExecutor(len(machines)) as pool:
        looks = [pool.submit(machine.check, asked) for machine in machines]
    troubles = [str(look.exception()) for look in looks if isinstance(look.exception(), ReachError)]
    for look in looks:
        if look.exception() is None:
            sys.stderr.write(look.result())
    if troubles:
        raise ReachError("\npmeta: ".join(troubles))
    for look in looks:
        look.result()
    print(", ".join(machine.name for machine in machines))


if __name__ == "__main__":
    sys.exit(run_program("pmeta", check_machines, sys.argv[1:]))
