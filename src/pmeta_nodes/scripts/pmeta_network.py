"""Another machine for ./pmeta chaos, as a network namespace, and a bad link to it.

    here --- a relay that holds each packet back for a while --- there

Not every kernel can delay packets, so a process does, from a namespace in the middle: this file, run as
a program. Nothing of it needs root where users may have namespaces of their own.
"""
import array
import contextlib
import fcntl
import heapq
import os
import select
import shutil
import socket
import struct
import subprocess
import sys
import time

from pmeta_files import PlotError as ChaosError

HERE, THERE = "10.77.0.1", "10.77.0.2"
ENTERED = "PMETA_CHAOS_NETWORK"  # set in the namespace that the program goes on in
PROGRAMS = {"unshare": "util-linux", "nsenter": "util-linux", "ip": "iproute2", "nft": "nftables"}
# of linux/sockios.h and linux/ethtool.h: checksums and segments are left to a device that has none
SIOCETHTOOL = 0x8946
OFFLOADS = {"checksums": 0x17, "TCP segments": 0x1f, "segments": 0x24}


def problem():
    """Why there can be no such network here, in a sentence; "" if there can."""
    for program, package in PROGRAMS.items():
        if shutil.which(program) is None:
            return "a network of namespaces needs the program %s (Debian: %s)." % (program, package)
    tried = subprocess.run(["unshare", "--map-root-user", "--net", "true"], stderr=subprocess.PIPE,
                           universal_newlines=True)
    if tried.returncode != 0:
        return "users may not make network namespaces here (%s)." % tried.stderr.strip()
    return ""


def enter():
    """Goes on in a network namespace of its own, from the start of the program."""
    if ENTERED in os.environ:
        return
    trouble = problem()
    if trouble:
        raise ChaosError(trouble)
    sys.stdout.flush()
    os.execvpe("unshare", ["unshare", "--map-root-user", "--net", sys.executable] + sys.argv,
               dict(os.environ, **{ENTERED: "1"}))


def call(*command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True)
    if done.returncode != 0:
        raise ChaosError("'%s' failed: %s" % (" ".join(map(str, command)), done.stdout.strip()))


def complete_packets(device):
    """Has the device hand on packets as they go over a wire."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for command in OFFLOADS.values():
            value = array.array("B", struct.pack("II", command, 0))
            fcntl.ioctl(sock, SIOCETHTOOL,
                        struct.pack("16sP", device.encode(), value.buffer_info()[0]))


class Network:
    """The link and what is beyond it, while it is a context; made in a namespace of its own."""

    def __init__(self, latency, loss):
        self.latency = latency
        self.loss = loss
        self.stack = contextlib.ExitStack()
        self.there = []  # what a command there begins with

    def namespace(self):
        """What a command in a new namespace begins with, which ends with this program."""
        keeper = subprocess.Popen(["unshare", "--net", "sh", "-c", "echo; exec cat"],
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.stack.callback(keeper.wait)
        self.stack.callback(keeper.stdin.close)
        keeper.stdout.readline()
        return keeper.pid, ["nsenter", "--target", str(keeper.pid), "--net"]

    def __enter__(self):
        between_pid, between = self.namespace()
        there_pid, self.there = self.namespace()
        call("ip", "link", "set", "lo", "up")
        for end, relay in (("pmeta_here", "relay_here"), ("pmeta_there", "relay_there")):
            call("ip", "link", "add", end, "type", "veth", "peer", "name", relay)
            self.stack.callback(call, *between, "ip", "link", "del", relay)
            complete_packets(end)
            call("ip", "link", "set", relay, "netns", between_pid)
            call(*between, "ip", "link", "set", relay, "up")
        call("ip", "link", "set", "pmeta_there", "netns", there_pid)
        call(*self.there, "ip", "link", "set", "lo", "up")
        for prefix, end, address in (([], "pmeta_here", HERE), (self.there, "pmeta_there", THERE)):
            call(*prefix, "ip", "address", "add", address + "/24", "dev", end)
            call(*prefix, "ip", "link", "set", end, "up")
            if self.loss:
                call(*prefix, "nft", "add table inet pmeta; "
                     "add chain inet pmeta input { type filter hook input priority 0; }; "
                     "add rule inet pmeta input iifname %s numgen random mod 100 < %d drop"
                     % (end, self.loss))
        relay = subprocess.Popen(between + [sys.executable, os.path.abspath(__file__), str(self.latency)])
        self.stack.callback(relay.wait)
        self.stack.callback(relay.terminate)
        return self

    def __exit__(self, *_):
        self.stack.close()

    def set_link(self, state):
        """Takes the link "down" or "up"."""
        call(*self.there, "ip", "link", "set", "pmeta_there", state)


def relay(latency):
    """Passes packets on between two devices, each so many seconds after it came."""
    ends = []
    for device in ("relay_here", "relay_there"):
        ends.append(socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3)))
        ends[-1].bind((device, 0))
    held = []
    for number in range(1 << 62):
        wait = max(0, held[0][0] - time.monotonic()) if held else None
        for end in select.select(ends, [], [], wait)[0]:
            packet, address = end.recvfrom(1 << 16)
            if address[2] != socket.PACKET_OUTGOING:
                heapq.heappush(held, (time.monotonic() + latency, number, 1 - ends.index(end), packet))
        while held and held[0][0] <= time.monotonic():
            _, _, to, packet = heapq.heappop(held)
            with contextlib.suppress(OSError):  # the link is down
                ends[to].send(packet)


if __name__ == "__main__":
    relay(float(sys.argv[1]))
