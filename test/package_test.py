"""What is installed, and packages of others that are built against it: the template of examples/pmeta_pendulum,
in a workspace of its own."""
import json
import re
import shutil

import pytest

from faults_test import process, wait_until
from programs import CONFIG, TOP, environment, rows, run

NAME = "pmeta_pendulum/Pendulum"
QUICK = ["rounds:=3", "updates_per_round:=10", "evaluation_episodes:=2", "sac.hidden:=[8]", "batch_size:=8",
         "warm_up_steps:=50"]


@pytest.fixture(scope="module")
def prefix():
    """Where pMeta is installed; catkin writes the path into setup.sh."""
    folder = TOP / "install"
    shutil.rmtree(str(folder), ignore_errors=True)
    result = run(["make", "-C", TOP / "build", "install"], timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder


@pytest.fixture(scope="module")
def workspace(prefix, tmp_path_factory):
    """Somebody's installed workspace, with the package and what is faulty."""
    folder = tmp_path_factory.mktemp("workspace")
    source = folder / "src"
    shutil.copytree(str(TOP / "examples/pmeta_pendulum"), str(source))
    shutil.copy(str(TOP / "test/package/faulty.cpp"), str(source / "src"))
    with (source / "CMakeLists.txt").open("a") as file:
        file.write("target_sources(${PROJECT_NAME} PRIVATE src/faulty.cpp)\n")
    env = environment(folder, prefix / "setup.bash")
    for command in (["cmake", "-S", source, "-B", folder / "build", "-DCMAKE_INSTALL_PREFIX=%s" % (folder / "ws"),
                     "-DCMAKE_PREFIX_PATH=%s" % prefix], ["make", "-C", folder / "build", "install"]):
        result = run(command, timeout=300, env=env)
        assert result.returncode == 0, result.stdout + result.stderr
    return folder / "ws"


@pytest.fixture
def env(workspace, tmp_path):
    return environment(tmp_path, workspace / "setup.bash")


def local(env, *words):
    return run(["rosrun", "pmeta_core", "pmeta_local"] + list(words), env=env)


def manifest_of(folder):
    return json.loads((folder / "manifest.json").read_text())


def test_the_installed_packages_work_like_the_source_tree(prefix, tmp_path):
    # programs, launch files and settings from install/ alone
    env = environment(tmp_path, prefix / "setup.bash")
    assert str(TOP / "src") not in env["ROS_PACKAGE_PATH"]
    assert str(TOP / "devel") not in env["LD_LIBRARY_PATH"]
    where = run(["rospack", "find", "pmeta_nodes"], env=env).stdout
    assert where.startswith(str(prefix))
    run(["roslaunch", "pmeta_nodes", "gridworld.launch", "pace:=0", "results_dir:=%s" % tmp_path,
         "run_id:=installed"], env=env)
    folder = tmp_path / "gridworld/installed"
    assert manifest_of(folder)["status"] == "finished"
    for program in ("plot.py", "report.py"):
        result = run(["rosrun", "pmeta_nodes", program, folder], env=env)
        assert result.returncode == 0, result.stderr
    assert (folder / "report.html").exists()


def test_all_packages_have_one_version():
    header = (TOP / "src/pmeta_core/include/pmeta_core/base/build.h").read_text()
    version = re.search(r'kVersion\[\] = "(.*)"', header)[1]
    for package in ("pmeta_core", "pmeta_msgs", "pmeta_nodes"):
        assert "<version>%s</version>" % version in (TOP / "src" / package / "package.xml").read_text()


def test_an_environment_of_a_package_runs_over_ros_by_one_command_and_is_drawn(env, workspace, tmp_path):
    launch = ["roslaunch", "pmeta_pendulum", "pendulum.launch", "run_id:=ros", "results_dir:=%s" % tmp_path,
              "hold:=true", "view:=true"] + QUICK
    with process(launch, tmp_path / "launch.log", env) as launched:
        manifest = tmp_path / "pendulum/ros/manifest.json"
        assert wait_until(lambda: manifest.exists() and '"finished"' in manifest.read_text(), 60), \
            (tmp_path / "launch.log").read_text()
        markers = run(["rostopic", "echo", "-n", "1", "/pmeta/playback"], env=env, timeout=60)
        launched.terminate()  # killed, it would leave its nodes behind
        launched.wait(60)
    assert markers.stdout.count("pendulums") == 6  # both policies of three tasks
    assert manifest_of(tmp_path / "pendulum/ros")["package"] == "pmeta_pendulum 1.0.0"

    config = workspace / "share/pmeta_pendulum/config/pendulum.yaml"
    ran = local(env, "run", config, "run_id:=local", "results_dir:=%s" % tmp_path, *QUICK)
    assert ran.returncode == 0, ran.stderr
    assert rows(tmp_path / "pendulum/local") == rows(tmp_path / "pendulum/ros")


def test_a_package_that_is_another_or_missing_is_named(env, prefix, workspace, tmp_path):
    config = workspace / "share/pmeta_pendulum/config/pendulum.yaml"
    words = ["results_dir:=%s" % tmp_path, "run_id:=r", "package_version:=0.9.0"] + QUICK
    other = "the settings are of version '0.9.0' of the package pmeta_pendulum, which is '1.0.0' here"
    ran = local(env, "run", config, *words)
    assert ran.returncode == 0 and other in ran.stderr
    policy = tmp_path / "pendulum/r/policies/task_1.safetensors"
    judged = local(env, "evaluate", policy, "--episodes", "2")
    assert judged.returncode == 0 and "pendulum_1" in judged.stdout and other in judged.stderr

    alone = environment(tmp_path, prefix / "setup.bash")
    missing = "no package here exports the environment '%s'" % NAME
    for command in (["evaluate", policy], ["run", config, "resume:=%s" % (tmp_path / "pendulum/r")]):
        result = local(alone, *command)
        assert result.returncode == 1 and missing in result.stderr, result.stderr
    # by its library it needs no package to be found
    given = local(alone, "check", config, "library:=%s" % (workspace / "lib/libpmeta_pendulum.so"))
    assert given.returncode == 0, given.stderr


FAULTS = {
    "throws": "cannot be stepped: no such joint.",
    "throws_error": "cannot be stepped: The motor is off.",
    "throws_number": "cannot be stepped: it threw something that is no std::exception.",
    "no_number": "gave an observation whose speed (number 2 of 3) is nan",
    "too_few": "gave an observation whose speed (number 2 of 3) is nan or was not written",
    "too_many": "wrote more than the 3 numbers of observation that its spec() says.",
    "no_reward": "gave a reward that is nan",
    "not_made": "cannot be made: its port is taken.",
    "none": "is none: create() gave null.",
    "other_size": "has 4 numbers of observation, 1 of action and 0 discrete actions, but that of task 0 has 3",
    "not_described": "describes 2 numbers of its observation, which has 3",
}
FAULTY = "the environment 'pmeta_pendulum/Faulty' (pmeta_pendulum 1.0.0) of task 1 (bad) "


@pytest.fixture
def faulty(workspace, tmp_path):
    """A settings file of the faulty environment, which gives its library."""
    path = tmp_path / "faulty.yaml"
    path.write_text("""experiment: faulty
learner: sac
rounds: 30
updates_per_round: 10
sac: {hidden: [8], batch_size: 8, warm_up_steps: 50, evaluation_episodes: 1}
environment: {name: pmeta_pendulum/Faulty, fault: throws, good_steps: 450}
library: %s
""" % (workspace / "lib/libpmeta_pendulum.so"))
    return path


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_environment_is_named_and_earlier_rounds_are_kept(fault, faulty, env, tmp_path):
    ran = local(env, "run", faulty, "fault:=" + fault, "run_id:=r", "results_dir:=%s" % tmp_path)
    assert ran.returncode == 1 and FAULTY in ran.stderr and FAULTS[fault] in ran.stderr, ran.stderr
    folder = tmp_path / "faulty/r"
    if fault in ("not_made", "none", "other_size", "not_described"):
        return  # nothing is begun
    manifest = manifest_of(folder)
    assert manifest["status"] == "failed" and FAULTY in manifest["reason"]
    assert re.match(r"round \d+ failed: ", manifest["reason"])
    assert len(rows(folder)) > 1


def test_a_faulty_environment_is_told_by_those_who_learn_all_tasks_and_over_ros(faulty, env, tmp_path):
    words = ["results_dir:=%s" % tmp_path]
    pooled = local(env, "run", faulty, "run_id:=pearl", "algorithm:=pearl", *words)
    assert pooled.returncode == 1 and FAULTY + FAULTS["throws"] in pooled.stderr, pooled.stderr
    # the other agent may be rounds behind with its returns
    run(["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % faulty, "run_id:=ros",
         "good_steps:=2000"] + words, env=env)
    manifest = manifest_of(tmp_path / "faulty/ros")
    assert manifest["status"] == "failed" and FAULTY + FAULTS["throws"] in manifest["reason"]
    assert len(rows(tmp_path / "faulty/ros")) > 1
    refused = run(["roslaunch", "pmeta_nodes", "experiment.launch", "config:=%s" % faulty, "fault:=not_made"] +
                  words, env=env)
    assert FAULTY + FAULTS["not_made"] in refused.stderr + refused.stdout


def test_a_library_of_another_version_is_refused_and_adds_nothing(prefix, env, tmp_path):
    other = tmp_path / "include/pmeta_core/base"
    other.mkdir(parents=True)
    header = (prefix / "include/pmeta_core/base/build.h").read_text()
    (other / "build.h").write_text(header.replace('kVersion[] = "', 'kVersion[] = "9.'))
    source = tmp_path / "row.cpp"
    source.write_text("""#include "pmeta_core/base/library.h"
const pmeta::Registered<pmeta::LibraryFinder> kRow(pmeta::libraryFinders(), "other", [](const std::string& name) {
  return name; });
""")
    library = tmp_path / "libold.so"
    built = run(["g++", "-std=c++17", "-shared", "-fPIC", "-I", tmp_path / "include", "-I", prefix / "include", source,
                 "-o", library])
    assert built.returncode == 0, built.stderr
    refused = local(env, "check", CONFIG, "library:=%s" % library)
    assert refused.returncode == 1 and "it was built against pMeta 9." in refused.stderr, refused.stderr
