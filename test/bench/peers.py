#!/usr/bin/python3
"""Times updates of pmeta_bench in PyTorch, in turns with pmeta_bench itself.

usage: peers.py PMETA_BENCH [ROUNDS [UPDATE...]]

UPDATE: dqn, sac or sac_small; all without. The work is the same on both sides (dqn_peer.py,
sac_peer.py). Everything runs on one thread, and CPU time of the whole process counts.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

CORE_TYPES = ["", "Haswell", "Zen", "SkylakeX", "Cooperlake"]
OUT_OF_THE_BOX = "out of the box"
# glibc gives large blocks back to the system at once, and each activation is one
KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": "1073741824", "MALLOC_TRIM_THRESHOLD_": "2147483648",
               "MALLOC_TOP_PAD_": "67108864"}
CHECKED_UPDATES = 10


def dqn():
    import dqn_peer

    return dqn_peer.variants()


def sac(units, batch):
    import sac_peer

    return sac_peer.variants(units, batch)


# title, benchmark, units and batch of its products, seconds of one measurement, variants
UPDATES = {
    "dqn": ("DQN update, 4-512-512-2, batch 64", "DqnUpdate64", (512, 64), 0.6, dqn),
    "sac": ("SAC update, 25+6, [512,512], batch 256", "SacUpdateOf/units:512/batch:256", (512, 256),
            2.0, lambda: sac(512, 256)),
    "sac_small": ("SAC update, 25+6, [128,128], batch 128", "SacUpdateOf/units:128/batch:128",
                  (128, 128), 0.6, lambda: sac(128, 128)),
}


def measure(name, variant):
    """CPU seconds of each update."""
    *_, seconds, variants = UPDATES[name]
    update, _ = variants()[variant]()
    warm_up = time.process_time() + seconds / 4
    while time.process_time() < warm_up:
        update()
    times = []
    until = time.process_time() + seconds
    while time.process_time() < until:
        start = time.process_time()
        update()
        times.append(time.process_time() - start)
    return times


def check_same_work(name):
    """Every variant must take all tensors to where the first one takes them, but for 2 % of the
    way: rounding grows where an activation or the smaller critic changes sides."""
    variants = UPDATES[name][-1]()

    def moved(variant):
        update, tensors = variants[variant]()
        start = [t.detach().clone() for t in tensors]
        for _ in range(CHECKED_UPDATES):
            update()
        return [t.detach() - s for t, s in zip(tensors, start)]

    reference = moved(OUT_OF_THE_BOX)
    for variant in variants:
        off = max(((found - wanted).norm() / wanted.norm()).item()
                  for found, wanted in zip(moved(variant), reference))
        assert off < 0.02, f"'{variant}' does other work than '{OUT_OF_THE_BOX}': off by {off:.3f}"
    return list(variants)


def sgemm_flops(units, batch):
    """Operations a second: mean of a units x units layer's three products at that batch size."""
    import torch

    torch.set_num_threads(1)
    x, w, y, d = (torch.rand(n, units) for n in (batch, units, batch, units))
    total = 0
    for call in (lambda: torch.mm(x, w.t(), out=y), lambda: torch.mm(y.t(), x, out=d),
                 lambda: torch.mm(y, w, out=x)):
        times = []
        for _ in range(300):
            start = time.process_time()
            call()
            times.append(time.process_time() - start)
            # products of products would overflow
            y.fill_(0.5)
            x.fill_(0.5)
        total += undisturbed_and_median(times)[0]
    return 3 * 2 * batch * units * units / total


