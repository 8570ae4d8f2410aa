#!/usr/bin/python3
"""describe_env: the section `environment` of a settings file, as robots or simulators describe themselves."""
import json
import math
import os
import sys

import rospy
from pmeta_msgs.srv import DescribeEnv

# catkin's relay runs this file from another folder
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from pmeta_files import PlotError
from pmeta_program import Parser, run_program


def described(namespace):
    service = rospy.ServiceProxy(namespace + "/describe", DescribeEnv)
    try:
        service.wait_for_service(5)
        return service()
    except (rospy.ROSException, rospy.ServiceException) as error:
        raise PlotError("%s/describe does not answer (%s): start its server." % (namespace, error))


def lines(names, units, lows, highs, limited=True):
    for name, unit, low, high in zip(names, units, lows, highs):
        words = ["unit: " + json.dumps(unit)] if unit else []
        if limited and math.isfinite(low) and math.isfinite(high):
            words.append("limits: [%r, %r]" % (low, high))
        yield "    %s: {%s}" % (name, ", ".join(words))


def section(namespaces, one):
    yield "environment:"
    yield "  name: remote"
    yield "  servers: [%s]" % ", ".join(namespaces)
    yield "  horizon: %d%s" % (one.horizon or 200, "" if one.horizon else "  # as you like")
    yield "  step_seconds: %r" % one.step_seconds
    yield "  observations:"
    yield from lines(one.observation_names, one.observation_units, one.observation_low,
                     one.observation_high)
    yield "  actions:"
    yield from lines(one.action_names, one.action_units, one.action_low, one.action_high,
                     not one.choices)
    if one.choices:
        yield "  choices: [%s]" % ", ".join(one.choices)


def describe(arguments):
    parser = Parser(prog="describe_env.py", description=__doc__.split("\n")[0].split(": ")[1])
    parser.add_argument("namespace", nargs="+", help="of the services of a running server, one for each "
                        "training task, e.g. /robot_0")
    namespaces = parser.parse_args(arguments).namespace
    rospy.init_node("describe_env", anonymous=True, disable_signals=True)
    all_of_them = [described(namespace) for namespace in namespaces]
    for namespace, one in zip(namespaces, all_of_them):
        if one != all_of_them[0]:
            raise PlotError("%s describes itself otherwise than %s: tasks of one experiment observe "
                            "and take the same." % (namespace, namespaces[0]))
    print("\n".join(section(namespaces, all_of_them[0])))


if __name__ == "__main__":
    sys.exit(run_program("describe_env", describe, rospy.myargv()[1:]))
