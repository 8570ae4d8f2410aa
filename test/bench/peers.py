#!/usr/bin/python3
"""Times the update of pmeta_bench's DqnUpdate64 in PyTorch, in turns with pmeta_bench itself.

usage: peers.py PMETA_BENCH [ROUNDS]

The work is the same on both sides: 4 -> 512 -> 512 -> 2 in float32, batch 64, a target network,
weighted squared loss, Adam, the pull towards the auxiliary parameters and their step. Everything
runs on one thread, and CPU time of the whole process counts.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

BATCH, UNITS = 64, 512
LEARNING_RATE, PULL, FOLLOW = 1e-3, 1e-3 * 20, 1e-3 * 20  # alpha lambda, eta lambda
BENCHMARK = "DqnUpdate64"
CORE_TYPES = ["", "Haswell", "Zen", "SkylakeX", "Cooperlake"]


def problem():
    """Networks that start alike, and a batch."""
    import torch
    from torch import nn

    torch.set_num_threads(1)
    torch.manual_seed(0)
    make = lambda: nn.Sequential(nn.Linear(4, UNITS), nn.ReLU(), nn.Linear(UNITS, UNITS), nn.ReLU(),
                                 nn.Linear(UNITS, 2))
    online, target, auxiliary = make(), make(), make()
    target.load_state_dict(online.state_dict())
    auxiliary.load_state_dict(online.state_dict())
    batch = {
        "observations": 2 * torch.rand(BATCH, 4) - 1,
        "next_observations": 0.9 * (2 * torch.rand(BATCH, 4) - 1),
        "actions": (torch.arange(BATCH) % 2).unsqueeze(1),
        "rewards": torch.ones(BATCH, 1),
        "discounts": torch.full((BATCH, 1), 0.99),
        "weights": torch.full((BATCH, 1), 0.5),
    }
    return online, target, auxiliary, batch


def plain():
    """As one writes it first: torch.optim.Adam's defaults, the pull in a loop."""
    import torch

    online, target, auxiliary, b = problem()
    optimizer = torch.optim.Adam(online.parameters(), lr=LEARNING_RATE)

    def update():
        with torch.no_grad():
            best = target(b["next_observations"]).max(1, keepdim=True)[0]
            wanted = b["rewards"] + b["discounts"] * best
        q = online(b["observations"]).gather(1, b["actions"])
        loss = (b["weights"] * (q - wanted) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            for phi, omega in zip(online.parameters(), auxiliary.parameters()):
                phi -= PULL * (phi - omega)
                omega += FOLLOW * (phi - omega)

    return update, online


def tuned(scripted=False):
    """Multi-tensor Adam, no gradients for the target, gradients dropped, nothing copied."""
    import torch

    online, target, auxiliary, b = problem()
    forward, evaluate = online, target
    if scripted:
        forward = torch.jit.trace(online, b["observations"])
        evaluate = torch.jit.trace(target, b["observations"])
    parameters, followers = list(online.parameters()), list(auxiliary.parameters())
    optimizer = torch.optim.Adam(parameters, lr=LEARNING_RATE, foreach=True)
    rewards, discounts, weights = b["rewards"], b["discounts"], b["weights"] / BATCH
    observations, next_observations, actions = (
        b["observations"], b["next_observations"], b["actions"])

    def update():
        with torch.no_grad() if scripted else torch.inference_mode():
            best = evaluate(next_observations).amax(1, keepdim=True)
            wanted = torch.addcmul(rewards, discounts, best)
        error = forward(observations).gather(1, actions).sub(wanted.clone() if scripted else wanted)
        optimizer.zero_grad(set_to_none=True)
        (error * error * weights).sum().backward()
        optimizer.step()
        with torch.no_grad():
            for phi, omega in zip(parameters, followers):
                phi.lerp_(omega, PULL)
                omega.lerp_(phi, FOLLOW)

    return update, online


def by_hand(onednn=False):
    """No autograd: every product into its own buffer, all parameters in one flat vector."""
    import torch

    online, target, auxiliary, b = problem()
    flatten = lambda module: torch.cat([p.detach().reshape(-1) for p in module.parameters()])
    shapes = [p.shape for p in online.parameters()]

    def views(vector):
        parts = vector.split([shape.numel() for shape in shapes])
        return [part.view(shape) for part, shape in zip(parts, shapes)]

    phi, omega = flatten(online), flatten(auxiliary)
    gradient, moment, square, denominator = (torch.zeros_like(phi) for _ in range(4))
    w1, b1, w2, b2, w3, b3 = views(phi)
    gw1, gb1, gw2, gb2, gw3, gb3 = views(gradient)
    t1, tb1, t2, tb2, t3, tb3 = (p.detach() for p in target.parameters())
    for parameter, view in zip(online.parameters(), views(phi)):
        parameter.data = view
    h1, h2, k1, k2, d1, d2 = (torch.empty(BATCH, UNITS) for _ in range(6))
    q, next_q, dq = (torch.empty(BATCH, 2) for _ in range(3))
    rewards, discounts, weights = b["rewards"], b["discounts"], b["weights"] * 2 / BATCH
    observations, next_observations, actions = (
        b["observations"], b["next_observations"], b["actions"])
    linear = lambda x, w, bias, out: torch.addmm(bias, x, w.t(), out=out)
    if onednn:
        linear_relu = lambda x, w, bias, out: torch._C._nn.mkldnn_linear(
            x.to_mkldnn(), w, bias).to_dense().relu_()
    else:
        linear_relu = lambda x, w, bias, out: linear(x, w, bias, out).relu_()
    step = 0

    def update():
        nonlocal step
        y1 = linear_relu(next_observations, t1, tb1, k1)
        y2 = linear_relu(y1, t2, tb2, k2)
        wanted = torch.addcmul(rewards, discounts, linear(y2, t3, tb3, next_q).amax(1, True))
        x1 = linear_relu(observations, w1, b1, h1)
        x2 = linear_relu(x1, w2, b2, h2)
        error = linear(x2, w3, b3, q).gather(1, actions).sub_(wanted).mul_(weights)
        dq.zero_().scatter_(1, actions, error)

        torch.mm(dq.t(), x2, out=gw3)
        torch.sum(dq, 0, out=gb3)
        torch.ops.aten.threshold_backward(torch.mm(dq, w3, out=d2), x2, 0, grad_input=d2)
        torch.mm(d2.t(), x1, out=gw2)
        torch.sum(d2, 0, out=gb2)
        torch.ops.aten.threshold_backward(torch.mm(d2, w2, out=d1), x1, 0, grad_input=d1)
        torch.mm(d1.t(), observations, out=gw1)
        torch.sum(d1, 0, out=gb1)

        step += 1
        moment.lerp_(gradient, 0.1)
        square.mul_(0.999).addcmul_(gradient, gradient, value=0.001)
        torch.sqrt(square, out=denominator)
        denominator.mul_(1 / (1 - 0.999**step) ** 0.5).add_(1e-8)
        phi.addcdiv_(moment, denominator, value=-LEARNING_RATE / (1 - 0.9**step))
        phi.lerp_(omega, PULL)
        omega.lerp_(phi, FOLLOW)

    def without_autograd():
        with torch.inference_mode():
            update()

    # buffers made outside of inference mode stay ordinary tensors
    return without_autograd, online


VARIANTS = {
    "out of the box": plain,
    "multi-tensor Adam": tuned,
    "multi-tensor Adam, traced": lambda: tuned(scripted=True),
    "by hand, no autograd": by_hand,
    "by hand, oneDNN forward": lambda: by_hand(onednn=True),
}


def measure(name, seconds):
    """CPU seconds of each update."""
    update, _ = VARIANTS[name]()
    for _ in range(30):
        update()
    times = []
    until = time.process_time() + seconds
    while time.process_time() < until:
        start = time.process_time()
        update()
        times.append(time.process_time() - start)
    return times


def parameters_after(name, updates):
    import torch

    update, online = VARIANTS[name]()
    for _ in range(updates):
        update()
    return torch.cat([p.detach().reshape(-1) for p in online.parameters()])


def sgemm_flops():
    """Operations a second: mean of a 512 x 512 layer's three products at batch 64."""
    import torch

    torch.set_num_threads(1)
    x, w, y, d = (torch.rand(n, UNITS) for n in (BATCH, UNITS, BATCH, UNITS))
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
    return 3 * 2 * BATCH * UNITS * UNITS / total


def undisturbed_and_median(times):
    """The tenth percentile, as pmeta_bench takes it, and the median."""
    times = sorted(times)
    return times[len(times) // 10], times[len(times) // 2]


def child(core_type, task, *arguments):
    """One task in a process of its own, which is how OpenBLAS is told its kernels."""
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
    environment.pop("OPENBLAS_CORETYPE", None)
    if core_type:
        environment["OPENBLAS_CORETYPE"] = core_type
    result = subprocess.run([sys.executable, os.path.abspath(__file__), task, *arguments],
                            env=environment, capture_output=True, text=True)
    return json.loads(result.stdout) if result.returncode == 0 else None


def pmeta_seconds(bench):
    """Undisturbed and median seconds of pMeta's update."""
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        subprocess.run([bench, f"--benchmark_filter=^{BENCHMARK}$", "--benchmark_repetitions=1",
                        "--benchmark_min_time=0.5", f"--benchmark_out={out.name}",
                        "--benchmark_out_format=json"], check=True, capture_output=True)
        run = json.load(open(out.name))["benchmarks"][0]
    return run["call_us"] * 1e-6, run["median_us"] * 1e-6


def blas_kernels():
    """The OPENBLAS_CORETYPE with the fastest sgemm on this processor; the dispatched one where a
    choice gains less than the noise."""
    rates = dict.fromkeys(CORE_TYPES, 0)
    for _ in range(2):
        for core_type in CORE_TYPES:
            # kernels for another processor end the child, not us
            rates[core_type] = max(rates[core_type], child(core_type, "--sgemm") or 0)
    for core_type, rate in rates.items():
        name = f"OPENBLAS_CORETYPE={core_type}" if core_type else "as it dispatches"
        print(f"  {name:<30} {1e-9 * rate:6.1f} GFLOP/s" if rate else f"  {name:<30} does not run")
    best = max(rates, key=rates.get)
    return best if rates[best] > 1.03 * rates[""] else ""


def main(bench, rounds):
    import torch

    print(f"PyTorch {torch.__version__}, {os.path.realpath('/usr/lib/x86_64-linux-gnu/libblas.so.3')}")
    print("its sgemm at a 512 x 512 layer, batch 64:")
    best_core = blas_kernels()

    reference = parameters_after("out of the box", 20)
    for name in VARIANTS:
        off = (parameters_after(name, 20) - reference).abs().max().item()
        assert off < 1e-4, f"'{name}' does other work: off by {off} after 20 updates"

    cases = [("out of the box", "")]
    cases += [(name, best_core) for name in VARIANTS if (name, best_core) != cases[0]]
    times = {case: [] for case in cases}
    pmeta = []
    for _ in range(rounds):
        pmeta.append(pmeta_seconds(bench))
        for case in cases:
            times[case].append(undisturbed_and_median(child(case[1], "--measure", case[0])))

    # of all rounds, the best percentile and the median of the medians
    def over_rounds(measured):
        return min(t for t, _ in measured), statistics.median(t for _, t in measured)

    pmeta_ms, pmeta_median = (1e3 * t for t in over_rounds(pmeta))
    print(f"\none update: CPU time of one thread, {rounds} rounds in turns\n")
    print(f"{'peer':44} {'ms':>6} {'median':>7} {'pMeta ms':>9} {'ratio':>6}")

    def row(name, case):
        ms, median = (1e3 * t for t in over_rounds(times[case]))
        print(f"{name:44} {ms:6.2f} {median:7.2f} {pmeta_ms:9.2f} {ms / pmeta_ms:6.2f}")

    row("PyTorch, out of the box", cases[0])
    print(f"PyTorch, well configured, {best_core or 'the dispatched'} kernels:")
    for case in cases[1:]:
        row("  " + case[0], case)
    best = min(cases[1:], key=lambda case: over_rounds(times[case])[0])
    row("  the best of these", best)
    print(f"{'pMeta':44} {pmeta_ms:6.2f} {pmeta_median:7.2f} {pmeta_ms:9.2f} {1:6.2f}")


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip())
    elif sys.argv[1] == "--sgemm":
        print(json.dumps(sgemm_flops()))
    elif sys.argv[1] == "--measure":
        print(json.dumps(measure(sys.argv[2], 0.6)))
    else:
        main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 4)
