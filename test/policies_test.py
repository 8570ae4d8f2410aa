"""The policies that are shipped do what their page says, and hold nothing of where they were made."""

import re

import pytest

from programs import LOCAL, TOP, run

POLICIES = TOP / "config/policies"
SHIPPED = sorted(path.name for path in POLICIES.iterdir() if path.is_dir())


def said_of(name):
    """(PP, MP) in the table of the page."""
    row = re.search(r"^\| `%s` \|(.*)\|$" % name, (POLICIES / "README.md").read_text(), re.M)
    pp, mp = (cell.strip().replace("−", "-") for cell in row.group(1).split("|")[2:4])
    return float(pp), float(mp)


def returns_of(path):
    done = run([LOCAL, "evaluate", path, "--episodes", "5"])
    assert done.returncode == 0, done.stderr
    return {int(task): float(mean)
            for task, mean in re.findall(r"^task (\d+) \S+  return (\S+) ", done.stdout, re.M)}


def test_each_folder_has_a_row():
    rows = re.findall(r"^\| `(\w+)` \|", (POLICIES / "README.md").read_text(), re.M)
    assert sorted(rows) == SHIPPED


# other starts than the page's; a policy of other tasks or of noise is far off
@pytest.mark.parametrize("name", SHIPPED)
def test_they_return_what_the_page_says(name):
    folder = POLICIES / name / "policies"
    personal = {}
    for path in folder.glob("task_*.safetensors"):
        personal.update(returns_of(path))
    meta = returns_of(folder / "meta.safetensors")
    for found, said in zip((personal, {task: meta[task] for task in personal}), said_of(name)):
        mean = sum(found.values()) / len(found)
        assert mean == pytest.approx(said, rel=0.2), (found, said)


@pytest.mark.parametrize("name", SHIPPED)
def test_they_name_no_folder_of_a_machine(name):
    for path in (POLICIES / name).rglob("*"):
        if path.is_file():
            assert not re.search(rb"results_dir: [^~]", path.read_bytes()), path
