"""Statistics over few seeds: interquartile means, intervals by bootstrap, who is better.

As Agarwal et al. recommend in "Deep Reinforcement Learning at the Edge of the Statistical
Precipice" (NeurIPS 2021). Scores are arrays seeds x tasks, of the tasks of one experiment, whose
returns share a unit: they are not normalised. The bootstrap draws seeds with replacement, for each
task anew (stratified), always with the same random numbers: the same scores, the same interval. An
interval is made of what was measured, so it cannot go beyond a bound of the returns. Of one seed
there is no interval.
"""

import numpy as np

REPETITIONS = 2000
CONFIDENCE = 0.95
SEED = 20210830


def interquartile_mean(scores):
    """Mean without the lowest and the highest quarter of all runs, over the last axes."""
    flat = np.sort(np.reshape(scores, np.shape(scores)[:-2] + (-1,)), axis=-1)
    cut = flat.shape[-1] // 4
    return flat[..., cut:flat.shape[-1] - cut].mean(axis=-1)


def overall_mean(scores):
    return np.mean(scores, axis=(-2, -1))


def resampled(scores, random):
    """REPETITIONS x seeds x tasks."""
    seeds, tasks = scores.shape
    drawn = random.integers(seeds, size=(REPETITIONS, seeds, tasks))
    return scores[drawn, np.arange(tasks)]


def limits(values):
    """(low, high) of the middle CONFIDENCE of what a bootstrap gave, along the first axis."""
    tail = 50 * (1 - CONFIDENCE)
    return np.percentile(values, (tail, 100 - tail), axis=0)


def interval(scores, statistic=interquartile_mean):
    """(low, high) of the statistic, or None of fewer than two seeds."""
    scores = np.asarray(scores, dtype=float)
    if len(scores) < 2:
        return None
    low, high = limits(statistic(resampled(scores, np.random.default_rng(SEED))))
    return float(low), float(high)


def curve_interval(curves):
    """(low, high), each a value a round, of the mean over seeds; None of fewer than two seeds.

    A seed is drawn with its whole curve of means over the tasks.
    """
    seeds = len(curves)
    if seeds < 2:
        return None
    drawn = np.random.default_rng(SEED).integers(seeds, size=(REPETITIONS, seeds))
    weights = np.stack([(drawn == seed).mean(axis=1) for seed in range(seeds)], axis=1)
    # of equal curves the rounding of the weighted mean must not leave what was measured
    return np.clip(limits(weights @ curves), curves.min(axis=0), curves.max(axis=0))


def better(ours, theirs):
    """Probability that a run of ours has more than one of theirs on a task, mean over tasks.

    Equal scores count half. Arrays may have further axes in front.
    """
    above = ours[..., :, None, :] > theirs[..., None, :, :]
    equal = ours[..., :, None, :] == theirs[..., None, :, :]
    return np.mean(above + 0.5 * equal, axis=(-3, -2, -1))


def improvement(ours, theirs):
    """(probability of improvement, its interval or None); the tasks must be the same."""
    ours, theirs = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    found = float(better(ours, theirs))
    if min(len(ours), len(theirs)) < 2:
        return found, None
    random = np.random.default_rng(SEED)
    low, high = limits(better(resampled(ours, random), resampled(theirs, random)))
    return found, (float(low), float(high))


def difference(ours, theirs):
    """(mean of ours less that of theirs, its interval or None), of one value a seed each."""
    return _of_means(ours, theirs, lambda one, other: one - other)


def percent_above(ours, theirs):
    """The same in percent of the size of theirs; None where theirs has no sign of its own."""
    if min(theirs) <= 0 <= max(theirs):
        return None
    return _of_means(ours, theirs, lambda one, other: 100 * (one - other) / abs(other))


def _of_means(ours, theirs, what):
    ours, theirs = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    found = float(what(ours.mean(), theirs.mean()))
    if min(len(ours), len(theirs)) < 2:
        return found, None
    random = np.random.default_rng(SEED)
    one, other = (values[random.integers(len(values), size=(REPETITIONS, len(values)))].mean(axis=1)
                  for values in (ours, theirs))
    low, high = limits(what(one, other))
    return found, (float(low), float(high))
