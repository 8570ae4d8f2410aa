"""Every command of README.md and docs/: those under a minute are run as they stand, the others with
--long (then one by one, in the order of the pages). What runs until it is stopped must start."""
import json
import os
import re
import shlex
import signal
import socket
import subprocess
import time

import pytest

from programs import LOCAL, TOP, environment, free_port, run

PAGES = [TOP / "README.md"] + sorted((TOP / "docs").glob("*.md")) + \
        sorted((TOP / "docs/results").glob("*.md"))

PROGRAMS = ("./pmeta", "devel/lib/", "roslaunch", "rosrun", "rostopic", "rosservice", "rosparam",
            "rosmsg", "source", "cmake", "catkin_make")

# longer than a minute, or of a machine of its own; the rest of the command may be anything
LONG = (r"\./pmeta (test|fuzz|chaos|bench|build|setup|results|coverage|lint)\b", r"cmake |catkin_make",
        r"\./pmeta screenshot\b", r"\./pmeta run (ant_fwd_back|half_cheetah|walker|sparse)",
        r"\./pmeta run .*preset:=paper", r"\./pmeta sweep (?!gridworld )",
        r"\./pmeta run .*netns")

# ends when somebody ends it
ENDLESS = (r"policy_node", r"drive_robot", r"replay_bag\.launch", r"\./pmeta show", r"show\.launch",
           r"rviz:=true", r"hold:=true")

# asks a run that goes on
LIVE = r"(rostopic|rosservice|rosparam|rosmsg)\b"


def matches(patterns, command):
    return any(re.search(pattern, command) for pattern in patterns)


def fenced_blocks(text):
    """(language, lines) of each block between ``` marks."""
    for language, body in re.findall(r"^```(\w*)\n(.*?)^```", text, re.M | re.S):
        yield language, body.splitlines()


def commands_of(page):
    """The commands of a page, each with the assignments of shell variables before it."""
    variables = []
    for language, lines in fenced_blocks(page.read_text()):
        if language not in ("", "sh", "bash"):
            continue
        for line in lines:
            command = re.sub(r"(^|\s\s+)#.*", "", line).strip()
            if re.match(r"\w+=", command):
                variables.append(command)
            elif command.startswith(PROGRAMS):
                yield "; ".join([v for v in variables if "$" + v.split("=")[0] in command] +
                                [command])


def all_commands():
    seen = {}
    for page in PAGES:
        for command in commands_of(page):
            seen.setdefault(command, page.relative_to(TOP))
    # those that ask a run are asked one after the other
    order = sorted(seen.items(), key=lambda item: bool(re.match(LIVE, item[0])))
    return [pytest.param(command, id="%s: %s" % (page, command)) for command, page in order]


