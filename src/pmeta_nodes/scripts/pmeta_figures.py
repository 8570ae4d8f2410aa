"""Figures of pMeta's runs: learning curves, sweeps of a setting, and returns task by task."""

import textwrap

import matplotlib.pyplot as plt
import numpy as np

import pmeta_groups as pg
import pmeta_runs as pr
import pmeta_statistics as ps
import pmeta_tables as pt
from pmeta_curves import (MP, PP, RETURN, SPREAD, adaptation_curves, draw_curve, draw_optimum,
                          over_seeds, progress_axis, seeds_text)
from pmeta_drawing import (GREY, MP_COLOR, PALETTE, PP_COLOR, baseline_style, folder_for,
                           headline, legend_right, panels, row_height, spread_ticks, wrapped_name)
from pmeta_files import SNAPSHOTS

SHORT = {"personal": "PP", "meta": "MP"}
MAX_PANELS = 3
MAX_SLICES = 4
MAX_TASK_GROUPS = 6
TASK_STYLES = {  # label, colour, marker
    "personal": ("PP, own task", PP_COLOR, "o"),
    "meta": ("MP", MP_COLOR, "s"),
    "all": ("all personal policies\non the task, mean", GREY, "D"),
}


def learning_curves(experiment, groups, figures, prefix):
    """An algorithm against its baselines, a panel for every setting that they share."""
    ours = pg.without_baselines(groups)
    contexts = {}
    for group in ours:
        contexts.setdefault(group.context(), []).append(group)
    shown = [pg.reference(members) for members in contexts.values()]
    if len(shown) > MAX_PANELS:
        shown = [pg.reference(ours)]
    # training tasks that differ between panels have scales of their own
    sharey = not any(key.startswith("environment.") and not key.startswith("environment.test_")
                     for key in pg.varying(shown))

    baselines = [baseline_curves(group, groups) for group in shown]
    drawn = shown + [baseline for found in baselines for baseline, _, _, _ in found]
    drawn = drawn or groups[:len(PALETTE)]
    steps = pg.differ_in_length(drawn)
    figure, axes = panels(1, max(1, len(shown)), sharey)
    for axis, group, found in zip(axes[0], shown, baselines):
        name = " ".join([group.name] + pg.setting_texts(group, []))
        for policy, label, style in (("meta", "MP, ", MP), ("personal", "PP, ", PP)):
            if policy in group.policies:
                draw_curve(axis, group, policy, label + name, steps=steps, zorder=3, **style)
        draw_adaptation(axis, group, steps)
        for baseline, policy, label, style in found:
            draw_curve(axis, baseline, policy, label, steps=steps, **style)
        draw_optimum(axis, [group] + [baseline for baseline, _, _, _ in found])
        axis.set_title(_wrapped(pg.fixed_texts(group, ours, "personal.lambda")), loc="left")
        progress_axis(axis, drawn if steps else [group], steps)
    if not shown:
        for group, color in zip(drawn, PALETTE):
            policy = "meta" if "meta" in group.policies else "personal"
            draw_curve(axes[0][0], group, policy, group.label, steps=steps, color=color, marker="o")
        draw_optimum(axes[0][0], drawn)
        progress_axis(axes[0][0], drawn, steps)
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    headline(figure, "%s: %s" % (experiment, over_seeds(SPREAD, drawn)))
    figures.save(figure, prefix + "learning_curves")


def baseline_curves(group, groups):
    """[(baseline, policy, label, style)]; one that goes on for longer is one, too."""
    found = []
    for algorithm in pg.baselines(groups):
        baseline = pg.rival_of(group, groups, algorithm)
        if baseline is not None and baseline.figures.compared_by in baseline.policies:
            lengths = [pg.setting_text(key, baseline.settings.get(key)) for key in pg.LENGTHS
                       if key not in baseline.absent | group.absent
                       and baseline.settings.get(key) != group.settings.get(key)]
            policy, label, style = baseline_look(baseline)
            found.append((baseline, policy, " ".join([label] + lengths), style))
    return found


def baseline_look(baseline):
    """(the policy it is judged by, label, style)"""
    policy = baseline.figures.compared_by
    return (policy, "%s, %s" % (SHORT[policy], baseline.name),
            baseline_style(baseline.place))


def draw_adaptation(axis, group, steps=False):
    """The meta-policy before adaptation, and on test tasks."""
    for key, label, style in adaptation_curves(group):
        draw_curve(axis, group, key, label, band=False, steps=steps, **style)


def bag_curves(run, name, figures):
    """PP and MP of a run from its bag; which algorithm it was the returns do not say."""
    group = pg.Group("", {}, [run])
    figure, axes = panels(1, 1)
    for policy, label, style in (("meta", "MP", MP), ("personal", "PP", PP)):
        if policy in group.policies:
            draw_curve(axes[0][0], group, policy, label, **style)
    draw_adaptation(axes[0][0], group)
    progress_axis(axes[0][0], [group])
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    headline(figure, "run %s, from its bag" % run.run_id)
    figures.save(figure, name + "_learning_curves")


