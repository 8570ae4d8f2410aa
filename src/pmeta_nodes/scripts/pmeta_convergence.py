"""Figures of the convergence experiment: what was measured beside what the theory says."""

import os

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullFormatter

from pmeta_drawing import (BLACK, BLUE, GREEN, GREY, PALETTE, RED, folder_for, headline,
                           legend_right, panels, spread_ticks)
from pmeta_files import require_columns

UPDATES = {  # of fixed_point.csv: label, style
    "exact": ("expected update", {"color": BLACK, "linestyle": "-", "marker": "o"}),
    "robbins_monro": ("sampled, shrinking step", {"color": BLUE, "linestyle": "-", "marker": "s"}),
    "constant": ("sampled, constant step", {"color": GREEN, "linestyle": "--", "marker": "^"}),
    "plus_sign": ("sign as printed (+)", {"color": RED, "linestyle": ":", "marker": "D"}),
}


def draw_convergence(found, figures):
    """The paper's theory: what was measured with the theoretical curve beside it."""
    drawings = (("contraction.csv", draw_contraction,
                 ("lambda", "worst_pair", "worst_shift", "bound")),
                ("fixed_point.csv", draw_fixed_point, ("lambda", "update", "sweeps", "distance")),
                ("gradient.csv", draw_gradient,
                 ("diversity", "lambda", "step", "eta", "round", "grad_norm2", "running_mean",
                  "shape")),
                ("distance.csv", draw_distance,
                 ("diversity", "lambda", "distance2", "entry_distance2", "entry_bound")))
    for folder, files in found.items():
        prefix = folder_for(os.path.basename(os.path.normpath(folder)), found)
        for name, draw, needed in drawings:
            if name in files and len(next(iter(files[name].values()))):
                require_columns(os.path.join(folder, name), files[name], needed)
                draw(files[name], figures, prefix + "convergence_" + name[:-len(".csv")])


def draw_contraction(data, figures, name):
    """Largest ratio found for each lambda, on log-log axes where the theory is a straight line."""
    figure, axes = panels(1, 1)
    axis = axes[0][0]
    x = 1 + data["lambda"]
    gamma = float(np.mean(data["bound"] * x))
    line = np.geomspace(x.min(), x.max(), 50)
    axis.loglog(line, gamma / line, color=BLACK, linewidth=1.2,
                label="theory: γ / (1 + λ), γ = %.3g" % gamma)
    axis.loglog(x, data["worst_shift"], "s", color=BLUE, markersize=9, markerfacecolor="none",
                markeredgewidth=1.5, label="measured: constant shifts")
    axis.loglog(x, data["worst_pair"], "o", color=RED, label="measured: random pairs")
    lambda_axis(axis, data["lambda"], offset=1)
    axis.set_xlabel("λ (at 1 + λ on a logarithmic axis)")
    axis.set_ylabel("largest ratio of distances\nafter and before one update")
    legend_right([axis])
    slope = _slope(x, np.maximum(data["worst_pair"], data["worst_shift"]))
    headline(figure, "contraction of the personalised update: measured slope %s" % _signed(slope))
    figures.save(figure, name)


def draw_fixed_point(data, figures, name):
    """Distance to the fixed point against sweeps, a panel for each lambda."""
    lambdas = sorted(set(data["lambda"]))
    figure, axes = panels(1, len(lambdas))
    for axis, value in zip(axes[0], lambdas):
        for update, (label, style) in UPDATES.items():
            chosen = (data["lambda"] == value) & (data["update"] == update)
            # logarithms know no exact hit; a diverged distance may have overflowed
            chosen &= np.isfinite(data["distance"]) & (data["distance"] > 0)
            if chosen.any():
                axis.loglog(data["sweeps"][chosen], data["distance"][chosen], label=label, **style)
        axis.set_title("λ=%g" % value, loc="left")
        axis.set_xlabel("sweeps K")
    axes[0][0].set_ylabel("distance to the fixed point\n(largest entry, units of return)")
    legend_right(axes[0])
    headline(figure, "Theorem 1: personalised update with a frozen meta table")
    figures.save(figure, name)


