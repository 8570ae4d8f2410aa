"""A launch beside a run that is alive: on one master a node's name belongs to one process."""
import contextlib
import os
import re
import signal

from faults_test import process, rounds_written, wait_until
from programs import LOCAL, TOP, environment, run


def launch(tmp_path, run_id, *arguments):
    return ["roslaunch", "pmeta_nodes", "gridworld.launch", "run_id:=" + run_id,
            "results_dir:=%s" % tmp_path, "seed:=1"] + list(arguments)


def nodes_named(text):
    """The pids of a refusal by the nodes' names."""
    return {name: int(pid) for name, pid in re.findall(r"(/\S+) \(pid (\d+)\)", text)}


def status(folder):
    return re.search(r'"status": "(\w+)"', (folder / "manifest.json").read_text()).group(1)


def test_a_launch_is_refused_while_a_run_has_its_names_and_has_a_way_out(tmp_path):
    env = environment(tmp_path)
    first = tmp_path / "gridworld/first"
    again = launch(tmp_path, "again", "rounds:=2", "pace:=0")
    orphans = {}
    with contextlib.ExitStack() as at_end:
        @at_end.callback
        def end_orphans():
            for pid in orphans.values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
        at_end.enter_context(process(["rosmaster", "--core", "-p", port],
                                     tmp_path / "master.log", env))
        launched = at_end.enter_context(
            process(launch(tmp_path, "first", "rounds:=1000", "pace:=0.2"),
                    tmp_path / "first.log", env))
        assert wait_until(lambda: rounds_written(first) > 1)

        refused = run(again, env=env)
        assert refused.returncode != 0
        assert "the run 'first' is alive on the ROS master at " + env["ROS_MASTER_URI"] \
            in refused.stderr
        orphans = nodes_named(refused.stderr)
        names = ["run_guard", "meta_aggregator"] + ["task_agent_%d" % task for task in range(5)]
        assert sorted(orphans) == sorted("/pmeta/" + name for name in names)
        assert all(os.path.exists("/proc/%d" % pid) for pid in orphans.values())
        assert not (tmp_path / "gridworld/again").exists()

        beside = run(launch(tmp_path, "beside", "rounds:=2", "pace:=0", "ns:=left"), env=env)
        assert beside.returncode == 0, beside.stdout + beside.stderr
        assert status(tmp_path / "gridworld/beside") == "finished"
        env_beside = dict(env, ROS_NAMESPACE="right")
        beside = run(launch(tmp_path, "right", "rounds:=2", "pace:=0"), env=env_beside)
        assert status(tmp_path / "gridworld/right") == "finished", beside.stdout + beside.stderr

        # whoever kills roslaunch so leaves the nodes alive
        launched.kill()
        launched.wait()
        assert "the run 'first' is alive" in run(again, env=env).stderr
        done = rounds_written(first)
        assert wait_until(lambda: rounds_written(first) > done)

        # the names of the dead stay with the master, and are free
        for pid in orphans.values():
            os.kill(pid, signal.SIGKILL)
        assert "/pmeta/meta_aggregator" in run(["rosnode", "list"], env=env).stdout
        after = run(again, env=env)
        assert status(tmp_path / "gridworld/again") == "finished", after.stdout + after.stderr