def setting_curves(experiment, key, members, groups, figures, name):
    """Curves of PP and MP for every value of one setting."""
    figure, axes = panels(1, 2)
    numeric = all(pr.is_number(group.settings.get(key)) for group in members)
    baseline = pg.reference_line(members[0], groups)
    if any(pg.reference_line(group, groups) is not baseline for group in members):
        baseline = None
    steps = pg.differ_in_length(members)
    for axis, policy, title in zip(axes[0], ("personal", "meta"),
                                   ("PP, personal policies", "MP, meta-policy")):
        for i, group in enumerate(members):
            if policy not in group.policies:
                continue
            # ordered values get an ordered colour map that keeps its order in grey, too
            color = (plt.get_cmap("viridis")(0.87 * i / (len(members) - 1)) if numeric
                     else PALETTE[i % len(PALETTE)])
            draw_curve(axis, group, policy, pg.setting_text(key, group.settings.get(key)),
                       steps=steps, color=color, marker="osD^vP*X"[i % 8])
        if baseline is not None:
            draw_curve(axis, baseline, "meta", "MP, " + baseline.name, band=False, steps=steps,
                       color=GREY, linestyle="--", linewidth=1.4)
        draw_optimum(axis, members)
        axis.set_title(title, loc="left")
        progress_axis(axis, members, steps)
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    fixed = pg.fixed_texts(members[0], pg.without_baselines(groups), key)
    headline(figure, "%s: %s, %s" % (experiment, " ".join([members[0].name] + fixed),
                                     over_seeds(SPREAD, members)))
    figures.save(figure, name)


def _wrapped(texts):
    return textwrap.fill(" ".join(texts), 38)


def mean_and_limits(values):
    """Mean over seeds and its interval, which of one seed is no wider than the mean."""
    mean = values.mean()
    limits = ps.curve_interval(values[:, None])
    return (mean, mean, mean) if limits is None else (mean, limits[0][0], limits[1][0])


def sweep_figure(experiment, key, found, groups, figures, name):
    """Return against one numeric setting: at the last round, and as the mean over the rounds."""
    figure, axes = panels(len(found), 2)
    for row, members in zip(axes, found):
        for axis, measure, title in zip(row, ("last", "auc"),
                                        ("at the last round", "mean over all rounds")):
            draw_sweep(axis, key, members, measure, groups)
            fixed = pg.fixed_texts(members[0], pg.without_baselines(groups), key)
            axis.set_title("\n".join([title] + ([_wrapped(fixed)] if fixed else [])), loc="left")
            axis.set_xlabel("%s (%s)" % (pg.symbol(key), key) if pg.symbol(key) != key else key)
        row[0].set_ylabel(RETURN)
    legend_right(axes[0])
    drawn = [group for members in found for group in members]
    headline(figure, "%s: %s" % (experiment, over_seeds(SPREAD, drawn)))
    figures.save(figure, name)


def draw_sweep(axis, key, members, measure, groups):
    values = np.array([group.settings[key] for group in members], dtype=float)
    for policy, label, style in (("meta", "MP", MP), ("personal", "PP", PP)):
        if all(policy in group.policies for group in members):
            draw_points(axis, values, members, measure, policy,
                        "%s, %s" % (label, members[0].name), style)
    baselines = [pg.reference_line(group, groups) for group in members]
    known = [b for b in baselines if b is not None]
    if known and all(b is known[0] for b in baselines):
        _, label, style = baseline_look(known[0])
        mean, low, high = mean_and_limits(getattr(known[0], measure)("meta"))
        axis.axhline(mean, color=style["color"], linestyle=style["linestyle"], linewidth=1.4,
                     label=label)
        axis.axhspan(low, high, color=style["color"], alpha=0.16, linewidth=0)
    elif known:
        draw_points(axis, [v for v, b in zip(values, baselines) if b is not None], known, measure,
                    *baseline_look(known[0]))
    if values.min() > 0 and values.max() / values.min() >= 30:
        axis.set_xscale("log")
        axis.minorticks_off()
    axis.set_xticks(spread_ticks(axis, values))
    axis.set_xticklabels(["%g" % v for v in axis.get_xticks()])


def draw_points(axis, values, members, measure, policy, label, style):
    mean, low, high = np.transpose([mean_and_limits(getattr(group, measure)(policy))
                                    for group in members])
    # of equal returns the mean may lie beyond them by its rounding
    bars = np.maximum(0, (mean - low, high - mean))
    axis.errorbar(values, mean, yerr=bars, label=label, capsize=2.5,
                  elinewidth=1.2, **style)