def draw_gradient(data, figures, name):
    """Running mean of the squared gradient norm, a panel for each task set."""
    used = data["step"] == "used"
    sets = list(dict.fromkeys(data["diversity"][used]))
    columns = min(2, len(sets))
    figure, axes = panels(-(-len(sets) // columns), columns, panel_width=4.3)
    lambdas = sorted(set(data["lambda"][used]))
    for axis, tasks in zip(axes.flat, sets):
        for i, value in enumerate(lambdas):
            chosen = used & (data["diversity"] == tasks) & (data["lambda"] == value)
            rounds, mean = data["round"][chosen], data["running_mean"][chosen]
            color = plt.get_cmap("viridis")(0.87 * i / max(1, len(lambdas) - 1))
            axis.loglog(rounds, mean, color=color, marker="osD^vP*X"[i % 8],
                        markevery=_log_places(len(rounds)),
                        label="λ=%g, η=%.3g: slope %s" % (value, data["eta"][chosen][0],
                                                          _signed(_tail_slope(rounds, mean))))
            axis.loglog(rounds, data["grad_norm2"][chosen], color=color, linewidth=0.8, alpha=0.6)
        draw_shape(axis, data, used & (data["diversity"] == tasks))
        axis.set_title("task set: " + tasks, loc="left")
        axis.set_xlabel("round")
        axis.legend(loc="lower left", handlelength=2.2, labelspacing=0.25)
    for axis in axes[:, 0]:
        axis.set_ylabel("‖∇L‖² (sum over entries)")
    for axis in axes.flat[len(sets):]:
        axis.set_visible(False)
    headline(figure, "Theorem 2(a): running mean of ‖∇L‖² (marked), its value in each round "
             "(thin), slopes from round 10 on")
    figures.save(figure, name)


def draw_shape(axis, data, chosen):
    """The bound of Theorem 2(a), whose constants are free: scaled to the highest measured curve."""
    rounds = data["round"][chosen]
    start = rounds[rounds >= _tail_start(rounds)].min()
    height = data["running_mean"][chosen][rounds == start].max()
    order = sorted(set(zip(rounds, data["shape"][chosen])))
    x, shape = np.array([point for point in order if point[0] >= start]).T
    axis.loglog(x, shape * height / shape[0], color=BLACK, linestyle="--", linewidth=1.2,
                label="theory, scaled: slope %s" % _signed(_slope(x, shape)))


def draw_distance(data, figures, name):
    """Distance of personal policies to the meta-policy against lambda, and the full bound."""
    figure, axes = panels(1, 2, sharey=False)
    left, right = axes[0]
    sets = list(dict.fromkeys(data["diversity"]))
    # 1/lambda^2 is what remains for large lambda
    start = 5 if np.sum(np.unique(data["lambda"]) >= 5) > 1 else 0
    for tasks, color, marker in zip(sets, PALETTE, "osD^vP*"):
        rows = data["diversity"] == tasks
        lambdas, distance = data["lambda"][rows], data["distance2"][rows]
        large = lambdas >= start
        style = {"color": color, "marker": marker}
        left.loglog(lambdas, distance, label="%s: slope %s" % (
            tasks, _signed(_slope(lambdas[large], distance[large]))), **style)
        right.loglog(lambdas, data["entry_distance2"][rows], **style)
        known = np.isfinite(data["entry_bound"][rows])
        right.loglog(lambdas[known], data["entry_bound"][rows][known], linestyle="--",
                     markerfacecolor="white", **style)
    x = np.unique(data["lambda"])
    top = data["distance2"][data["lambda"] == x[-1]].max()
    left.loglog(x, 2 * top * (x / x[-1]) ** -2.0, color=BLACK, linestyle="--", linewidth=1.2,
                label="theory, scaled: slope −2")
    right.plot([], [], color=GREY, marker="o", label="filled: measured")
    right.plot([], [], color=GREY, marker="o", markerfacecolor="white", linestyle="--",
               label="hollow: bound of Theorem 2(b)")
    for axis in axes[0]:
        lambda_axis(axis, data["lambda"])
        axis.set_xlabel("λ")
    left.set_title("all entries" + ("; slopes for λ ≥ %g" % start if start else ""), loc="left")
    right.set_title("the entry (s,a) where it is largest", loc="left")
    left.set_ylabel("mean over tasks of |Qᵢ* − Q|²")
    legend_right(axes[0])
    headline(figure, "Theorem 2(b): squared distance of personal to meta tables, last round")
    figures.save(figure, name)


def lambda_axis(axis, lambdas, offset=0):
    """Ticks at the values of lambda themselves."""
    ticks = spread_ticks(axis, np.unique(lambdas) + offset)
    axis.set_xticks(ticks)
    axis.set_xticklabels(["%g" % (tick - offset) for tick in ticks])
    axis.tick_params(axis="x", which="minor", bottom=False)
    axis.xaxis.set_minor_formatter(NullFormatter())


def _log_places(count):
    return sorted(set(int(round(x)) - 1 for x in np.geomspace(1, count, 9)))


def _tail_start(rounds):
    return min(10, rounds.max() / 2)


def _tail_slope(rounds, values):
    """Least-squares slope in log-log from round 10 on: before, nothing has had time to fall."""
    tail = rounds >= _tail_start(rounds)
    return _slope(rounds[tail], values[tail])


def _slope(x, y):
    good = (x > 0) & (y > 0) & np.isfinite(y)
    if good.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(x[good]), np.log(y[good]), 1)[0])


def _signed(value):
    return ("%.2f" % value).replace("-", "−")
