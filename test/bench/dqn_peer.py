"""The update of pmeta_bench's DqnUpdate64 in PyTorch.

4 -> 512 -> 512 -> 2 in float32, batch 64, a target network, weighted squared loss, Adam, the pull
towards the auxiliary parameters and their step.
"""
import torch
from torch import nn

BATCH, UNITS = 64, 512
LEARNING_RATE, PULL, FOLLOW = 1e-3, 1e-3 * 20, 1e-3 * 20  # alpha lambda, eta lambda


def problem():
    """Networks that start alike, and a batch."""
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

    return update, list(online.parameters()) + list(auxiliary.parameters())


def tuned(scripted=False):
    """Multi-tensor Adam, no gradients for the target, gradients dropped, nothing copied."""
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

    return update, list(online.parameters()) + list(auxiliary.parameters())


def linear(x, w, bias, out):
    return torch.addmm(bias, x, w.t(), out=out)


def linear_relu_by_addmm(x, w, bias, out):
    return linear(x, w, bias, out).relu_()


def linear_relu_by_onednn(x, w, bias, _):
    return torch._C._nn.mkldnn_linear(x.to_mkldnn(), w, bias).to_dense().relu_()


def by_hand(onednn=False):
    """No autograd: every product into its own buffer, all parameters in one flat vector."""
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
    linear_relu = linear_relu_by_onednn if onednn else linear_relu_by_addmm
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
    return without_autograd, views(phi) + views(omega)


def variants():
    """What each name makes: an update, and the tensors it moves."""
    return {
        "out of the box": plain,
        "multi-tensor Adam": tuned,
        "the same, traced": lambda: tuned(scripted=True),
        "by hand, no autograd": by_hand,
        "by hand, oneDNN forward": lambda: by_hand(onednn=True),
    }