class Desk:
    """Where commands are typed: a folder that looks like the clone, a home and a master of its own."""

    def __init__(self, folder):
        self.folder = folder
        self.env = dict(environment(folder), HOME=str(folder), PWD=str(folder))
        del self.env["ROS_HOME"]  # so that ~/.ros is what it is to the reader
        for name in ("pmeta", "devel", "config", "examples", "test", "src"):
            (folder / name).symlink_to(TOP / name)
        for page in PAGES:
            for language, lines in fenced_blocks(page.read_text()):
                named = re.match(r"# (\w+\.yaml)", lines[0]) if language == "yaml" else None
                if named:
                    (folder / named[1]).write_text("\n".join(lines) + "\n")
        self.stopped = 0

    def finished_run(self):
        folder = self.folder / "runs/gridworld/finished"
        if not folder.exists():
            result = run([LOCAL, "run", TOP / "config/gridworld.yaml", "run_id:=finished",
                          "results_dir:=%s" % (self.folder / "runs")])
            assert result.returncode == 0, result.stderr
        return folder

    def stopped_run(self):
        """A run of cart_pole of its own that was stopped after its first rounds."""
        self.stopped += 1
        name = "stopped_%d" % self.stopped
        folder = self.folder / "runs/cart_pole" / name
        started = subprocess.Popen(
            [str(LOCAL), "run", str(TOP / "config/cart_pole.yaml"), "preset:=quick", "rounds:=4",
             "updates_per_round:=60", "checkpoint.interval:=1", "run_id:=" + name,
             "results_dir:=%s" % (self.folder / "runs")],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not list(folder.glob("checkpoint/aggregator*")) and started.poll() is None:
            time.sleep(0.02)
        started.send_signal(signal.SIGINT)
        assert started.wait(60) == 130
        return folder

    def filled_in(self, command):
        """The command with the reader's own words in the place of the page's."""
        if "resume:=RUN" in command:
            folder = self.stopped_run()
        elif re.search(r"\bRUN\b", command):
            folder = self.finished_run()
        else:
            return command
        return re.sub(r"\bRUN\b", shlex.quote(str(folder)), command)

    def start(self, command, env=None):
        log = self.folder / "output.txt"
        with open(str(log), "w") as out:
            process = subprocess.Popen(["bash", "-c", command], cwd=str(self.folder), env=env or self.env,
                                       stdin=subprocess.DEVNULL, stdout=out,
                                       stderr=subprocess.STDOUT, preexec_fn=as_a_terminal_does)
        return process, log

    def type(self, command, seconds, env=None):
        process, log = self.start(command, env)
        try:
            code = process.wait(seconds)
        finally:
            end(process)
        assert code == 0, "%s ended with %d:\n%s" % (command, code, log.read_text()[-4000:])

    def has_master(self):
        host, port = self.env["ROS_MASTER_URI"].split("//")[1].split(":")
        with socket.socket() as probe:
            return probe.connect_ex((host, int(port))) == 0

    def start_and_stop(self, command):
        process, log = self.start(command)
        try:
            if "rosrun" not in command:  # a launch begins with its master
                begin = time.monotonic()
                while not self.has_master() and process.poll() is None:
                    assert time.monotonic() - begin < 60, log.read_text()[-4000:]
                    time.sleep(0.2)
            time.sleep(5)
            assert process.poll() is None, log.read_text()[-4000:]
            os.killpg(process.pid, signal.SIGINT)
            process.wait(30)
        finally:
            end(process)
        assert "Traceback" not in log.read_text(), log.read_text()[-4000:]


def as_a_terminal_does():
    """A group of its own, that heeds Ctrl-C whatever the tests' own parent ignores."""
    os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def end(process):
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    return Desk(tmp_path_factory.mktemp("desk"))


@pytest.fixture(scope="module")
def live(desk):
    """The environment of a run that goes on while it is asked, on a master of its own."""
    env = dict(desk.env, ROS_MASTER_URI="http://127.0.0.1:%d" % free_port())
    started = subprocess.Popen(
        ["roslaunch", "pmeta_nodes", "gridworld.launch", "pace:=0.5", "rounds:=10000",
         "run_id:=live"], cwd=str(desk.folder), env=env, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, preexec_fn=os.setsid)
    waited = run(["timeout", "40", "bash", "-c",
                  "until rostopic echo -n 1 /pmeta/round; do sleep 0.5; done"], env=env)
    assert waited.returncode == 0, waited.stderr
    yield env
    os.killpg(started.pid, signal.SIGINT)
    try:
        started.wait(30)
    finally:
        end(started)


def flags_are_known(command):
    """The help of a command of ./pmeta names every option that the page gives it."""
    words = shlex.split(command.rsplit("; ", 1)[-1])
    if words[0] != "./pmeta":
        return
    told = run([TOP / "pmeta", words[1], "--help"])
    assert told.returncode == 0, told.stderr
    for word in words[2:]:
        if word.startswith("-"):
            assert word.split("=")[0].rstrip("_") in told.stdout, "%s is not in the help" % word


def sweep_is_sound(command, folder):
    """Settings and values of a sweep that takes hours are checked, by the first of each list."""
    words = shlex.split(re.sub(r'^\w+="([^"]*)"; (.*)\$\w+(.*)$', r"\2\1\3", command))
    options = [i for i, word in enumerate(words) if word in ("--name", "--jobs")]
    assignments = [word for i, word in enumerate(words[3:], 3)
                   if ":=" in word and i - 1 not in options]
    first = []
    for word in assignments:
        key, value = word.split(":=", 1)
        if not value.startswith("["):
            value = re.sub(r"^(\d+)-\d+$", r"\1", value.split(",")[0])
        elif "],[" in value:
            value = value.split("],")[0] + "]"
        first.append(key + ":=" + value)
    own = words[2].endswith(".yaml")
    config = folder / words[2] if own else TOP / ("config/%s.yaml" % words[2])
    checked = run([LOCAL, "check", config] + first)
    assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize("command", all_commands())
def test_a_command_of_the_pages_does_what_it_says(command, desk, request):
    if matches(LONG, command):
        flags_are_known(command)
        if "./pmeta sweep" in command:
            sweep_is_sound(command, desk.folder)
        if not request.config.getoption("--long") or "docs/results" in request.node.name:
            return
        return desk.type(desk.filled_in(command), 3600)
    if re.match(LIVE, command):
        if command.startswith("rostopic echo"):
            command += " -n 1"
        return desk.type(command, 60, request.getfixturevalue("live"))
    if matches(ENDLESS, command):
        if "rviz:=true" in command:  # needs a screen: that the arguments are good is seen without one
            command = command.replace("rviz:=true", "view:=true hold:=true")
        return desk.start_and_stop(desk.filled_in(command))
    desk.type(desk.filled_in(command), 240)


def test_pages_have_commands_and_links_that_lead_somewhere():
    assert len(all_commands()) > 20
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text()):
            if not re.match(r"\w+:", target):
                assert (page.parent / target).exists(), "%s links to %s" % (page, target)


