"""Running the project's programs in tests."""
import pathlib
import random
import socket
import subprocess

TOP = pathlib.Path(__file__).resolve().parent.parent
LOCAL = TOP / "devel/lib/pmeta_core/pmeta_local"
CONFIG = TOP / "config/gridworld.yaml"


def run(command, timeout=120, **kwargs):
    """The finished process, with its standard output and error as text."""
    return subprocess.run([str(word) for word in command], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, timeout=timeout,
                          **kwargs)


def rows(folder):
    """The lines of rounds.csv of a run, without the wall time."""
    return [line.rsplit(",", 1)[0] for line in (folder / "rounds.csv").read_text().splitlines()]


def free_port():
    """A port that nobody listens on, below those that the system gives to connections."""
    while True:
        port = random.randint(20000, 32000)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                return port


def environment(tmp_path, setup="devel/setup.bash"):
    """An environment for ROS programs, with a master port and a home of its own."""
    lines = run(["bash", "-c", ". %s && env -0" % (TOP / setup)],
                env={"PATH": "/usr/bin:/bin:/usr/sbin:/sbin", "HOME": str(tmp_path)}).stdout
    env = dict(line.split("=", 1) for line in lines.split("\0") if "=" in line)
    env.update(ROS_HOME=str(tmp_path / "ros"), ROS_IP="127.0.0.1",
               ROS_MASTER_URI="http://127.0.0.1:%d" % free_port())
    return env
