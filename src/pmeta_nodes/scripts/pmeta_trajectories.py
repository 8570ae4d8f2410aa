"""The point robot's ways to its goals: one episode of each policy on each task, as the paper has it.

A run that has trajectories.csv has its greedy episodes there: of each personal policy on its own
task, and of the meta-policy on every task after each number of exploration episodes.
"""

import re

import numpy as np
from matplotlib.patches import Circle

import pmeta_methods as pm
from pmeta_action_values import NAME
from pmeta_drawing import BLUE, GREY, ORANGE, folder_for, headline, legend_right, panels
from pmeta_files import PlotError

POINT = re.compile(r"\((-?[\d.]+), (-?[\d.]+)\)")


def draw_trajectories(experiments, figures):
    for experiment, groups in experiments.items():
        found = [(method, next((run for run in method.group.runs if run.trajectories), None))
                 for method in pm.methods_of(groups)
                 if method.group.settings.get("environment.name") == NAME]
        found = [(method, run) for method, run in found if run is not None]
        if found:
            trajectories(experiment, found, figures,
                         folder_for(experiment, experiments) + "trajectories")


def goals_of(run):
    """{task: its goal}, from what the manifest says of each."""
    listed = run.manifest.get("tasks")
    points = {task.get("task"): POINT.search(str(task.get("description")))
              for task in (listed if isinstance(listed, list) else []) if isinstance(task, dict)}
    for task in range(run.num_tasks + run.num_tests):
        if points.get(task) is None:
            raise PlotError("%s/manifest.json: task %d does not say where its goal is."
                            % (run.folder, task))
    return {task: np.array([float(number) for number in point.groups()])
            for task, point in points.items() if point is not None}


def rows_of(method, ways):
    """[(label, {number of episodes: [keys]})]: PP, which has none, and MP after each number."""
    rows = []
    if method.ours and "personal" in ways:
        rows.append((pm.policy_name("PP", method), {0: ["personal"]}))
    counts = sorted(set(key[1] for key in ways if not isinstance(key, str)))
    if counts:
        shown = [count for count in counts if count] or counts
        rows.append((pm.policy_name("MP", method),
                     {n: [(s, n) for s in ("train", "test") if (s, n) in ways] for n in shown}))
    return rows


def trajectories(experiment, found, figures, name):
    """A row for each policy, a column for each number of exploration episodes."""
    rows = []
    for method, run in found:
        rows += [(run, label, by_count) for label, by_count in rows_of(method, run.trajectories)]
    counts = sorted(set(n for *_, by_count in rows for n in by_count if n)) or [0]
    figure, axes = panels(len(rows), len(counts))
    for row, (run, label, by_count) in zip(axes, rows):
        for axis, count in zip(row, counts):
            # what needs no exploration has one panel
            known = count if count in by_count else 0 if count == counts[0] else None
            if known not in by_count:
                axis.set_axis_off()
                continue
            told = draw_ways(axis, run, by_count[known])
            context = ", c_1:%d" % known if known else ""
            axis.set_title("%s%s: %s" % (label, context, told), loc="left", fontsize=9.5)
    for axis in axes[:, 0]:
        axis.set_ylabel("y")
    for axis in axes[-1]:
        axis.set_xlabel("x")
    empty = [axis for axis in axes.flat if not axis.axison]
    figure.set_size_inches(4.2 * len(counts) + 1.7 * (not empty), 0.6 + 2.9 * len(rows))
    legend_right(list(axes.flat) + [(empty or axes[0, -1:])[0]], inside=bool(empty))
    seeds = sorted(set(run.seed for run, *_ in rows))
    headline(figure, "%s: the way of one episode to each goal, seed %s"
             % (experiment, ", ".join(map(str, seeds))))
    figures.save(figure, name)


def draw_ways(axis, run, keys):
    """Goals and ways; returns how many of them end within the radius."""
    goals, radius = goals_of(run), run.settings.get("environment.goal_radius", 0.2)
    told = []
    for key in keys:
        ways = run.trajectories[key]
        unseen = not isinstance(key, str) and key[0] == "test"
        reached = 0
        for task, way in ways.items():
            ends = np.linalg.norm(way[-1] - goals[task]) <= radius
            reached += ends
            axis.add_patch(Circle(goals[task], radius, facecolor="none" if unseen else "#cfe3f5",
                                  edgecolor=GREY, linewidth=0.8, linestyle=":" if unseen else "-",
                                  zorder=1, label="unseen goal" if unseen else "goal"))
            axis.plot(*way.T, color=BLUE if ends else ORANGE, linewidth=1.2,
                      linestyle="-" if ends else "--", label="ends there" if ends else "misses it")
            axis.plot(*way[-1], marker="o", markersize=3.5, color=BLUE if ends else ORANGE,
                      markerfacecolor=BLUE if ends else "white")
        told.append("%d of %d%s" % (reached, len(ways), " unseen" if unseen else " goals"))
    axis.set_aspect("equal")
    axis.autoscale()
    return ", ".join(told)
