"""The arguments of launch/experiment.launch are the list that all else goes by."""

import argparse
import re
import sys
from xml.etree import ElementTree

import pytest
import yaml

from programs import TOP, environment, run

sys.path.insert(0, str(TOP / "src/pmeta_nodes/scripts"))
import chaos

LAUNCH = TOP / "launch"
EXPERIMENTS = sorted(path.stem for path in (TOP / "config").glob("*.yaml")
                     if path.stem != "convergence")


def root_of(name):
    return ElementTree.parse(str(LAUNCH / (name + ".launch"))).getroot()


def arguments_of(root):
    """Those that a caller may give, in the order of the file."""
    return [arg.get("name") for arg in root.findall("arg") if "value" not in arg.attrib]


def test_every_experiment_has_a_launch_file_that_hands_on_all_arguments():
    known = arguments_of(root_of("experiment"))
    for name in EXPERIMENTS:
        root = root_of(name)
        include, = root.findall("include")
        assert include.get("file") == "$(dirname)/experiment.launch"
        assert include.get("pass_all_args") == "true"
        assert [arg.get("name") for arg in include.findall("arg")] == ["config"]
        assert set(arguments_of(root)) <= set(known) - {"config"}


def test_every_argument_says_what_it_is_and_is_used():
    root = root_of("experiment")
    text = (LAUNCH / "experiment.launch").read_text()
    for arg in root.findall("arg"):
        name = arg.get("name")
        assert "value" in arg.attrib or arg.get("doc"), name
        # rviz.launch is given all
        uses = text + (LAUNCH / "rviz.launch").read_text()
        assert re.search(r"\$\(arg %s\)|arg\('%s'\)" % (name, name), uses), name
        if arg.get("default") == "" and name != "uplink":
            assert "%s:=$(arg %s)" % (name, name) in text, "%s is not handed on" % name
    lines, = [arg.get("value") for arg in root.findall("arg") if arg.get("name") == "lines"]
    assert set(re.findall(r"(\w+):=", lines)) <= set(arguments_of(root))
    assert set(arguments_of(root_of("rviz"))) <= {arg.get("name") for arg in root.findall("arg")
                                                  } | {"rviz_args"}
    assert set(arguments_of(root_of("agent"))) <= set(arguments_of(root)) | {"task", "check"}


@pytest.mark.parametrize("experiment", sorted(chaos.EXPERIMENTS))
def test_the_chaos_run_is_launched_with_the_settings_of_its_undisturbed_twin(tmp_path, experiment):
    options = argparse.Namespace(seed=3, kills=10, rounds=0)
    words = chaos.Run(experiment, options, tmp_path).launch_arguments()
    # the key is made by the run itself
    words = [word for word in words if not word.startswith("key_file:=")]
    result = run(["roslaunch", "--dump-params", "pmeta_nodes", experiment + ".launch"] + words,
                 env=environment(tmp_path))
    settings = yaml.safe_load(yaml.safe_load(result.stdout)["/pmeta/config"])
    flat = dict(settings, **{"%s.%s" % (group, key): value for group, values in settings.items()
                             if isinstance(values, dict) for key, value in values.items()})
    for word in words:
        key, value = word.split(":=", 1)
        assert flat[key] == yaml.safe_load(value), key