def undisturbed_and_median(times):
    """The tenth percentile, as pmeta_bench takes it, and the median."""
    times = sorted(times)
    return times[len(times) // 10], times[len(times) // 2]


def child(settings, task, *arguments):
    """One task in a process of its own, which is how OpenBLAS and glibc are told."""
    environment = {name: value for name, value in os.environ.items()
                   if name != "OPENBLAS_CORETYPE" and name not in KEEP_MEMORY}
    environment.update(settings, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
    result = subprocess.run([sys.executable, os.path.abspath(__file__), task, *arguments],
                            env=environment, stdout=subprocess.PIPE, text=True)
    return json.loads(result.stdout) if result.returncode == 0 else None


def measured(settings, name, variant):
    times = child(settings, "--measure", name, variant)
    if times is None:
        sys.exit(f"peers.py: PyTorch's {name} update, '{variant}', has failed.")
    return undisturbed_and_median(times)


def pmeta_seconds(name, bench):
    """Undisturbed and median seconds of pMeta's update."""
    benchmark, seconds = UPDATES[name][1], UPDATES[name][3]
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        subprocess.run([bench, f"--benchmark_filter=^{benchmark}$", "--benchmark_repetitions=1",
                        "--benchmark_enable_random_interleaving=false",
                        f"--benchmark_min_time={seconds}", f"--benchmark_out={out.name}",
                        "--benchmark_out_format=json"], check=True, capture_output=True)
        run = json.load(open(out.name))["benchmarks"][0]
    return run["call_us"] * 1e-6, run["median_us"] * 1e-6


def blas_kernels(units, batch):
    """The OPENBLAS_CORETYPE with the fastest sgemm on this processor; the dispatched one where a
    choice gains less than the noise."""
    print(f"its sgemm at a {units} x {units} layer, batch {batch}:")
    rates = dict.fromkeys(CORE_TYPES, 0)
    for _ in range(2):
        for core_type in CORE_TYPES:
            settings = {"OPENBLAS_CORETYPE": core_type} if core_type else {}
            # kernels for another processor end the child, not us
            rate = child(settings, "--sgemm", str(units), str(batch))
            rates[core_type] = max(rates[core_type], rate or 0)
    for core_type, rate in rates.items():
        name = f"OPENBLAS_CORETYPE={core_type}" if core_type else "as it dispatches"
        print(f"  {name:<30} {1e-9 * rate:6.1f} GFLOP/s" if rate else f"  {name:<30} does not run")
    best = max(rates, key=rates.get)
    return best if rates[best] > 1.03 * rates[""] else ""


def compare(name, bench, rounds):
    title, _, layer, *_ = UPDATES[name]
    print(f"\n{title}\n")
    core_type = blas_kernels(*layer)
    kernels = {"OPENBLAS_CORETYPE": core_type} if core_type else {}
    kernels_text = f"{core_type or 'the dispatched'} kernels"

    variants = check_same_work(name)
    # what is measured in each: settings, variant, and its times
    groups = {"with no settings": [({}, OUT_OF_THE_BOX, [])],
              kernels_text: [(kernels, variant, []) for variant in variants],
              f"{kernels_text}, memory kept": [({**kernels, **KEEP_MEMORY}, variant, [])
                                               for variant in variants]}
    pmeta = []
    for _ in range(rounds):
        pmeta.append(pmeta_seconds(name, bench))
        for group in groups.values():
            for settings, variant, found in group:
                found.append(measured(settings, name, variant))

    # of all rounds, the best percentile and the median of the medians
    def over_rounds(found):
        return 1e3 * min(t for t, _ in found), 1e3 * statistics.median(t for _, t in found)

    pmeta_ms, pmeta_median = over_rounds(pmeta)
    print(f"\none update: CPU time of one thread, {rounds} rounds in turns\n")
    print(f"{'peer':44} {'ms':>6} {'median':>7} {'pMeta ms':>9} {'ratio':>6}")

    def row(label, found):
        ms, median = over_rounds(found)
        print(f"{label:44} {ms:6.2f} {median:7.2f} {pmeta_ms:9.2f} {ms / pmeta_ms:6.2f}")

    for settings_text, group in groups.items():
        print(f"PyTorch, {settings_text}:")
        for _, variant, found in group:
            row("  " + variant, found)
        if len(group) > 1:
            with_autograd = [found for _, variant, found in group if "by hand" not in variant]
            row("  the best of these with autograd", min(with_autograd, key=over_rounds))
            row("  the best of these", min((found for *_, found in group), key=over_rounds))
    print(f"{'pMeta':44} {pmeta_ms:6.2f} {pmeta_median:7.2f} {pmeta_ms:9.2f} {1:6.2f}", flush=True)


def main(bench, rounds=4, *names):
    import torch

    unknown = set(names) - set(UPDATES)
    if unknown:
        sys.exit(f"peers.py: no update '{unknown.pop()}': choose from {', '.join(UPDATES)}.")
    print(f"PyTorch {torch.__version__}, {os.path.realpath('/usr/lib/x86_64-linux-gnu/libblas.so.3')}")
    for name in names or UPDATES:
        compare(name, bench, int(rounds))


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip())
    elif sys.argv[1] == "--sgemm":
        print(json.dumps(sgemm_flops(int(sys.argv[2]), int(sys.argv[3]))))
    elif sys.argv[1] == "--measure":
        print(json.dumps(measure(*sys.argv[2:])))
    else:
        main(*sys.argv[1:])