def task_figure(experiment, groups, figures, prefix):
    """PP and MP of each task, every seed a dot: a task that is stuck shows, which a mean hides."""
    figures.write(pt.csv_text(pt.TASK_COLUMNS, pt.task_rows(experiment, groups)),
                  prefix + "tasks_last.csv")
    shown = pg.chief(groups, MAX_TASK_GROUPS)
    if len(shown) < len(groups):
        pr.warn("tasks_last shows %d of the %d groups of %s; tasks_last.csv has all of them."
                % (len(shown), len(groups), experiment))
    names = max((group.runs[0].task_names for group in shown), key=len)
    labels = [wrapped_name(name) for name in names]
    tasks = len(labels)
    tasks_height = row_height(labels, 0.36) * tasks
    figure, axes = plt.subplots(len(shown), 2, squeeze=False, sharex=True, sharey=True,
                                figsize=(10.4, 0.7 + len(shown) * (0.5 + tasks_height)),
                                constrained_layout=True)
    for row, group in zip(axes, shown):
        for axis, snapshot in zip(row, SNAPSHOTS):
            episodes = draw_tasks(axis, group, snapshot)
            axis.set_title(textwrap.fill("%s: %s round, %s episodes" % (group.label, snapshot,
                                                                       episodes), 54),
                           loc="left", fontsize=9.5)
    axes[0][0].set_yticks(range(tasks))
    axes[0][0].set_yticklabels(labels)
    axes[0][0].set_ylim(tasks - 0.5, -0.5)
    for axis in axes[-1]:
        axis.set_xlabel("return of the task (reward per episode)")
    legend_right(list(axes.flat) + [axes[0][-1]])
    many = max(len(group.runs) for group in shown) > 1
    headline(figure, "%s, task by task: %s%s" % (
        experiment, seeds_text(shown), " (small) and their mean (large)" if many else ""))
    figures.save(figure, prefix + "tasks_last")


def draw_tasks(axis, group, snapshot):
    """One line for each task; returns what episodes the returns are of."""
    found = [(policies, group.by_task(policies, snapshot)) for policies in TASK_STYLES]
    found = [(policies, data) for policies, data in found if data is not None]
    for i, (policies, (values, _)) in enumerate(found):
        label, color, marker = TASK_STYLES[policies]
        y = np.arange(values.shape[1]) + 0.26 * (i - (len(found) - 1) / 2)
        # of a task that did not report in every seed there is no mean: not a number
        mean = values.mean(axis=0)
        if len(values) > 1:
            axis.plot(values.T, y, linestyle="", marker=marker, color=color, markersize=3.5,
                      alpha=0.55, markeredgewidth=0)
        axis.plot(mean, y, linestyle="", marker=marker, color=color, markersize=7, label=label,
                  markerfacecolor="none", markeredgewidth=1.5)
    for task in range(1, group.runs[0].num_tasks):
        axis.axhline(task - 0.5, color="#dddddd", linewidth=0.6)
    axis.grid(False, axis="y")
    axis.tick_params(axis="y", length=0, labelsize=8.5)
    return " and ".join(sorted(set(measured for _, (_, measured) in found)))


def draw_runs(experiments, kinds, figures):
    """Figures of every experiment; with several, each in a folder of its own."""
    curves, sweeps = figures["curves"], figures["sweep"]
    for experiment, groups in experiments.items():
        prefix = folder_for(experiment, experiments)
        if "curves" in kinds:
            learning_curves(experiment, groups, curves, prefix)
        if "tasks" in kinds and any(g.figures.policies != "table" or any(r.fresh for r in g.runs) for g in groups):
            task_figure(experiment, groups, figures["tasks"], prefix)
        ours = pg.without_baselines(groups)
        keys = pg.varying(ours)
        names = [pg.short_name(key) for key in keys]
        for key in keys:
            found = pg.slices(ours, key)
            numeric = [m for m in found if all(pr.is_number(g.settings.get(key)) for g in m)]
            # two settings may share the last part of their name
            name = pg.short_name(key) if names.count(pg.short_name(key)) == 1 else key
            # curves of unlike tasks in one panel would compare nothing
            if "curves" in kinds and found and (numeric or not key.startswith("environment.")):
                members = max(found, key=lambda m: (len(m), pg.reference(ours) in m))
                setting_curves(experiment, key, members, groups, curves, prefix + name + "_curves")
            if "sweep" in kinds and numeric:
                numeric.sort(key=len, reverse=True)
                if len(numeric) > MAX_SLICES:
                    pr.warn("sweep_%s shows %d of the %d combinations of the other settings."
                            % (name, MAX_SLICES, len(numeric)))
                sweep_figure(experiment, key, numeric[:MAX_SLICES], groups, sweeps,
                             prefix + "sweep_" + name)
