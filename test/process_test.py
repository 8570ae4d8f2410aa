"""What shell, system and terminal do to a program: closed descriptors, its end, limits."""
import json
import os
import signal
import subprocess

import pytest

from programs import CONFIG, LOCAL, TOP, rows, run

CART_POLE = TOP / "config/cart_pole.yaml"
SMALL = ["preset:=quick", "hidden:=[64,64]", "rounds:=1", "updates_per_round:=20",
         "evaluation_episodes:=1"]


def grid(tmp_path, *more):
    return [str(word) for word in [LOCAL, "run", CONFIG, "run_id:=r",
                                   "results_dir:=%s" % tmp_path] + list(more)]


def folder(tmp_path):
    return tmp_path / "gridworld/r"


def manifest(tmp_path):
    return json.loads((folder(tmp_path) / "manifest.json").read_text())


def shell(tmp_path, text, *more):
    """A command of bash in which "$@" is a run of the gridworld."""
    return run(["bash", "-c", text, "bash"] + grid(tmp_path, *more))


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_descriptor_does_not_become_a_file_of_the_run(tmp_path, closed):
    assert shell(tmp_path / "a", '"$@" ' + closed, "rounds:=3").returncode == 0
    assert run(grid(tmp_path / "b", "rounds:=3")).returncode == 0
    assert rows(folder(tmp_path / "a")) == rows(folder(tmp_path / "b"))


def test_a_reader_that_goes_away_stops_nothing(tmp_path):
    done = shell(tmp_path, 'set -o pipefail; "$@" | head -n 1', "rounds:=300")
    assert done.returncode == 0, done.stderr
    assert (manifest(tmp_path)["status"], manifest(tmp_path)["rounds_done"]) == ("finished", 300)


def begin(tmp_path, *more, **kwargs):
    """A run that has written some rounds."""
    process = subprocess.Popen(grid(tmp_path, "rounds:=1000000", *more), stderr=subprocess.PIPE,
                               stdout=subprocess.PIPE, universal_newlines=True, **kwargs)
    while not process.stdout.readline().lstrip().startswith("round"):
        assert process.poll() is None, process.stderr.read()
    return process


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_run_that_is_told_to_stop_keeps_its_rounds(tmp_path, sent):
    # whatever the tests' own parent ignores
    process = begin(tmp_path, preexec_fn=lambda: signal.signal(sent, signal.SIG_DFL))
    process.send_signal(sent)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert manifest(tmp_path)["status"] == "stopped"
    assert rows(folder(tmp_path))[-1].startswith("%d," % manifest(tmp_path)["rounds_done"])


