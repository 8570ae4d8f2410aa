"""MountainCar's value maps: what each policy takes a state to be worth, and where it drives."""

import functools

import matplotlib.patheffects as effects
import matplotlib.pyplot as plt
import numpy as np

import pmeta_mountain_car as mc
import pmeta_runs as pr
from pmeta_drawing import folder_for, headline
from pmeta_files import PlotError
from pmeta_policies import policies_of

STARTS = {-0.6: "-", -0.5: "--", -0.4: ":"}  # at rest, with the line of their trajectory
COLUMNS = {"personal": "PP", "meta": "MP", "optimal": "optimal"}
MAP_SHAPE = (121, 101)  # positions x velocities
MAX_MAPS = 3


class NetworkView:
    """A Q-network's values and choices as functions of the car's state."""

    def __init__(self, policy, velocity_scale):
        self.policy = policy
        self.velocity_scale = velocity_scale

    def _q_values(self, position, velocity):
        observations = np.stack([position.ravel(), self.velocity_scale * velocity.ravel()], axis=1)
        return self.policy.q_values(observations)

    def values(self, position, velocity):
        return self._q_values(position, velocity).max(axis=1).reshape(position.shape)

    def choose(self, position, velocity):
        return self._q_values(position, velocity).argmax(axis=1).reshape(position.shape)


def cars_of(run):
    """The run's tasks, from its effective settings."""
    columns = []
    for key in ("environment.zeta", "environment.force", "environment.gravity"):
        value = run.settings.get(key)
        column = value if isinstance(value, tuple) else (value,) * run.num_tasks
        if len(column) != run.num_tasks or not all(pr.is_number(v) for v in column):
            raise PlotError("%s/config.yaml: %s must be one number, or one for each of %d tasks."
                            % (run.folder, key, run.num_tasks))
        columns.append(column)
    return [mc.MountainCar(*task) for task in zip(*columns)]


def views_of(run):
    """{"personal", "meta": [view for each task]} of the policies that the run has kept."""
    if (run.settings.get("environment.name"), run.figures.policies) != (mc.NAME, "q_network"):
        return {}
    scale = run.settings.get("environment.velocity_scale", 1)
    return {name: [NetworkView(policy, scale) for policy in policies]
            for name, policies in policies_of(run.folder, run.num_tasks).items()
            if name in run.curves}


@functools.lru_cache(maxsize=None)
def optimum(zeta, force, gravity, gamma):
    """Kept, since the groups of an experiment mostly share their tasks."""
    return mc.Optimum(mc.MountainCar(zeta, force, gravity), gamma)


def first_with_views(group):
    for run in group.runs:
        views = views_of(run)
        if views:
            return run, views
    return None, {}


def draw_value_maps(experiments, figures):
    """A figure for the first run of every group that has kept its policies."""
    for experiment, groups in experiments.items():
        found = [(group, first_with_views(group)) for group in groups]
        found = [(group, run, views) for group, (run, views) in found if views]
        if len(found) > MAX_MAPS:
            pr.warn("value maps are drawn of %d of the %d groups of %s."
                    % (MAX_MAPS, len(found), experiment))
        prefix = folder_for(experiment, experiments)
        for i, (group, run, views) in enumerate(found[:MAX_MAPS]):
            number = "_%d" % (i + 1) if len(found) > 1 else ""
            text = "%s: %s, seed %d, round %d" % (experiment, group.label, run.seed, run.num_rounds)
            value_maps(text, run, views, figures, prefix + "value_maps" + number)


def value_maps(text, run, views, figures, name):
    """A row for each task, a column for each policy, all on one scale of values."""
    cars = cars_of(run)
    gamma = run.settings.get("dqn.gamma", 0.99)
    views = dict(views, optimal=[optimum(car.zeta, car.force, car.gravity, gamma) for car in cars])
    columns = [column for column in COLUMNS if column in views]
    # what an episode without end at the goal is worth
    lowest = -sum(gamma ** step for step in range(mc.HORIZON))
    figure, axes = plt.subplots(len(cars), len(columns), squeeze=False, sharex=True, sharey=True,
                                figsize=(1.2 + 3.0 * len(columns), 1.3 + 2.1 * len(cars)),
                                constrained_layout=True)
    for task, (row, car) in enumerate(zip(axes, cars)):
        for axis, column in zip(row, columns):
            steps, image = draw_map(axis, views[column][task], car, lowest)
            axis.set_title("%s: %s steps" % (COLUMNS[column], ", ".join(steps)), loc="left")
        row[0].set_ylabel("%s\nvelocity (units a step)" % run.task_names[task])
    for axis in axes[-1]:
        # the blank line is the legend's
        axis.set_xlabel("position (track units)\n\n")
    bar = figure.colorbar(image, ax=axes, shrink=0.5, aspect=35, extend="both")
    bar.set_label("V = max Q, discounted return (reward: −1 a step)")
    legend = axes[-1][0].legend(loc="upper left", bbox_to_anchor=(-0.05, -0.24), ncol=len(STARTS))
    # wider than its panel, whose neighbours it must not push away
    legend.set_in_layout(False)
    headline(figure, text)
    figures.save(figure, name)


def draw_map(axis, view, car, lowest):
    """Values as colours and greedy trajectories over them; returns (steps of each, the image)."""
    position, velocity = np.meshgrid(np.linspace(mc.LOWEST, mc.HIGHEST, MAP_SHAPE[0]),
                                     np.linspace(-mc.FASTEST, mc.FASTEST, MAP_SHAPE[1]),
                                     indexing="ij")
    image = axis.imshow(view.values(position, velocity).T, origin="lower", aspect="auto",
                        extent=(mc.LOWEST, mc.HIGHEST, -mc.FASTEST, mc.FASTEST),
                        vmin=lowest, vmax=0, cmap="viridis", interpolation="bilinear")
    steps = []
    outline = [effects.Stroke(linewidth=3, foreground="black"), effects.Normal()]
    for start, line in STARTS.items():
        states, done = car.trajectory(view.choose, start)
        axis.plot(states[:, 0], states[:, 1], color="white", linewidth=1.3, linestyle=line,
                  path_effects=outline, label=("start at %g" % start).replace("-", "−"))
        axis.plot(*states[0], marker="o", color="white", markersize=5, markeredgecolor="black")
        steps.append("%d" % (len(states) - 1) if done else ">%d" % mc.HORIZON)
    axis.axvline(mc.GOAL, color="white", linewidth=1, linestyle=(0, (1, 2)))
    axis.grid(False)
    return steps, image
