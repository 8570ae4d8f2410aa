"""Every method beside ours, a panel for each experiment: training tasks, and tasks not trained on."""

import numpy as np
from matplotlib.ticker import EngFormatter, LogLocator, MaxNLocator, NullFormatter

import pmeta_methods as pm
from pmeta_curves import (MP, PP, RETURN, SPREAD, draw_curve, draw_optimum, over_seeds)
from pmeta_drawing import baseline_style, headline, legend_right, panels

STEPS = "environment steps of all training tasks"
MARKS = 12  # of a curve, however many evaluations it has
UNLIKE = 5  # times longer: a linear axis would press the shorter ones together
OURS = {"PP": PP, "MP": MP}


def draw_comparison(experiments, figures):
    """Returns on training tasks over environment steps, the final performance dotted."""
    found = methods_by_experiment(experiments)
    if not found:
        return
    for experiment, methods in found.items():
        pm.tell_left_out(experiment, experiments[experiment], methods)
    figure, axes, beside = grid(len(found))
    for axis, (experiment, methods) in zip(axes, found.items()):
        count = pm.common_count(methods)
        steps_axis(axis, methods)
        for method in methods:
            for word, key in pm.judged_by(method, count):
                draw_method(axis, method, key, word, count)
        draw_optimum(axis, [method.group for method in methods])
        axis.set_title(title_of(experiment, count), loc="left")
    finish(figure, axes, beside, found, "training tasks")
    figures.save(figure, "comparison")


def draw_unseen_methods(experiments, figures):
    """The same of meta-policies on test tasks: a row before adaptation, and one after it."""
    found = {experiment: [m for m in methods if m.group.adaptations("test")]
             for experiment, methods in methods_by_experiment(experiments).items()}
    found = {experiment: methods for experiment, methods in found.items() if methods}
    if not found:
        return
    figure, grid_of = panels(2, len(found), sharey=False)
    for column, (experiment, methods) in enumerate(found.items()):
        count = pm.common_count(methods, "test")
        for axis, number in zip(grid_of[:, column], (0, count)):
            steps_axis(axis, methods)
            for method in methods:
                draw_method(axis, method, pm.after(method.group, "test", number), "MP", number)
            trained = not any(run.unseen for m in methods for run in m.group.runs)
            axis.set_title(title_of(experiment, number) + "\ntrained on, too" * trained, loc="left")
        low, high = zip(*(axis.get_ylim() for axis in grid_of[:, column]))
        for axis in grid_of[:, column]:
            axis.set_ylim(min(low), max(high))
    finish(figure, list(grid_of.flat), grid_of[0, -1], found, "test tasks")
    figures.save(figure, "comparison_unseen")


def methods_by_experiment(experiments):
    """Those experiments in which there is anything to compare."""
    return {experiment: pm.methods_of(groups)
            for experiment, groups in experiments.items() if pm.are_compared(groups)}


def grid(count):
    """(figure, axes in rows of at most three, the one that the legend goes beside or into)."""
    columns = count if count <= 3 else 2 if count == 4 else 3
    figure, axes = panels(-(-count // columns), columns, sharey=False)
    beside = axes[0, -1]
    axes = list(axes.flat)
    for axis in axes[count:]:
        axis.set_axis_off()
        beside = axes[count]
    return figure, axes[:count], beside


def title_of(experiment, count):
    words = {None: "", 0: ", before adaptation"}
    return experiment + words.get(count, ", after %s episodes" % count)


def draw_method(axis, method, key, word, count):
    label = pm.policy_name(word, method)
    if not isinstance(key, str) and method.explores and key[1] != count:
        label += ", after %d episodes" % key[1]
    style, steps = look_of(method, word), method.group.total_steps
    places = (np.geomspace if axis.get_xscale() == "log" else np.linspace)(steps[0], steps[-1], MARKS)
    marks = np.unique(np.searchsorted(steps, places).clip(0, len(steps) - 1))
    draw_curve(axis, method.group, key, label, x=steps, markevery=marks.tolist(), **style)
    axis.axhline(method.group.final(key).mean(), color=style["color"], linestyle=":", linewidth=1.1,
                 zorder=1.5)


def look_of(method, word):
    if not method.ours:
        return baseline_style(method.group.place)
    style = dict(OURS[word], zorder=3)
    if not method.explores and method.name != method.group.name:
        style.update(linestyle="--", markerfacecolor="white")
    return style


def steps_axis(axis, methods):
    marks = [method.group.total_steps for method in methods]
    ends = [steps[-1] for steps in marks]
    first = min(steps[0] for steps in marks)
    axis.set_xlabel(STEPS)
    axis.xaxis.set_major_formatter(EngFormatter(sep=""))
    if first > 0 and max(ends) > UNLIKE * min(ends):
        axis.set_xscale("log")
        axis.set_xlim(first / 1.1, 1.1 * max(ends))
        decades = np.log10(max(ends) / first)
        axis.xaxis.set_major_locator(LogLocator(subs=(1,) if decades > 2 else (1, 2, 5)))
        axis.xaxis.set_major_formatter(EngFormatter(sep=""))
        axis.xaxis.set_minor_formatter(NullFormatter())
    else:
        axis.set_xlim(0, 1.02 * max(ends))
        axis.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))


def finish(figure, axes, beside, found, tasks):
    """One legend for all, and what the lines are."""
    for axis in axes:
        if axis.get_subplotspec().is_first_col():
            axis.set_ylabel(RETURN)
    legend_right(axes + [beside], inside=beside not in axes)
    groups = [method.group for methods in found.values() for method in methods]
    headline(figure, "%s: %s\ndotted: mean of the last tenth of the evaluations" % (
        tasks, over_seeds(SPREAD, groups)))