def test_agents_that_wait_for_their_run_are_no_obstacle(tmp_path):
    env = environment(tmp_path)
    port = env["ROS_MASTER_URI"].rsplit(":", 1)[1]
    with contextlib.ExitStack() as at_end:
        at_end.enter_context(process(["rosmaster", "--core", "-p", port],
                                     tmp_path / "master.log", env))
        assert wait_until(lambda: run(["rosparam", "list"], env=env).returncode == 0)
        agents = [at_end.enter_context(process(
            [TOP / "devel/lib/pmeta_nodes/task_agent", "__ns:=/pmeta",
             "__name:=task_agent_%d" % task, "_task:=%d" % task,
             "_config_file:=%s" % (TOP / "config/gridworld.yaml")],
            tmp_path / ("agent_%d.log" % task), env)) for task in range(5)]
        assert wait_until(lambda: run(["rosnode", "list"], env=env).stdout.count("task_agent") == 5)
        refused = run(launch(tmp_path, "all", "rounds:=2"), env=env)
        assert len(nodes_named(refused.stderr)) == 5
        prepare = ["rosrun", "pmeta_nodes", "prepare_run", TOP / "config/gridworld.yaml",
                   tmp_path / "agents.launch", "results_dir:=%s" % tmp_path, "agents:=false"]
        prepared = run(prepare, env=env)
        assert prepared.returncode == 0, prepared.stderr
        assert all(agent.poll() is None for agent in agents)


def test_a_finished_launch_ends_calmly_and_leaves_no_file(tmp_path):
    env = environment(tmp_path)
    done = run(launch(tmp_path, "calm", "rounds:=2", "pace:=0"), env=env)
    assert status(tmp_path / "gridworld/calm") == "finished", done.stdout + done.stderr
    assert done.returncode == 0
    assert "has died" not in done.stdout + done.stderr
    assert not list((tmp_path / "ros").glob("*.launch"))


def test_a_bag_has_all_rounds_and_is_replayed(tmp_path):
    env = environment(tmp_path)
    folder = tmp_path / "gridworld/recorded"
    done = run(launch(tmp_path, "recorded", "rounds:=3", "pace:=0", "record:=true"), env=env)
    assert status(folder) == "finished", done.stdout + done.stderr
    bag = folder.parent / "recorded.bag"
    count = """
import collections, rosbag, sys
print(sorted(collections.Counter((m.policy_name, m.round) for _, m, _ in
                                 rosbag.Bag(sys.argv[1]).read_messages("/pmeta/returns")).items()))
"""
    counted = run(["/usr/bin/python3", "-c", count, bag], env=env)
    # some may be sent twice
    for policy in ("meta", "personal"):
        for number in (1, 2, 3):
            found = re.search(r"\('%s', %d\), (\d+)" % (policy, number), counted.stdout)
            assert found and int(found.group(1)) >= 5, (policy, number, counted)

    with process(["roslaunch", "pmeta_nodes", "replay_bag.launch", "bag:=%s" % bag, "delay:=0.5",
                  "rviz:=false"], tmp_path / "replay.log", env) as replayed:
        title = "gridworld: round 3 of 3 (finished)"
        assert wait_until(lambda: title in run(
            ["timeout", "20", "rostopic", "echo", "-n1", "/pmeta/markers"], env=env).stdout), \
            (tmp_path / "replay.log").read_text()
        replayed.terminate()  # killed, it would leave its nodes behind
        replayed.wait(60)


def test_a_finished_run_is_shown_without_training(tmp_path):
    env = environment(tmp_path)
    folder = tmp_path / "gridworld/shown"
    done = run([LOCAL, "run", "config/gridworld.yaml", "rounds:=3", "run_id:=shown",
                "results_dir:=%s" % tmp_path], env=env)
    assert done.returncode == 0, done.stderr
    before = sorted((path, path.stat().st_mtime) for path in folder.rglob("*"))
    with process(["roslaunch", "pmeta_nodes", "show.launch", "run:=%s" % folder, "rviz:=false"],
                 tmp_path / "show.log", env) as showing:
        def shows_all():
            markers = run(["timeout", "20", "rostopic", "echo", "-n1", "/pmeta/markers"],
                          env=env).stdout
            return ("gridworld: round 3 of 3 (finished)" in markers
                    and re.search(r"mean personal return \(PP\) -?\d", markers)
                    and re.search(r"mean meta return \(MP\) -?\d", markers))

        assert wait_until(shows_all), (tmp_path / "show.log").read_text()
        showing.terminate()  # killed, it would leave its nodes behind
        showing.wait(60)
    assert sorted((path, path.stat().st_mtime) for path in folder.rglob("*")) == before
