"""Figures of pMeta's runs: learning curves, sweeps of a setting, and the convergence experiment."""

import os
import textwrap

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator, NullFormatter

import pmeta_runs as pr

# Okabe and Ito's colours, told apart by colour-blind readers as well
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#000000", "#666666"
PALETTE = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)
PP = {"color": RED, "linestyle": "-", "marker": "o"}
MP = {"color": BLUE, "linestyle": "-", "marker": "s"}
BASELINES = {  # algorithm: (the policy it is judged by, label, style)
    "model_averaging": ("meta", "MP, model averaging",
                        {"color": GREEN, "linestyle": "--", "marker": "^"}),
    "independent": ("personal", "PP, independent",
                    {"color": PURPLE, "linestyle": "-.", "marker": "D"}),
}
STYLE = {
    "font.size": 10, "axes.titlesize": 10.5, "axes.labelsize": 10, "legend.fontsize": 9.5,
    "xtick.labelsize": 9.5, "ytick.labelsize": 9.5, "axes.grid": True, "grid.linewidth": 0.4,
    "grid.color": "#cccccc", "axes.axisbelow": True, "axes.spines.top": False,
    "axes.spines.right": False, "axes.linewidth": 0.8, "lines.linewidth": 1.7,
    "lines.markersize": 4.5, "legend.frameon": False, "savefig.dpi": 150, "pdf.fonttype": 42,
}
RETURN = "return (mean over tasks)"
MAX_PANELS = 3
MAX_SLICES = 4


def draw(experiments, convergence, kinds, out, formats):
    """Draws what `kinds` name and the data allow: {kind: [path]} of the files written."""
    figures = {kind: Figures(out, formats) for kind in ("curves", "sweep", "convergence")}
    with plt.rc_context(STYLE):
        draw_runs(experiments, kinds, figures["curves"], figures["sweep"])
        if "convergence" in kinds:
            draw_convergence(convergence, figures["convergence"])
    return {kind: figures[kind].written for kind in figures}


class Figures:
    """Writes figures into one folder and remembers what it wrote."""

    def __init__(self, out, formats):
        self.out = out
        self.formats = formats
        self.written = []

    def save(self, figure, name):
        """Writes and closes the figure; `name` may lie in a folder below `out`."""
        os.makedirs(os.path.dirname(os.path.join(self.out, name)), exist_ok=True)
        for extension in self.formats:
            path = os.path.join(self.out, name + "." + extension)
            # no date in the file: the same runs give the same bytes
            figure.savefig(path, metadata={"CreationDate": None} if extension == "pdf" else None)
            self.written.append(path)
        plt.close(figure)


def panels(rows, columns, sharey=True, panel_width=None):
    """Axes rows x columns; unless their width is given, with room for a legend on the right."""
    width = 3.3 * columns + 2.6 if columns > 1 else 7.2
    if panel_width is not None:
        width = panel_width * columns
    return plt.subplots(rows, columns, squeeze=False, sharey=sharey,
                        figsize=(width, 3.4 * rows + 0.3), constrained_layout=True)


def legend_right(axes):
    """One legend for all panels of a row, beside the last."""
    entries = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    axes[-1].legend(list(entries.values()), list(entries), loc="center left",
                    bbox_to_anchor=(1.02, 0.5), borderaxespad=0, handlelength=2.6,
                    ncol=1 + len(entries) // 16)


def headline(figure, text):
    figure.suptitle(text.replace("$", "\\$"), x=0.01, ha="left", fontsize=11)


def seeds_text(groups):
    counts = [len(group.runs) for group in groups]
    if max(counts) == 1:
        return "1 seed"
    fewest = "" if min(counts) == max(counts) else "%d to " % min(counts)
    return "%s%d seeds" % (fewest, max(counts))


def over_seeds(what, groups):
    """"mean ± what over 5 seeds", or of one seed the value itself."""
    seeds = seeds_text(groups)
    return seeds if seeds == "1 seed" else "%s over %s" % (what, seeds)


def round_axis(axis, rounds):
    axis.set_xlabel("round")
    axis.set_xlim(rounds[0] - 0.3, rounds[-1] + 0.3)
    if len(rounds) <= 10:
        axis.set_xticks(rounds)
    else:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))