def test_under_nohup_a_closed_terminal_stops_nothing(tmp_path):
    process = begin(tmp_path, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    process.send_signal(signal.SIGHUP)
    for _ in range(3):
        assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130


def test_a_limit_on_file_sizes_is_told_as_a_full_disk(tmp_path):
    done = shell(tmp_path, 'ulimit -f 16; "$@"', "rounds:=100", "checkpoint.interval:=0")
    assert done.returncode == 1
    assert "rounds.csv (File too large): is the disk full?" in done.stderr


def test_a_stack_that_is_too_small_is_refused(tmp_path):
    done = shell(tmp_path, 'ulimit -s 64; "$@"')
    assert done.returncode == 1
    assert done.stderr == ("pmeta: the stack is limited to 64 kB but 1024 kB are needed: "
                           "ulimit -s 8192.\n")


def test_output_that_is_lost_is_no_success():
    done = run(["bash", "-c", '"$@" > /dev/full', "bash", LOCAL, "check", CONFIG])
    assert done.returncode == 1
    assert done.stderr.endswith("pmeta: standard output cannot be written: is its disk full?\n")


def test_a_fifo_is_refused_at_once_but_settings_may_come_from_a_command(tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(str(fifo))
    for command in (["evaluate", fifo], ["check", fifo], ["replay", "cartpole", fifo],
                    ["replay", "sparse_point", TOP / "test/data/sparse_point_traj.csv.gz",
                     "--tasks", fifo],
                    ["run", TOP / "config/half_cheetah_dir.yaml", "model_file:=%s" % fifo,
                     "results_dir:=%s" % tmp_path]):
        done = run([LOCAL] + command, timeout=30)
        assert done.returncode == 1
        assert "%s cannot be read (it is not a regular file)." % fifo in done.stderr, command
    for name in ("manifest.json", "rounds.csv"):
        kept = tmp_path / name
        assert begin_and_stop(kept) == 130
        (folder(kept) / name).unlink()
        os.mkfifo(str(folder(kept) / name))
        done = run([LOCAL, "run", CONFIG, "resume:=%s" % folder(kept)], timeout=30)
        assert done.returncode == 1
        assert "cannot be read (it is not a regular file)." in done.stderr, name
    done = run(["bash", "-c", '"$1" check <(cat "$2") rounds:=7', "bash", LOCAL, CONFIG])
    assert done.returncode == 0 and "rounds: 7\n" in done.stdout, done.stderr


def begin_and_stop(tmp_path):
    process = begin(tmp_path, "checkpoint.interval:=1")
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    return process.returncode


def test_an_evaluation_ends_at_once(tmp_path):
    assert run([LOCAL, "run", CART_POLE, "run_id:=r", "results_dir:=%s" % tmp_path] +
               SMALL).returncode == 0
    policy = tmp_path / "cart_pole/r/policies/meta.safetensors"
    process = subprocess.Popen([str(LOCAL), "evaluate", str(policy), "--episodes", "1000000"],
                               stdout=subprocess.PIPE, universal_newlines=True)
    assert "meta-policy of" in process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGTERM


def parameters(path):
    """The bytes of a policy file behind its header, which names the results folder."""
    data = path.read_bytes()
    return data[8 + int.from_bytes(data[:8], "little"):]


def test_portable_arithmetic_does_not_ask_which_processor_it_runs_on(tmp_path):
    found = {}
    for arithmetic in ("native", "portable"):
        for instructions in ("SSE41", "DEFAULT"):
            results = tmp_path / arithmetic / instructions
            done = run([LOCAL, "run", CART_POLE, "run_id:=r", "arithmetic:=" + arithmetic,
                        "results_dir:=%s" % results] + SMALL,
                       env=dict(os.environ, ONEDNN_MAX_CPU_ISA=instructions))
            assert done.returncode == 0, done.stderr
            written = json.loads((results / "cart_pole/r/manifest.json").read_text())
            machine = written["machine"]
            policy = parameters(results / "cart_pole/r/policies/meta.safetensors")
            found.setdefault(arithmetic, {})[machine["products"]] = policy
            found.setdefault(arithmetic + " policies", set()).add(policy)
    assert len(found["portable policies"]) == 1
    # what differs between processors would show
    assert len(found["native policies"]) == len(found["native"])


def test_portable_parameters_are_the_pinned_ones_whatever_onednn_may_use():
    for instructions in ("SSE41", "AVX2"):
        done = run([TOP / "devel/lib/pmeta_core/core_test", "--gtest_filter=Pinned/Parameters.*"],
                   env=dict(os.environ, ONEDNN_MAX_CPU_ISA=instructions))
        assert done.returncode == 0 and "[  PASSED  ] 8 tests." in done.stdout, done.stdout


def test_a_run_that_goes_on_elsewhere_says_so(tmp_path):
    command = [LOCAL, "run", CART_POLE, "results_dir:=%s" % tmp_path, "checkpoint.interval:=1",
               "preset:=quick", "hidden:=[16]", "rounds:=1000000", "updates_per_round:=1",
               "evaluation_episodes:=1", "run_id:=r"]
    path = tmp_path / "cart_pole/r"
    for resumed in (False, True):
        process = subprocess.Popen([str(word) for word in (
            [LOCAL, "run", CART_POLE, "resume:=%s" % path] if resumed else command)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
        while not process.stdout.readline().lstrip().startswith("round"):
            assert process.poll() is None, process.stderr.read()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        assert process.returncode == 130
        sentence = "the run was begun on another machine (products 'oneDNN 1.0.0 (AVX9)', here '"
        assert (sentence in said) == resumed, said
        if not resumed:
            written = json.loads((path / "manifest.json").read_text())
            written["machine"]["products"] = "oneDNN 1.0.0 (AVX9)"
            (path / "manifest.json").write_text(json.dumps(written))
