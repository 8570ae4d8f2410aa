"""An experiment of one's own: its path goes wherever an experiment is named, and a run of it needs nothing
outside of its folder."""
import json
import shutil
import signal
import struct
import subprocess
import time

import pytest

from programs import LOCAL, TOP, environment, rows, run

MODEL = """<mujoco><compiler meshdir="meshes"/><include file="parts/actuators.xml"/>
<asset><mesh name="blade" file="blade.stl"/></asset>
<worldbody><body name="arm"><joint name="hinge" axis="0 1 0" damping="0.1"/>
<geom type="mesh" mesh="blade"/><site name="tip" pos="0 0 0.3"/></body></worldbody></mujoco>"""
ACTUATORS = """<mujoco><actuator><motor name="hinge" joint="hinge" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>"""
SETTINGS = """experiment: mine
learner: sac
rounds: 40
updates_per_round: 20
checkpoint: {interval: 1}
sac: {hidden: [8], batch_size: 8, warm_up_steps: 20, task_encoding: one_hot}
environment:
  name: mjcf
  model_file: model/arm.xml
  frame_skip: 5
  horizon: 20
  observations: {joint_positions: {}, joint_velocities: {}}
  rewards: {joint_position_error: {joint: hinge, target: 0.5, weight: -1}}
  variations: {load: {term: body_mass, bodies: [arm], values: [0.5, 2]}}
"""


def tetrahedron():
    corners = [(0, 0, 0), (0.05, 0, 0), (0, 0.05, 0), (0, 0, 0.3)]
    sides = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    data = b"\0" * 80 + struct.pack("<I", len(sides))
    for side in sides:
        data += struct.pack("<3f", 0, 0, 0) + b"".join(struct.pack("<3f", *corners[i]) for i in side)
        data += b"\0\0"
    return data


@pytest.fixture
def desk(tmp_path):
    """A folder in which somebody has a robot in robots/mine.yaml."""
    for folder in ("robots/model/parts", "robots/model/meshes"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "robots/mine.yaml").write_text(SETTINGS)
    (tmp_path / "robots/model/arm.xml").write_text(MODEL)
    (tmp_path / "robots/model/parts/actuators.xml").write_text(ACTUATORS)
    (tmp_path / "robots/model/meshes/blade.stl").write_bytes(tetrahedron())
    return tmp_path


def test_a_run_goes_on_and_its_policies_act_when_the_original_is_gone(desk):
    words = ["run", "robots/mine.yaml", "results_dir:=results"]
    whole = run([LOCAL] + words + ["run_id:=whole"], cwd=desk)
    assert whole.returncode == 0, whole.stderr
    begun = subprocess.Popen([str(LOCAL)] + words + ["run_id:=begun"], cwd=str(desk),
                             stdout=subprocess.DEVNULL)
    folder = desk / "results/mine/begun"
    while not list(folder.glob("checkpoint/aggregator*")) and begun.poll() is None:
        time.sleep(0.02)
    begun.send_signal(signal.SIGINT)
    assert begun.wait(60) == 130
    # all that it knows is in its folder, wherever that goes
    shutil.rmtree(str(desk / "robots"))
    (desk / "results").rename(desk / "kept")
    elsewhere = desk / "elsewhere"
    elsewhere.mkdir()
    folder = desk / "kept/mine/begun"
    assert (folder / "models/meshes/blade.stl").exists()
    gone_on = run([LOCAL, "run", folder / "config.yaml", "resume:=%s" % folder], cwd=elsewhere)
    assert gone_on.returncode == 0, gone_on.stderr
    assert rows(folder) == rows(desk / "kept/mine/whole")
    judged = run([LOCAL, "evaluate", folder / "policies/task_1.safetensors", "--episodes", "2"],
                 cwd=elsewhere)
    assert judged.returncode == 0, judged.stderr


def test_the_front_door_takes_its_path_from_any_folder(desk):
    pmeta = TOP / "pmeta"
    listed = run([pmeta, "settings", "./mine.yaml"], cwd=desk / "robots")
    assert listed.returncode == 0, listed.stderr
    assert "environment.rewards.joint_position_error.target" in listed.stdout
    swept = run([pmeta, "sweep", "robots/mine.yaml", "seed:=0,1", "rounds:=1", "--name", "s",
                 "joint_position_error.target:=0.2,0.4",
                 "results_dir:=results"], cwd=desk, timeout=300)
    assert swept.returncode == 0, swept.stderr
    manifests = [json.loads(path.read_text()) for path in desk.glob("results/sweeps/s/*/*/manifest.json")]
    assert sorted(m["status"] for m in manifests) == ["finished"] * 4
    told = run([pmeta, "settings", "mjcf"], cwd=desk)
    assert told.returncode == 0 and "goal_distance: " in told.stdout
    for word in ("./nowhere.yaml", "nowhere"):
        refused = run([pmeta, "run", word], cwd=desk)
        assert refused.returncode == 1 and word in refused.stderr and "Traceback" not in refused.stderr


def test_roslaunch_takes_its_path_from_any_folder(desk):
    env = environment(desk)
    launched = run(["roslaunch", "pmeta_nodes", "experiment.launch", "config:=mine.yaml", "rounds:=2",
                    "run_id:=r", "results_dir:=%s" % (desk / "results")],
                   cwd=desk / "robots", env=env, timeout=300)
    manifest = json.loads((desk / "results/mine/r/manifest.json").read_text())
    assert manifest["status"] == "finished", launched.stdout + launched.stderr
    alone = run([LOCAL, "run", "mine.yaml", "rounds:=2", "run_id:=alone",
                 "results_dir:=%s" % (desk / "results")], cwd=desk / "robots")
    assert alone.returncode == 0, alone.stderr
    assert rows(desk / "results/mine/r") == rows(desk / "results/mine/alone")