def draw_curve(axis, group, policy, label, band=True, **style):
    """Mean over seeds, and the sample standard deviation as a band."""
    curves = group.curves(policy)
    mean = curves.mean(axis=0)
    style.setdefault("markevery", max(1, len(mean) // 15))
    axis.plot(group.rounds, mean, label=label, **style)
    if band and len(curves) > 1:
        std = curves.std(axis=0, ddof=1)
        axis.fill_between(group.rounds, mean - std, mean + std, color=style["color"], alpha=0.16,
                          linewidth=0)


def draw_optimum(axis, groups):
    values = [group.optimal() for group in groups]
    if None not in values and np.allclose(values, values[0], rtol=1e-9, atol=0):
        axis.axhline(values[0], color=BLACK, linestyle=(0, (4, 3)), linewidth=1,
                     label="optimum")


def learning_curves(experiment, groups, figures, prefix):
    """pMeta-RL against its baselines, a panel for every setting that they share."""
    pmeta = pmeta_only(groups)
    contexts = {}
    for group in pmeta:
        contexts.setdefault(group.context(), []).append(group)
    shown = [pr.reference(members) for members in contexts.values()]
    if len(shown) > MAX_PANELS:
        shown = [pr.reference(pmeta)]
    # tasks that differ between panels have scales of their own
    sharey = not any(key.startswith("environment.") for key in pr.varying(shown))

    figure, axes = panels(1, max(1, len(shown)), sharey)
    drawn = []
    for axis, group in zip(axes[0], shown):
        name = " ".join([pr.ALGORITHMS["pmeta"]] + pr.setting_texts(group, []))
        panel = [group]
        for policy, label, style in (("meta", "MP, ", MP), ("personal", "PP, ", PP)):
            if policy in group.policies:
                draw_curve(axis, group, policy, label + name, zorder=3, **style)
        for algorithm, (policy, label, style) in BASELINES.items():
            baseline = pr.baseline_of(group, groups, algorithm)
            if baseline is not None and policy in baseline.policies:
                draw_curve(axis, baseline, policy, label, **style)
                panel.append(baseline)
        draw_optimum(axis, panel)
        axis.set_title(_wrapped(pr.fixed_texts(group, pmeta, "personal.lambda")), loc="left")
        round_axis(axis, group.rounds)
        drawn += panel
    if not shown:
        drawn = groups[:len(PALETTE)]
        for group, color in zip(drawn, PALETTE):
            for policy in group.policies[-1:]:
                draw_curve(axes[0][0], group, policy, group.label, color=color, marker="o")
        draw_optimum(axes[0][0], drawn)
        round_axis(axes[0][0], max((group.rounds for group in drawn), key=len))
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    headline(figure, "%s: %s" % (experiment, over_seeds("mean ± standard deviation", drawn)))
    figures.save(figure, prefix + "learning_curves")


def setting_curves(experiment, key, members, groups, figures, name):
    """Curves of PP and MP for every value of one setting."""
    figure, axes = panels(1, 2)
    numeric = all(pr.is_number(group.settings.get(key)) for group in members)
    for axis, policy, title in zip(axes[0], ("personal", "meta"),
                                   ("PP, personal policies", "MP, meta-policy")):
        for i, group in enumerate(members):
            if policy not in group.policies:
                continue
            # ordered values get an ordered colour map that keeps its order in grey, too
            color = (plt.get_cmap("viridis")(0.87 * i / (len(members) - 1)) if numeric
                     else PALETTE[i % len(PALETTE)])
            draw_curve(axis, group, policy, pr.setting_text(key, group.settings.get(key)),
                       band=False, color=color, marker="osD^vP*X"[i % 8])
        baseline = averaging_of(members[0], groups)
        if baseline is not None and all(averaging_of(g, groups) is baseline for g in members):
            draw_curve(axis, baseline, "meta", "MP, model averaging", band=False, color=GREY,
                       linestyle="--", linewidth=1.4)
        draw_optimum(axis, members)
        axis.set_title(title, loc="left")
        round_axis(axis, max((group.rounds for group in members), key=len))
    axes[0][0].set_ylabel(RETURN)
    legend_right(axes[0])
    fixed = pr.fixed_texts(members[0], pmeta_only(groups), key)
    headline(figure, "%s: %s, %s" % (experiment, " ".join(["pMeta-RL"] + fixed),
                                     over_seeds("mean", members)))
    figures.save(figure, name)


def pmeta_only(groups):
    return [group for group in groups if group.algorithm == "pmeta"]


def averaging_of(group, groups):
    """Model averaging with the settings of `group`, if it has a meta-policy to draw."""
    baseline = pr.baseline_of(group, groups)
    return baseline if baseline is not None and "meta" in baseline.policies else None


def _wrapped(texts):
    return textwrap.fill(" ".join(texts), 38)


def mean_and_error(values):
    """Mean and standard error over seeds; the error of one seed is 0 wide, not known."""
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else 0.0


def sweep_figure(experiment, key, found, groups, figures, name):
    """Return against one numeric setting: at the last round, and as the mean over the rounds."""
    figure, axes = panels(len(found), 2)
    for row, members in zip(axes, found):
        for axis, measure, title in zip(row, ("last", "auc"),
                                        ("at the last round", "mean over all rounds")):
            draw_sweep(axis, key, members, measure, groups)
            fixed = pr.fixed_texts(members[0], pmeta_only(groups), key)
            axis.set_title("\n".join([title] + ([_wrapped(fixed)] if fixed else [])), loc="left")
            axis.set_xlabel("%s (%s)" % (pr.symbol(key), key) if pr.symbol(key) != key else key)
        row[0].set_ylabel(RETURN)
    legend_right(axes[0])
    drawn = [group for members in found for group in members]
    headline(figure, "%s: %s" % (experiment, over_seeds("mean ± standard error", drawn)))
    figures.save(figure, name)


def draw_sweep(axis, key, members, measure, groups):
    values = np.array([group.settings[key] for group in members], dtype=float)
    for policy, label, style in (("meta", "MP", MP), ("personal", "PP", PP)):
        if all(policy in group.policies for group in members):
            draw_points(axis, values, members, measure, policy,
                        label + ", " + pr.ALGORITHMS.get(members[0].algorithm,
                                                         members[0].algorithm), style)
    baselines = [averaging_of(group, groups) for group in members]
    known = [b for b in baselines if b is not None]
    if known and all(b is known[0] for b in baselines):
        mean, error = mean_and_error(getattr(known[0], measure)("meta"))
        axis.axhline(mean, color=GREEN, linestyle="--", linewidth=1.4,
                     label="MP, model averaging")
        axis.axhspan(mean - error, mean + error, color=GREEN, alpha=0.16, linewidth=0)
    elif known:
        draw_points(axis, [v for v, b in zip(values, baselines) if b is not None], known, measure,
                    *BASELINES["model_averaging"])
    if values.min() > 0 and values.max() / values.min() >= 30:
        axis.set_xscale("log")
        axis.minorticks_off()
    axis.set_xticks(_spread_ticks(axis, values))
    axis.set_xticklabels(["%g" % v for v in axis.get_xticks()])


def _spread_ticks(axis, values):
    """The values themselves as ticks, without those that would touch."""
    place = np.log(values) if axis.get_xscale() == "log" else values
    gap = 0.035 * (max(len("%g" % v) for v in values) + 0.7) * (place.max() - place.min())
    ticks, last = [], -np.inf
    for value, x in zip(values, place):
        if x - last >= gap:
            ticks.append(value)
            last = x
    return ticks


def draw_points(axis, values, members, measure, policy, label, style):
    points = [mean_and_error(getattr(group, measure)(policy)) for group in members]
    axis.errorbar(values, [p[0] for p in points], yerr=[p[1] for p in points], label=label,
                  capsize=2.5, elinewidth=1.2, **style)


def draw_runs(experiments, kinds, curves, sweeps):
    """Curves and sweeps of every experiment; with several, each in a folder of its own."""
    for experiment, groups in experiments.items():
        prefix = experiment + os.sep if len(experiments) > 1 else ""
        if "curves" in kinds:
            learning_curves(experiment, groups, curves, prefix)
        pmeta = pmeta_only(groups)
        keys = pr.varying(pmeta)
        names = [pr.short_name(key) for key in keys]
        for key in keys:
            found = pr.slices(pmeta, key)
            numeric = [m for m in found if all(pr.is_number(g.settings.get(key)) for g in m)]
            # two settings may share the last part of their name
            name = pr.short_name(key) if names.count(pr.short_name(key)) == 1 else key
            # curves of unlike tasks in one panel would compare nothing
            if "curves" in kinds and found and (numeric or not key.startswith("environment.")):
                members = max(found, key=lambda m: (len(m), pr.reference(pmeta) in m))
                setting_curves(experiment, key, members, groups, curves, prefix + name + "_curves")
            if "sweep" in kinds and numeric:
                numeric.sort(key=len, reverse=True)
                if len(numeric) > MAX_SLICES:
                    pr.warn("sweep_%s shows %d of the %d combinations of the other settings."
                            % (name, MAX_SLICES, len(numeric)))
                sweep_figure(experiment, key, numeric[:MAX_SLICES], groups, sweeps,
                             prefix + "sweep_" + name)


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
        prefix = os.path.basename(os.path.normpath(folder)) + os.sep if len(found) > 1 else ""
        for name, draw, needed in drawings:
            if name in files and len(next(iter(files[name].values()))):
                pr.require_columns(os.path.join(folder, name), files[name], needed)
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
    left.set_ylabel("mean over tasks of |Q$_i$* − Q|²")
    legend_right(axes[0])
    headline(figure, "Theorem 2(b): squared distance of personal to meta tables, last round")
    figures.save(figure, name)


def lambda_axis(axis, lambdas, offset=0):
    """Ticks at the values of lambda themselves."""
    ticks = _spread_ticks(axis, np.unique(lambdas) + offset)
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
