#!/usr/bin/env python3
"""A bad network between the agents and the aggregator, for ./pmeta chaos.

Passes on what agents send to auxiliary_sent and returns_sent, late, out of order, twice, or not at
all, and slips in altered copies. Counts what it did on standard output when it ends.
"""
import argparse
import copy
import json
import random
import signal
import sys
import threading
import zlib

import numpy
import rospy
from pmeta_msgs.msg import AuxiliaryUpdate, TaskReturn


def blob_bytes(model):
    return (numpy.asarray(model.float32_values, "<f4").tobytes() +
            numpy.asarray(model.float64_values, "<f8").tobytes() + bytes(model.present))


def with_value(model, value):
    """Changes one value of a model's blob and sets the checksum right again."""
    field = "float32_values" if model.float32_values else "float64_values"
    values = list(getattr(model, field))
    values[len(values) // 2] = value
    setattr(model, field, values)
    model.checksum = zlib.crc32(blob_bytes(model)) & 0xffffffff


def flip_bit(msg):
    field = "float32_values" if msg.model.float32_values else "float64_values"
    values = list(getattr(msg.model, field))
    values[0] = values[0] + 1
    setattr(msg.model, field, values)


def cut_off(msg):
    msg.model.float32_values = msg.model.float32_values[:-1]
    msg.model.float64_values = msg.model.float64_values[:-1]


def set_field(name, value):
    return lambda msg: setattr(msg, name, value)


# what may be done to a copy; each must be refused, dropped or counted, and never averaged or booked
CORRUPTIONS = {
    AuxiliaryUpdate: [flip_bit, cut_off, lambda msg: with_value(msg.model, float("nan")),
                      lambda msg: with_value(msg.model, float("inf")),
                      lambda msg: setattr(msg.model, "layout", "float32\nother 3\n"),
                      set_field("run_id", "another"), set_field("task", 4000000),
                      set_field("round", 0), set_field("round", 4000000),
                      set_field("weight", -1.0)],
    TaskReturn: [set_field("run_id", "another"), set_field("task", 4000000),
                 set_field("round", 4000000), set_field("policy", 9)],
}


class Relay:
    def __init__(self, topic, kind, options):
        self.options = options
        self.random = random.Random("%d %s" % (options.seed, topic))
        self.kind = kind
        self.counts = {"passed": 0, "delayed": 0, "repeated": 0, "dropped": 0, "corrupted": 0}
        self.lock = threading.Lock()
        self.publisher = rospy.Publisher(topic, kind, queue_size=100)
        rospy.Subscriber(topic + "_sent", kind, self.take, queue_size=100, tcp_nodelay=True)

    def take(self, msg):
        with self.lock:
            draw = self.random.random
            if draw() < self.options.corrupt:
                bad = copy.deepcopy(msg)
                self.random.choice(CORRUPTIONS[self.kind])(bad)
                self.counts["corrupted"] += 1
                self.publish(bad, 0)
            if draw() < self.options.drop:
                self.counts["dropped"] += 1
                return
            copies = 2 if draw() < self.options.repeat else 1
            self.counts["repeated"] += copies - 1
            self.counts["passed"] += 1
            for _ in range(copies):
                seconds = draw() * self.options.delay
                self.counts["delayed"] += seconds > 0
                self.publish(msg, seconds)

    def publish(self, msg, seconds):
        timer = threading.Timer(seconds, self.publisher.publish, [msg])
        timer.daemon = True
        timer.start()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--delay", type=float, default=0.2, help="most seconds a message is late")
    parser.add_argument("--corrupt", type=float, default=0.1, help="share that is followed by an altered copy")
    parser.add_argument("--drop", type=float, default=0.05, help="share that never arrives")
    parser.add_argument("--repeat", type=float, default=0.1, help="share that arrives twice")
    options = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node("chaos_relay", disable_signals=True)
    relays = [Relay("/pmeta/auxiliary", AuxiliaryUpdate, options),
              Relay("/pmeta/returns", TaskReturn, options)]
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    stop.wait()
    total = {key: sum(relay.counts[key] for relay in relays) for key in relays[0].counts}
    print(json.dumps(total), flush=True)
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    sys.exit(main())