def test_pages_name_settings_that_exist():
    """Inline `key:=value` words are settings or launch arguments."""
    launch = "".join(path.read_text() for path in (TOP / "launch").glob("*.launch"))
    known = set(re.findall(r'<arg name="(\w+)"', launch))
    for config in (TOP / "config").glob("*.yaml"):
        if config.name == "convergence.yaml":
            continue
        text = run([LOCAL, "check", config, "machines.one.host:=there", "machines.one.tasks:=[0]",
                    "machines.one.env_loader:=/env.sh"]).stdout
        known |= set(re.findall(r"^ *(?:\w+\.)?(\w+):", text, re.M))
    for page in PAGES:
        prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
        for key in re.findall(r"`(?:[^`\n]* )?([a-zA-Z_.]+):=", prose):
            last = key.rsplit(".", 1)[-1]
            assert last in known or key in ("key",), "%s names %s" % (page, key)


@pytest.mark.parametrize("config", ["gridworld", "cart_pole", "sparse_point_robot"])
def test_each_key_of_a_policy_file_is_told(tmp_path, config):
    quick = ["preset:=quick"] if config == "cart_pole" else []
    result = run([LOCAL, "run", TOP / "config" / (config + ".yaml"), "rounds:=1",
                  "updates_per_round:=1", "run_id:=r", "results_dir:=%s" % tmp_path] + quick)
    assert result.returncode == 0, result.stderr
    text = (TOP / "docs/running.md").read_text()
    told = re.findall(r"^\| (`.*?) \|", text[text.index("## Policy files"):text.index("## Sweeps")],
                      re.M)
    told = set(re.findall(r"`(\w+)`", " ".join(told)))
    for path in tmp_path.glob("*/r/policies/*.safetensors"):
        data = path.read_bytes()
        header = json.loads(data[8:8 + int.from_bytes(data[:8], "little")])
        assert set(header["__metadata__"]) <= told, path
