#!/usr/bin/python3
"""A rover on two wheels that is to drive to a beacon, behind the services that pMeta trains on.
usage: rover.py LEFT RIGHT   how much of the speed that it is told each wheel makes, e.g. 1 0.5"""
import math
import random

import rospy
from pmeta_nodes.env_server import EnvServer

STEP = 0.1          # s
FASTEST = 0.5       # m/s, of a wheel
TRACK = 0.3         # m, between the wheels
LAG = 0.5           # of a wheel's speed, what a step leaves as it was
ARRIVED = 0.1       # m, to the beacon


class Rover:
    def __init__(self, gains):
        self.gains = gains

    def reset(self, seed):
        draw = random.Random(seed).uniform
        self.speeds = [0.0, 0.0]
        self.heading = draw(-math.pi, math.pi)
        away, where = draw(0.5, 1.5), draw(-math.pi, math.pi)
        self.beacon = [away * math.cos(where), away * math.sin(where)]  # from the rover
        return self.observation()

    def act(self, told):
        for side in range(2):
            wanted = self.gains[side] * told[side]
            self.speeds[side] = LAG * self.speeds[side] + (1 - LAG) * wanted
        left, right = self.speeds
        self.heading += STEP * (right - left) / TRACK
        self.beacon[0] -= STEP * (left + right) / 2 * math.cos(self.heading)
        self.beacon[1] -= STEP * (left + right) / 2 * math.sin(self.heading)
        distance = math.hypot(*self.beacon)
        return self.observation(), -distance, distance < ARRIVED, False

    def observation(self):
        """Where the beacon is, as the rover sees it, and how fast the wheels are."""
        x, y = self.beacon
        sine, cosine = math.sin(self.heading), math.cos(self.heading)
        return [cosine * x + sine * y, cosine * y - sine * x] + self.speeds


rospy.init_node("rover")
rover = Rover([float(word) for word in rospy.myargv()[1:3]])
server = EnvServer(
    observations={"ahead": ("m", -math.inf, math.inf), "to_the_left": ("m", -math.inf, math.inf),
                  "left_speed": ("m/s", -FASTEST, FASTEST), "right_speed": ("m/s", -FASTEST, FASTEST)},
    actions={"left_wheel": ("m/s", -FASTEST, FASTEST), "right_wheel": ("m/s", -FASTEST, FASTEST)},
    reset=rover.reset, act=rover.act, step_seconds=STEP)
server.advertise()
rospy.spin()
