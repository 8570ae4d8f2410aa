"""The update of pmeta_bench's SacUpdateOf in PyTorch.

Actor 25 -> h -> h -> 12 and twin critics 31 -> h -> h -> 1 with targets, in float32: a batch drawn
from the replay, the critics' targets, the critics' step, the actor's step with the moved critics,
the temperature's step; Adam, the pull towards the auxiliary parameters and their step for actor and
critics, tau 0.005 for the targets.
"""
import copy
import math

import torch
from torch import nn
from torch.nn import functional

OBSERVATION, ACTION, ROWS = 25, 6, 1001
LEARNING_RATE, PULL, FOLLOW = 1e-3, 1e-3 * 15, 1e-2 * 15  # alpha lambda, eta lambda
TAU, GAMMA, TEMPERATURE, TARGET_ENTROPY = 0.005, 0.99, 0.2, -ACTION
MIN_LOG_STD, MAX_LOG_STD = -5, 2


def network(inputs, units, outputs):
    return nn.Sequential(nn.Linear(inputs, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(),
                         nn.Linear(units, outputs))


class Critics(nn.Module):
    """Two of them; in and out as many rows."""

    def __init__(self, units):
        super().__init__()
        self.first = network(OBSERVATION + ACTION, units, 1)
        self.second = network(OBSERVATION + ACTION, units, 1)

    def forward(self, rows):
        return self.first(rows), self.second(rows)


class Replay:
    def __init__(self):
        self.observations = 2 * torch.rand(ROWS, OBSERVATION) - 1
        self.next_observations = 2 * torch.rand(ROWS, OBSERVATION) - 1
        self.actions = 2 * torch.rand(ROWS, ACTION) - 1
        self.rewards = self.actions[:, :1] * self.observations[:, :1]
        self.discounts = torch.full((ROWS, 1), GAMMA)

    def sample(self, batch):
        rows = torch.randint(ROWS, (batch,))
        return (self.observations[rows], self.actions[rows], self.rewards[rows],
                self.discounts[rows], self.next_observations[rows])


class Problem:
    """Networks that start alike, a replay, and the seed of all that is drawn afterwards."""

    def __init__(self, units):
        torch.set_num_threads(1)
        torch.manual_seed(0)
        self.actor, self.critics = network(OBSERVATION, units, 2 * ACTION), Critics(units)
        self.auxiliary_actor = network(OBSERVATION, units, 2 * ACTION)
        self.auxiliary_critics, self.targets = Critics(units), Critics(units)
        self.auxiliary_actor.load_state_dict(self.actor.state_dict())
        self.auxiliary_critics.load_state_dict(self.critics.state_dict())
        self.targets.load_state_dict(self.critics.state_dict())
        self.replay = Replay()
        torch.manual_seed(1)

    def tensors(self):
        """All that an update moves, except the temperature, which moves the actor."""
        modules = (self.actor, self.critics, self.targets, self.auxiliary_actor,
                   self.auxiliary_critics)
        return [p for module in modules for p in module.parameters()]


def plain(units, batch):
    """As one writes it first: torch.distributions, torch.optim.Adam's defaults, loops."""
    from torch.distributions import Normal, TanhTransform, TransformedDistribution

    p = Problem(units)
    log_alpha = torch.tensor(math.log(TEMPERATURE), requires_grad=True)
    actor_optimizer = torch.optim.Adam(p.actor.parameters(), lr=LEARNING_RATE)
    critic_optimizer = torch.optim.Adam(p.critics.parameters(), lr=LEARNING_RATE)
    alpha_optimizer = torch.optim.Adam([log_alpha], lr=LEARNING_RATE)

    def act(observations):
        mean, log_std = p.actor(observations).chunk(2, dim=1)
        normal = Normal(mean, log_std.clamp(MIN_LOG_STD, MAX_LOG_STD).exp())
        policy = TransformedDistribution(normal, TanhTransform(cache_size=1))
        actions = policy.rsample()
        return actions, policy.log_prob(actions).sum(1, keepdim=True)

    def step(optimizer, loss, module, auxiliary):
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            for phi, omega in zip(module.parameters(), auxiliary.parameters()):
                phi -= PULL * (phi - omega)
                omega += FOLLOW * (phi - omega)

    def update():
        observations, actions, rewards, discounts, next_observations = p.replay.sample(batch)
        alpha = log_alpha.exp().detach()
        with torch.no_grad():
            next_actions, next_log_prob = act(next_observations)
            q1, q2 = p.targets(torch.cat([next_observations, next_actions], 1))
            wanted = rewards + discounts * (torch.min(q1, q2) - alpha * next_log_prob)
        q1, q2 = p.critics(torch.cat([observations, actions], 1))
        loss = functional.mse_loss(q1, wanted) + functional.mse_loss(q2, wanted)
        step(critic_optimizer, loss, p.critics, p.auxiliary_critics)

        new_actions, log_prob = act(observations)
        q1, q2 = p.critics(torch.cat([observations, new_actions], 1))
        loss = (alpha * log_prob - torch.min(q1, q2)).mean()
        step(actor_optimizer, loss, p.actor, p.auxiliary_actor)

        alpha_optimizer.zero_grad()
        (-log_alpha * (log_prob.detach() + TARGET_ENTROPY).mean()).backward()
        alpha_optimizer.step()
        with torch.no_grad():
            for target, phi in zip(p.targets.parameters(), p.critics.parameters()):
                target.copy_((1 - TAU) * target + TAU * phi)

    return update, p.tensors()


def squashed(heads, noise):
    """Actions, and log pi by log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2 u))."""
    mean, log_std = heads.split(ACTION, 1)
    log_std = log_std.clamp(MIN_LOG_STD, MAX_LOG_STD)
    u = torch.addcmul(mean, log_std.exp(), noise)
    density = 2 * (u + functional.softplus(-2 * u)) - log_std - 0.5 * noise * noise
    constant = ACTION * (0.5 * math.log(2 * math.pi) + 2 * math.log(2))
    return torch.tanh(u), density.sum(1, keepdim=True) - constant


class Wanted(nn.Module):
    """The critics' targets."""

    def __init__(self, actor, targets):
        super().__init__()
        self.actor, self.targets = actor, targets

    def forward(self, next_observations, noise, rewards, discounts, alpha):
        actions, log_prob = squashed(self.actor(next_observations), noise)
        q1, q2 = self.targets(torch.cat([next_observations, actions], 1))
        return torch.addcmul(rewards, discounts, torch.min(q1, q2) - alpha * log_prob)


class CriticLoss(nn.Module):
    def __init__(self, critics):
        super().__init__()
        self.critics = critics

    def forward(self, rows, wanted):
        q1, q2 = self.critics(rows)
        e1, e2 = q1 - wanted, q2 - wanted
        return (e1 * e1 + e2 * e2).mean()


class ActorLoss(nn.Module):
    """The loss, and the mean of log pi."""

    def __init__(self, actor, critics):
        super().__init__()
        self.actor, self.critics = actor, critics

    def forward(self, observations, noise, alpha):
        actions, log_prob = squashed(self.actor(observations), noise)
        q1, q2 = self.critics(torch.cat([observations, actions], 1))
        log_prob = log_prob.mean()
        return alpha * log_prob - torch.min(q1, q2).mean(), log_prob


def frozen(module):
    """The same parameters in memory, without gradients."""
    same = copy.deepcopy(module).requires_grad_(False)
    for parameter, original in zip(same.parameters(), module.parameters()):
        parameter.data = original.data
    return same


def tuned(units, batch, traced=False):
    """Multi-tensor Adam, gradients dropped, none for targets nor for critics in the actor's step."""
    p = Problem(units)
    log_alpha = torch.tensor(math.log(TEMPERATURE), requires_grad=True)
    wanted_of = Wanted(p.actor, p.targets)
    critic_loss = CriticLoss(p.critics)
    actor_loss = ActorLoss(p.actor, frozen(p.critics))
    if traced:
        some = torch.zeros(batch, OBSERVATION), torch.zeros(batch, ACTION)
        column, alpha = torch.zeros(batch, 1), torch.tensor(TEMPERATURE)
        wanted_of = torch.jit.trace(wanted_of, (*some, column, column, alpha))
        critic_loss = torch.jit.trace(critic_loss, (torch.cat(some, 1), column))
        actor_loss = torch.jit.trace(actor_loss, (*some, alpha))
    actor, critics = list(p.actor.parameters()), list(p.critics.parameters())
    auxiliary_actor = list(p.auxiliary_actor.parameters())
    auxiliary_critics = list(p.auxiliary_critics.parameters())
    targets = list(p.targets.parameters())
    critic_optimizer = torch.optim.Adam(critics, lr=LEARNING_RATE, foreach=True)
    # the temperature's loss has no parameter in common with the actor's
    actor_optimizer = torch.optim.Adam(actor + [log_alpha], lr=LEARNING_RATE, foreach=True)

    def update():
        observations, actions, rewards, discounts, next_observations = p.replay.sample(batch)
        next_noise, noise = torch.randn(batch, ACTION), torch.randn(batch, ACTION)
        alpha = log_alpha.detach().exp()
        with torch.no_grad():
            wanted = wanted_of(next_observations, next_noise, rewards, discounts, alpha)
        critic_optimizer.zero_grad(set_to_none=True)
        critic_loss(torch.cat([observations, actions], 1), wanted).backward()
        critic_optimizer.step()
        with torch.no_grad():
            for phi, omega, target in zip(critics, auxiliary_critics, targets):
                phi.lerp_(omega, PULL)
                omega.lerp_(phi, FOLLOW)
                target.lerp_(phi, TAU)

        actor_optimizer.zero_grad(set_to_none=True)
        loss, log_prob = actor_loss(observations, noise, alpha)
        (loss - log_alpha * (log_prob.detach() + TARGET_ENTROPY)).backward()
        actor_optimizer.step()
        with torch.no_grad():
            for phi, omega in zip(actor, auxiliary_actor):
                phi.lerp_(omega, PULL)
                omega.lerp_(phi, FOLLOW)

    # targets and auxiliary parameters never need gradients
    for module in (p.targets, p.auxiliary_actor, p.auxiliary_critics):
        module.requires_grad_(False)
    return update, p.tensors()


def flatten(module):
    """One vector, of which the module's parameters become views."""
    parameters = list(module.parameters())
    vector = torch.cat([p.detach().reshape(-1) for p in parameters])
    parts = vector.split([p.numel() for p in parameters])
    for parameter, part in zip(parameters, parts):
        parameter.data = part.view(parameter.shape)
    return vector


def threshold(gradient, activation):
    torch.ops.aten.threshold_backward(gradient, activation, 0, grad_input=gradient)
    return gradient


class Layers:
    """The three layers of a network by hand; its parameters must not move to other memory."""

    def __init__(self, module, gradient, rows):
        self.w1, self.b1, self.w2, self.b2, self.w3, self.b3 = (
            p.detach() for p in module.parameters())
        shapes = [p.shape for p in module.parameters()]
        parts = gradient.split([shape.numel() for shape in shapes])
        self.gradients = [part.view(shape) for part, shape in zip(parts, shapes)]
        units = self.b1.numel()
        self.h1, self.h2, self.d1, self.d2 = (torch.empty(rows, units) for _ in range(4))
        self.out = torch.empty(rows, self.b3.numel())

    def forward(self, x):
        torch.addmm(self.b1, x, self.w1.t(), out=self.h1).relu_()
        torch.addmm(self.b2, self.h1, self.w2.t(), out=self.h2).relu_()
        return torch.addmm(self.b3, self.h2, self.w3.t(), out=self.out)

    def backward(self, x, d_out):
        """Gradient by the parameters, of the first rows if there are fewer than forward's."""
        n = len(d_out)
        h1, h2, d1, d2 = self.h1[:n], self.h2[:n], self.d1[:n], self.d2[:n]
        gw1, gb1, gw2, gb2, gw3, gb3 = self.gradients
        torch.mm(d_out.t(), h2, out=gw3)
        torch.sum(d_out, 0, out=gb3)
        threshold(torch.mm(d_out, self.w3, out=d2), h2)
        torch.mm(d2.t(), h1, out=gw2)
        torch.sum(d2, 0, out=gb2)
        threshold(torch.mm(d2, self.w2, out=d1), h1)
        torch.mm(d1.t(), x, out=gw1)
        torch.sum(d1, 0, out=gb1)

    def action_gradient(self, rows, d_out):
        """Gradient of d_out times the output by the actions, for those rows alone."""
        n = len(rows)
        h1, h2 = self.h1.index_select(0, rows), self.h2.index_select(0, rows)
        torch.mul(self.w3, d_out, out=self.d2[:1])
        self.d2[1:n] = self.d2[0]
        d1 = torch.mm(threshold(self.d2[:n], h2), self.w2, out=self.d1[:n])
        return torch.mm(threshold(d1, h1), self.w1[:, OBSERVATION:])


class FlatAdam:
    """Adam with pull, auxiliary and target on flat vectors."""

    def __init__(self, phi, omega, target=None):
        self.phi, self.omega, self.target = phi, omega, target
        self.gradient, self.moment, self.square, self.denominator = (
            torch.zeros_like(phi) for _ in range(4))
        self.steps = 0

    def step(self):
        self.steps += 1
        self.moment.lerp_(self.gradient, 0.1)
        self.square.mul_(0.999).addcmul_(self.gradient, self.gradient, value=0.001)
        torch.sqrt(self.square, out=self.denominator)
        self.denominator.mul_(1 / (1 - 0.999**self.steps) ** 0.5).add_(1e-8)
        self.phi.addcdiv_(self.moment, self.denominator,
                          value=-LEARNING_RATE / (1 - 0.9**self.steps))
        self.phi.lerp_(self.omega, PULL)
        self.omega.lerp_(self.phi, FOLLOW)
        if self.target is not None:
            self.target.lerp_(self.phi, TAU)


def by_hand(units, batch):
    """No autograd, products into their buffers, flat parameters, and nothing done twice."""
    p = Problem(units)
    for module in (p.targets, p.auxiliary_actor, p.auxiliary_critics):
        module.requires_grad_(False)
    critic_adam = FlatAdam(flatten(p.critics), flatten(p.auxiliary_critics), flatten(p.targets))
    actor_adam = FlatAdam(flatten(p.actor), flatten(p.auxiliary_actor))
    gradients = critic_adam.gradient.chunk(2)
    critics = [Layers(c, g, batch) for c, g in zip((p.critics.first, p.critics.second), gradients)]
    targets = [Layers(c, g, batch) for c, g in zip((p.targets.first, p.targets.second), gradients)]
    actor = Layers(p.actor, actor_adam.gradient, 2 * batch)
    log_alpha = torch.tensor(math.log(TEMPERATURE))
    alpha_adam = FlatAdam(log_alpha, log_alpha.clone())
    actor_rows = torch.empty(2 * batch, OBSERVATION)
    rows, next_rows = (torch.empty(batch, OBSERVATION + ACTION) for _ in range(2))
    d_action, d_heads = torch.empty(batch, ACTION), torch.empty(batch, 2 * ACTION)

    def actor_step(observations, actions, noise, alpha):
        heads = actor.out[:batch]
        rows[:, OBSERVATION:] = actions
        q1, q2 = (critic.forward(rows) for critic in critics)
        first = (q1 <= q2).squeeze(1)
        for critic, of_critic in zip(critics, (first, ~first)):
            chosen = of_critic.nonzero().squeeze(1)
            d_action.index_copy_(0, chosen, critic.action_gradient(chosen, -1 / batch))
        log_std = heads[:, ACTION:]
        clamped = log_std.clamp(MIN_LOG_STD, MAX_LOG_STD)
        d_u = d_action * (1 - actions * actions) + actions * (2 * alpha / batch)
        d_heads[:, :ACTION] = d_u
        d_log_std = d_u * clamped.exp() * noise - alpha / batch
        torch.mul(d_log_std, clamped == log_std, out=d_heads[:, ACTION:])
        actor.backward(observations, d_heads)
        actor_adam.step()

    def update():
        observations, replayed, rewards, discounts, next_observations = p.replay.sample(batch)
        next_noise, noise = torch.randn(batch, ACTION), torch.randn(batch, ACTION)
        alpha = log_alpha.exp().item()
        torch.cat([observations, next_observations], out=actor_rows)
        actions, log_prob = squashed(actor.forward(actor_rows), torch.cat([noise, next_noise]))
        torch.cat([next_observations, actions[batch:]], 1, out=next_rows)
        q1, q2 = (target.forward(next_rows) for target in targets)
        wanted = torch.min(q1, q2).sub_(log_prob[batch:], alpha=alpha).mul_(discounts).add_(rewards)
        torch.cat([observations, replayed], 1, out=rows)
        for critic in critics:
            critic.backward(rows, critic.forward(rows).sub(wanted).mul_(2 / batch))
        critic_adam.step()
        actor_step(observations, actions[:batch], noise, alpha)
        alpha_adam.gradient.copy_(-(log_prob[:batch].mean() + TARGET_ENTROPY))
        alpha_adam.omega.copy_(log_alpha)
        alpha_adam.step()

    def without_autograd():
        with torch.inference_mode():
            update()

    # buffers made outside of inference mode stay ordinary tensors
    return without_autograd, p.tensors()


def variants(units, batch):
    """What each name makes: an update, and the tensors it moves."""
    return {
        "out of the box": lambda: plain(units, batch),
        "multi-tensor Adam, critics frozen": lambda: tuned(units, batch),
        "the same, traced": lambda: tuned(units, batch, traced=True),
        "by hand, no autograd": lambda: by_hand(units, batch),
    }
