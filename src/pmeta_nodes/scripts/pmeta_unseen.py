"""The figure of what is not trained on: the meta-policy on test tasks, and how it adapts."""

import textwrap

import matplotlib.pyplot as plt
import numpy as np

import pmeta_groups as pg
import pmeta_runs as pr
from pmeta_curves import (RETURN, SPREAD, draw_curve, meta_label, meta_style, over_seeds,
                          progress_axis)
from pmeta_drawing import folder_for, headline, legend_right, row_height, wrapped_name

MAX_GROUPS = 3


def draw_unseen(experiments, figures):
    for experiment, groups in experiments.items():
        unseen = [g for g in groups if g.adaptations("test") or len(g.adaptations("train")) > 1]
        if unseen:
            unseen_tasks(experiment, unseen, figures, folder_for(experiment, experiments))


def unseen_tasks(experiment, groups, figures, prefix):
    """A row for each group: its meta-policy's curves, and its last round task by task."""
    shown = pg.chief(groups, MAX_GROUPS)
    if len(shown) < len(groups):
        pr.warn("unseen_tasks shows %d of the %d groups of %s."
                % (len(shown), len(groups), experiment))
    labels = max((task_labels(group.runs[0]) for group in shown), key=len)
    tasks_height = row_height(labels, 0.3) * len(labels)
    figure, axes = plt.subplots(len(shown), 2, squeeze=False, constrained_layout=True,
                                gridspec_kw={"width_ratios": (1.25, 1)},
                                figsize=(11.4, 0.4 + len(shown) * max(3.3, 0.7 + tasks_height)))
    steps = pg.differ_in_length(shown)
    for (left, right), group in zip(axes, shown):
        for split in ("train", "test"):
            counts = group.adaptations(split)
            for count in counts:
                draw_curve(left, group, (split, count), label_of(split, count, counts),
                           steps=steps, **meta_style(split, count, counts))
        progress_axis(left, shown, steps)
        left.set_title(textwrap.fill(group.label, 50), loc="left", fontsize=9.5)
        left.set_ylabel(RETURN)
        draw_last_round(right, group)
        right.set_title("last round, task by task", loc="left", fontsize=9.5)
    axes[-1][1].set_xlabel("return of the task (reward per episode)")
    legend_right(list(axes.flat) + [axes[0][1]])
    many = max(len(group.runs) for group in shown) > 1
    headline(figure, "%s, meta-policy: %s%s" % (
        experiment, over_seeds(SPREAD, shown),
        "; task by task every seed (small) and the mean (large)" if many else ""))
    figures.save(figure, prefix + experiment + "_unseen_tasks")


def task_labels(run):
    return [wrapped_name(name) for name in
            list(run.task_names) + ["test: " + name for name in run.test_names]]


def label_of(split, count, counts):
    return meta_label(split, count, counts).replace("MP", "MP, training tasks", split == "train")


def draw_last_round(axis, group):
    """A line for each task, test tasks below; before adaptation and after the most episodes."""
    run = group.runs[0]
    for split in ("train", "test"):
        counts = group.adaptations(split)
        ends = sorted(set(counts[:1] + counts[-1:]))
        for i, count in enumerate(ends):
            key = (split, count)
            values = np.array([r.by_task(key, "last") for r in group.runs])
            style = dict(meta_style(split, count, counts), linestyle="")
            y = np.array(run.tasks_of(key)) + 0.24 * (i - (len(ends) - 1) / 2)
            if len(values) > 1:
                axis.plot(values.T, y, alpha=0.55, **dict(style, markersize=3))
            axis.plot(values.mean(axis=0), y, markersize=7, label=label_of(split, count, counts),
                      **style)
    tasks = run.num_tasks + run.num_tests
    for task in range(1, tasks):
        axis.axhline(task - 0.5, color="#dddddd", linewidth=0.6)
    if run.num_tests:
        axis.axhline(run.num_tasks - 0.5, color="#666666", linewidth=0.9)
    axis.set_yticks(range(tasks))
    axis.set_yticklabels(task_labels(run))
    axis.set_ylim(tasks - 0.5, -0.5)
    axis.grid(False, axis="y")
    axis.tick_params(axis="y", length=0, labelsize=8.5)
