#!/usr/bin/python3
"""A cart-pole behind the services that pMeta trains on; one for each task.
usage: cart_pole_server.py [FORCE] __ns:=/cart_pole_0"""
import math
import random

import rospy
from pmeta_nodes.env_server import EnvServer

FORCE = float(rospy.myargv()[1]) if len(rospy.myargv()) > 1 else 10.0
POSITION, ANGLE = 2.4, 12 * 2 * math.pi / 360
MASS, POLE_MASS, LENGTH, STEP = 1.1, 0.1, 0.5, 0.02


class CartPole:
    def reset(self, seed):
        draw = random.Random(seed).uniform
        self.state = [draw(-0.05, 0.05) for _ in range(4)]
        return self.state

    def act(self, action):
        x, speed, angle, turning = self.state
        push = FORCE if action[0] == 1 else -FORCE
        sine, cosine = math.sin(angle), math.cos(angle)
        shared = (push + POLE_MASS * LENGTH * turning ** 2 * sine) / MASS
        turn = (9.8 * sine - cosine * shared) / (
            LENGTH * (4 / 3 - POLE_MASS * cosine ** 2 / MASS))
        drive = shared - POLE_MASS * LENGTH * turn * cosine / MASS
        self.state = [x + STEP * speed, speed + STEP * drive,
                      angle + STEP * turning, turning + STEP * turn]
        fallen = abs(self.state[0]) > POSITION or abs(self.state[2]) > ANGLE
        return self.state, 1.0, fallen, False


rospy.init_node("cart_pole_server")
pole = CartPole()
server = EnvServer(
    observations={"position": ("m", -POSITION, POSITION), "velocity": ("m/s", -math.inf, math.inf),
                  "angle": ("rad", -ANGLE, ANGLE), "angular_velocity": ("rad/s", -math.inf, math.inf)},
    actions={"push": ("", 0, 1)}, choices=["left", "right"],
    reset=pole.reset, act=pole.act, step_seconds=STEP)
server.advertise()
rospy.spin()
