"""The point robot's first action: what each policy's critics take it to be worth."""

import numpy as np

import pmeta_runs as pr
from pmeta_drawing import folder_for, headline, panels, wrapped_name
from pmeta_files import PlotError
from pmeta_policies import policies_of

NAME = "sparse_point_robot"
ROWS = {"personal": "PP", "meta": "MP"}
AXIS = np.linspace(-1, 1, 41)  # actions along x and y
START = (0.0, 0.0)
MAX_TASKS = 5
MAX_FIGURES = 3


class CriticView:
    """A policy of soft actor-critic at the start, told what `task_input` says of its task."""

    def __init__(self, policy, task_input):
        self.policy = policy
        self.state = np.concatenate([START, task_input])

    def values(self):
        """min over both critics of Q(start, (x, y)), [y, x]."""
        y, x = np.meshgrid(AXIS, AXIS, indexing="ij")
        actions = np.stack([x.ravel(), y.ravel()], axis=1)
        inputs = np.concatenate([np.tile(self.state, (len(actions), 1)), actions], axis=1)
        both = [self.policy.network(name, inputs) for name in ("critic1", "critic2")]
        return np.minimum(*both).reshape(x.shape)

    def action(self):
        """What the policy does, without its noise."""
        return np.tanh(self.policy.network("actor", self.state[None])[0, :2])


def views_of(run):
    """{"personal", "meta": [view for each task]} of the policies that the run has kept."""
    if (run.settings.get("environment.name"), run.figures.policies) != (NAME, "actor_critic"):
        return {}
    return {name: [CriticView(policy, task_input(run, policy, name, task))
                   for task, policy in enumerate(policies)]
            for name, policies in policies_of(run.folder, run.num_tasks).items()
            if name in run.curves}


def task_input(run, policy, name, task):
    """What tells a policy its task; of a meta-policy that infers it, the prior's mean."""
    encoding = run.settings.get("sac.task_encoding", "inference")
    if name == "personal":
        text = policy.metadata.get("task_input", "")
        try:
            return np.array([float(word) for word in text.split(",") if word])
        except ValueError:
            raise PlotError("%s: its task_input is '%s', not numbers." % (policy.path, text))
    if encoding == "one_hot":
        return np.eye(run.num_tasks)[task]
    return np.zeros(policy.inputs("actor") - len(START))


def goals_of(run):
    """Where the training tasks' goals lie, tasks x 2."""
    angles = run.settings.get("environment.goal_angles") or ()
    angles = angles if isinstance(angles, tuple) else (angles,)
    if not angles and run.num_tasks == 1:
        angles = (np.pi / 2,)
    elif not angles:
        angles = tuple(np.pi * np.arange(run.num_tasks) / (run.num_tasks - 1))
    if len(angles) != run.num_tasks or not all(pr.is_number(float(a)) for a in angles):
        raise PlotError("%s/config.yaml: environment.goal_angles must be an angle for each of %d "
                        "tasks, or none." % (run.folder, run.num_tasks))
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def draw_action_values(experiments, figures):
    """A figure for the first run of every group that has kept its policies."""
    for experiment, groups in experiments.items():
        found = []
        for group in groups:
            run = next((run for run in group.runs if views_of(run)), None)
            found += [(group, run)] if run else []
        if len(found) > MAX_FIGURES:
            pr.warn("action values are drawn of %d of the %d groups of %s."
                    % (MAX_FIGURES, len(found), experiment))
        prefix = folder_for(experiment, experiments)
        for i, (group, run) in enumerate(found[:MAX_FIGURES]):
            number = "_%d" % (i + 1) if len(found) > 1 else ""
            text = "%s: %s, seed %d, round %d" % (experiment, group.label, run.seed, run.num_rounds)
            action_values(text, run, views_of(run), figures, prefix + "action_values" + number)


def chosen_tasks(count):
    """Some tasks, evenly from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_TASKS)).round().astype(int))


def action_values(text, run, views, figures, name):
    """A row for each policy, a column for each task that is chosen; every map has its own scale."""
    tasks, goals = chosen_tasks(run.num_tasks), goals_of(run)
    rows = [row for row in ROWS if row in views]
    figure, axes = panels(len(rows), len(tasks), panel_width=2.7)
    figure.set_figheight(0.9 + 2.9 * len(rows))
    for row, name_of_row in zip(axes, rows):
        shared = len(tasks) > 1 and are_equal([views[name_of_row][task] for task in tasks])
        for axis, task in zip(row, tasks):
            if shared and task != tasks[0]:
                axis.set_axis_off()
                continue
            shown = goals[tasks] if shared else goals[task:task + 1]
            low, high, image = draw_map(axis, views[name_of_row][task], shown)
            text_of_map = "%s: %.3g to %.3g" % (ROWS[name_of_row], low, high)
            axis.set_title(text_of_map.replace("-", "−"), loc="left")
        if shared:
            row[0].set_xlabel("action along x\none for all tasks")
        row[0].set_ylabel("action along y")
    unknown = "meta" in rows and run.settings.get("sac.task_encoding", "inference") == "inference"
    labelled = next(row for row in axes[::-1] if row[-1].axison)
    for axis, task in zip(labelled, tasks):
        axis.set_xlabel("action along x\n%s" % wrapped_name(run.task_names[task], 22))
    bar = figure.colorbar(image, ax=axes, shrink=0.6, aspect=35, ticks=[])
    bar.set_label("Q(start, action), from each map's lowest to its highest")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="upper right", ncol=2)
    headline(figure, text + ("; MP before it explores" if unknown else "") + "\n")
    figures.save(figure, name)


def are_equal(views):
    """Is it one map? So it is of a meta-policy that knows nothing of the task yet."""
    return all(view.policy is views[0].policy and np.array_equal(view.state, views[0].state)
               for view in views)


def draw_map(axis, view, goals):
    """Colours, the policy's action and ways to goals; returns (lowest, highest, image)."""
    values = view.values()
    low, high = float(values.min()), float(values.max())
    half = (AXIS[1] - AXIS[0]) / 2
    image = axis.imshow(values, origin="lower", extent=(-1 - half, 1 + half) * 2, vmin=low,
                        vmax=high, cmap="viridis")
    axis.plot(*(goals / np.abs(goals).max(axis=1, keepdims=True)).T, marker="*", markersize=13,
              color="white", markeredgecolor="black", linestyle="none", clip_on=False,
              label="straight to the goal")
    axis.plot(*view.action(), marker="o", markersize=7, color="white", markeredgecolor="black",
              linestyle="none", label="the policy's action")
    axis.set_xticks([-1, 0, 1])
    axis.set_yticks([-1, 0, 1])
    axis.grid(False)
    return low, high, image
