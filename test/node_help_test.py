"""What a node's --help says that it subscribes, publishes and offers is what it does."""

import re
import subprocess
import time
import xmlrpc.client

from programs import TOP, environment, run

# what every node has
COMMON = {"/rosout", "get_loggers", "set_logger_level"}
NODES = {"meta_aggregator": "/pmeta/meta_aggregator", "task_agent": "/pmeta/task_agent_0",
         "run_guard": "/pmeta/run_guard", "trajectory_view": "/pmeta/trajectory_view"}
# these, which both offer begin_episode, one after the other
ACTING = {"policy_node": "/pmeta/policy_node", "drive_robot": "/pmeta/drive_robot"}


def told(text):
    """{"publishes": names, ...} as the help has them."""
    found = {"subscribes": set(), "publishes": set(), "offers": set()}
    section = None
    for line in text.splitlines():
        first = re.match(r"\w*", line).group()
        section = first if first in found else section if line.startswith("  ") else None
        if section == "offers":
            found[section].update(re.findall(r"^(?:offers)?\s+(\w+) \(std_srvs", line))
        elif section:
            line = re.sub(r"\([^)]*\)|:.*", "", line.replace(first, "", 1))
            names = (part.strip() for part in re.split("[,;]", line))
            found[section].update(name.replace("<i>", "0") for name in names
                                  if re.fullmatch(r"[\w/<>]+", name))
            if "static TF frames" in line:
                found[section].add("/tf_static")
    return found


def done_by(master, node):
    """The same as the master has it."""
    published, subscribed, offered = master.getSystemState("/test")[2]
    state = {"subscribes": subscribed, "publishes": published, "offers": offered}
    return {kind: {name.replace("/pmeta/", "", 1) if name.startswith("/pmeta/") else name
                   for name, nodes in entries
                   if node in nodes and name.rsplit("/", 1)[-1] not in COMMON
                   and name not in COMMON and not re.search(r"/task_[1-9]", name)}
            for kind, entries in state.items()}


def wait_for(condition, seconds=60):
    limit = time.time() + seconds
    while not condition():
        assert time.time() < limit, "waited too long"
        time.sleep(0.1)


def test_each_help_names_the_topics_and_services_that_there_are(tmp_path):
    env = environment(tmp_path)
    helps = {program: told(run([TOP / "devel/lib/pmeta_nodes" / program, "--help"], env=env).stdout)
             for program in {**NODES, **ACTING}}
    helps["trajectory_view"]["publishes"].discard("playback")  # of scenes that move
    folder = tmp_path / "gridworld" / "r"
    launch = subprocess.Popen(
        ["roslaunch", "-p", env["ROS_MASTER_URI"].rsplit(":")[-1], "pmeta_nodes",
         "gridworld.launch", "rounds:=1", "hold:=true", "view:=true", "view_prefix:=env",
         "results_dir:=%s" % tmp_path, "run_id:=r"],
        env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        master = xmlrpc.client.ServerProxy(env["ROS_MASTER_URI"])
        wait_for(lambda: (folder / "policies/task_0.safetensors").exists())
        for program, node in NODES.items():
            does_what_it_says(master, node, helps[program])
        for program, node in ACTING.items():
            # a policy that finds out its task
            acting = subprocess.Popen(
                ["rosrun", "pmeta_nodes", program, "__ns:=/pmeta", "_policy:=%s" % (
                    TOP / "config/policies/half_cheetah_dir/policies/meta.safetensors")],
                env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                does_what_it_says(master, node, helps[program])
            finally:
                acting.terminate()
                acting.wait(60)
    finally:
        launch.terminate()
        launch.wait(60)


def does_what_it_says(master, node, told_of_it):
    try:
        wait_for(lambda: done_by(master, node) == told_of_it, 20)
    except AssertionError:
        assert done_by(master, node) == told_of_it, node
