"""Whether two builds learn the same, bit for bit: ./pmeta same."""

import csv
import hashlib
import pathlib
import subprocess
import sys
import tempfile

RUNS = pathlib.Path(__file__).with_name("same_runs.txt")


def planned(names):
    """[(name, experiment, settings)] of same_runs.txt; of `names`, if there are any."""
    lines = [line.split() for line in RUNS.read_text().splitlines() if line[:1] not in ("", "#")]
    known = [words[0] for words in lines]
    for name in names:
        if name not in known:
            sys.exit("./pmeta same: there is no run %r: there are %s." % (name, ", ".join(known)))
    return [(words[0], words[1], words[2:]) for words in lines if not names or words[0] in names]


def learnt(tree, name, experiment, settings, folder):
    """{what: hash} of a run's returns and of each policy's parameters; the program's last line if
    it failed."""
    done = subprocess.run(
        [str(tree / "devel/lib/pmeta_core/pmeta_local"), "run",
         str(tree / "config" / (experiment + ".yaml")), *settings,
         "results_dir:=%s" % folder, "run_id:=%s" % name],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0:
        return {"failure": (done.stderr.splitlines() or ["no output"])[-1]}
    run = folder / experiment / name
    with open(run / "rounds.csv", newline="") as file:
        rows = [sorted((key, value) for key, value in row.items() if key != "wall_s")
                for row in csv.DictReader(file)]
    found = {"rounds.csv": hashlib.sha256(repr(rows).encode()).hexdigest()}
    for policy in sorted((run / "policies").glob("*.safetensors")):
        data = policy.read_bytes()
        # the header, whose length comes first, also tells the version
        values = data[8 + int.from_bytes(data[:8], "little"):]
        found[policy.name] = hashlib.sha256(values).hexdigest()
    return found


def main(before, after, *names):
    trees = [pathlib.Path(before).resolve(), pathlib.Path(after).resolve()]
    different = 0
    for name, experiment, settings in planned(names):
        with tempfile.TemporaryDirectory() as folder:
            results = [learnt(tree, name, experiment, settings, pathlib.Path(folder) / str(i))
                       for i, tree in enumerate(trees)]
        unlike = sorted(key for key in results[0].keys() | results[1].keys()
                        if results[0].get(key) != results[1].get(key))
        failures = [result["failure"] for result in results if "failure" in result]
        different += bool(unlike or failures)
        print("%-22s %s" % (name, "failed: " + failures[0] if failures else
                            "DIFFERS in " + ", ".join(unlike) if unlike else
                            "same, %d policies" % (len(results[0]) - 1)), flush=True)
    print("%d of the runs differ" % different if different else "all the same")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
