"""A robot or simulator behind the services describe, reset and step, for one agent of pMeta to train
on: see docs/your_robot.md, and the comments in pmeta_msgs/srv."""
import threading

import rospy
from pmeta_msgs.srv import (DescribeEnv, DescribeEnvResponse, ResetEnv, ResetEnvResponse, StepEnv,
                            StepEnvResponse)


class EnvServer:
    """An agent that has lost an answer asks again: every reset and step is done once, and its answer
    kept. What `reset` and `act` raise becomes the answer's error, after which the episode is over.

    observations, actions: {name: (unit, low, high)} in their order, "" where there is no unit, and
        -math.inf and math.inf where there are no limits
    reset(seed): begins an episode, whose randomness is to follow from seed; gives its observation
    act(action): acts once, waits until that is done, and gives
        (observation, reward, terminated, truncated)
    choices: names of the discrete actions, of which the one number is the index
    """

    def __init__(self, observations, actions, reset, act, choices=(), horizon=0, step_seconds=0.0):
        self._description = DescribeEnvResponse(
            *_columns(observations), *_columns(actions), list(choices), horizon, step_seconds)
        self._reset, self._act = reset, act
        self._lock = threading.Lock()
        self._begun = None  # (session, episode)
        self._steps = 0
        self._over = True
        self._start = self._last = None
        self._services = []

    def advertise(self, namespace=""):
        """Offers the services below the namespace, by default the node's."""
        prefix = namespace + "/" if namespace else ""
        self._services = [
            rospy.Service(prefix + "describe", DescribeEnv, lambda _: self._description),
            rospy.Service(prefix + "reset", ResetEnv, self.reset),
            rospy.Service(prefix + "step", StepEnv, self.step)]

    def reset(self, request):
        """The answer to a ResetEnv request."""
        with self._lock:
            asked = (request.session, request.episode)
            if self._begun and asked[0] == self._begun[0] and asked[1] < self._begun[1]:
                return ResetEnvResponse(error="episode %d is over: episode %d has begun."
                                        % (asked[1], self._begun[1]))
            if asked != self._begun:
                self._begun, self._steps, self._over = asked, 0, False
                try:
                    self._start = ResetEnvResponse("", _numbers(self._reset(request.seed)))
                except Exception as error:  # whatever it is, the agent is told
                    self._over = True
                    self._start = ResetEnvResponse(error=_told(error))
            return self._start

    def step(self, request):
        """The answer to a StepEnv request."""
        with self._lock:
            if (request.session, request.episode) != self._begun:
                return StepEnvResponse(error="there is no such episode: it was begun before this "
                                       "server was, or another agent has begun one since.")
            if self._steps and request.step == self._steps:
                return self._last
            if self._over or request.step != self._steps + 1:
                return StepEnvResponse(error="step %d cannot be made after step %d%s" % (
                    request.step, self._steps,
                    ", which ended the episode." if self._over else "."))
            objection = self._objection_to(request.action)
            if objection:
                return StepEnvResponse(error=objection)
            self._steps = request.step
            try:
                observation, reward, terminated, truncated = self._act(list(request.action))
                self._last = StepEnvResponse("", _numbers(observation), float(reward),
                                             bool(terminated), bool(truncated))
                self._over = self._last.terminated or self._last.truncated
            except Exception as error:  # whatever it is, the agent is told
                self._over = True
                self._last = StepEnvResponse(error=_told(error))
            return self._last

    def _objection_to(self, action):
        # a robot must not be given what it was not meant to take
        told = self._description
        if len(action) != len(told.action_names):
            return "an action of %d numbers is not one of %d." % (len(action), len(told.action_names))
        for name, low, high, number in zip(told.action_names, told.action_low, told.action_high, action):
            if not low <= number <= high:
                return "%s of an action is %f, which is out of its limits." % (name, number)
        return ""


def _columns(quantities):
    """Names, units, and lower and upper limits."""
    units, low, high = zip(*quantities.values())
    return list(quantities), list(units), [float(x) for x in low], [float(x) for x in high]


def _numbers(observation):
    return [float(number) for number in observation]


def _told(error):
    return "%s: %s" % (type(error).__name__, error)
