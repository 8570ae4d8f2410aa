"""Whether machines reach each other, for check_machines.py and check_agent.py."""
import os
import socket
import subprocess
import time
import urllib.parse
import xmlrpc.client

import rosgraph.network

from pmeta_files import PlotError as ReachError

# seconds for an answer; an unreachable machine is to be named within 10 s
PATIENCE = 5
FIREWALL = "a firewall closes its ports, of which ROS takes any above 1024"


def is_loopback(host):
    return host == "localhost" or host.startswith("127.")


def is_here(host):
    return is_loopback(host) or host in rosgraph.network.get_local_addresses() + [
        rosgraph.network.get_host_name()]


def host_of(uri):
    return urllib.parse.urlsplit(uri).hostname or uri


def own_host():
    """What nodes that start here give out as their address."""
    return rosgraph.network.get_host_name()


def address_towards(host):
    """This machine's address on the way to another."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect((host, 9))
            return probe.getsockname()[0]
    except OSError:
        return "ADDRESS"


def require_own_address(other):
    """Throws unless what nodes here give out can be of use on another machine."""
    own = own_host()
    wanted = "type 'export ROS_IP=%s' and launch again" % address_towards(other)
    if is_loopback(own):
        raise ReachError("nodes here give out %s, where %s does not reach them: %s."
                         % (own, other, wanted))
    address = os.environ.get("ROS_IP")
    local = rosgraph.network.get_local_addresses()
    if address and not os.environ.get("ROS_HOSTNAME") and address not in local:
        raise ReachError("ROS_IP is %s, which is no address of this machine, %s: %s."
                         % (address, " or ".join(local), wanted))


def ask(uri, method, *arguments):
    """The answer of a master or node; None if there is none, or none that is good."""
    socket.setdefaulttimeout(PATIENCE)
    try:
        code, _, value = getattr(xmlrpc.client.ServerProxy(uri), method)("/check", *arguments)
    except (OSError, xmlrpc.client.Error, ValueError):
        return None
    finally:
        socket.setdefaulttimeout(None)
    return value if code == 1 else None


def connect(host, port):
    """A connection; throws OSError."""
    return socket.create_connection((host, port), timeout=PATIENCE)


def lines_of(text):
    """Of another program's errors, in one line."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return " ".join(line[len("pmeta: "):] if line.startswith("pmeta: ") else line for line in lines)


def wait_until(condition, seconds):
    limit = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > limit:
            return False
        time.sleep(0.05)
    return True


def compare(program, origin, settings, places):
    """Throws unless this machine may take part in a run; passes warnings on."""
    done = subprocess.run([program] + places, input=origin + "\n" + settings,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0:
        raise ReachError(lines_of(done.stderr))
    return done.stderr
