"""Tests of the statistics in tables and figures, against cases worked out by hand."""

import sys

import numpy as np
import pytest

from programs import TOP

sys.path.insert(0, str(TOP / "src/pmeta_nodes/scripts"))
import pmeta_statistics as ps


def test_interquartile_mean_leaves_out_a_quarter_at_each_end():
    # 8 runs: 1 2 | 3 4 5 6 | 7 100
    assert ps.interquartile_mean([[100, 3], [2, 6], [5, 1], [4, 7]]) == 4.5
    # fewer than four: nothing to leave out; five: one at each end
    assert ps.interquartile_mean([[1], [2], [9]]) == 4
    assert ps.interquartile_mean([[1], [2], [9], [4], [-50]]) == pytest.approx(7 / 3)
    # over the last two axes
    assert list(ps.interquartile_mean([[[1], [3]], [[5], [9]]])) == [2, 7]


def test_interval_of_two_seeds_is_from_one_to_the_other():
    # the bootstrap gives 1, 2 and 3 with probabilities 1/4, 1/2, 1/4
    assert ps.interval([[1.0], [3.0]]) == (1, 3)
    assert ps.interval([[1.0, 5.0]]) is None


def test_interval_of_two_tasks_is_stratified():
    # each task is drawn anew: the mean is 0, 1 or 2 of either, so 0 with 1/16 and 2 with 1/16
    assert ps.interval([[0.0, 100.0], [2.0, 102.0]], ps.overall_mean) == (50, 52)
    # three seeds: the mean of one task is below 1/3 with 8/27, above 2/3 with 1/27 (> 2.5 %)
    assert ps.interval([[0.0], [0.0], [1.0]], ps.overall_mean) == (0, 1)
    # four seeds: all four the 1 with 1/256 only, three or more with 13/256, so up to 3/4
    assert ps.interval([[0.0], [0.0], [0.0], [1.0]], ps.overall_mean) == (0, 0.75)


def test_interval_is_the_same_every_time_and_within_what_was_measured():
    scores = np.minimum(200, 190 + 15 * np.random.default_rng(1).random((5, 5)))
    low, high = ps.interval(scores)
    assert (low, high) == ps.interval(scores)
    assert scores.min() <= low < ps.interquartile_mean(scores) <= high <= 200


def test_interval_of_a_curve_holds_in_each_round():
    curves = np.array([[1.0, 200.0, -3.0], [3.0, 200.0, -1.0]])
    low, high = ps.curve_interval(curves)
    assert list(low) == [1, 200, -3] and list(high) == [3, 200, -1]
    assert ps.curve_interval(curves[:1]) is None
    low, high = ps.curve_interval(np.full((5, 2), 199.96))
    assert list(low) == list(high) == [199.96, 199.96]


def test_probability_of_improvement_counts_pairs_and_halves_ties():
    # task 0: 2>1, 2<3, 4>1, 4>3: 3/4; task 1: equal throughout: 1/2
    assert ps.improvement([[2, 5], [4, 5]], [[1, 5], [3, 5]])[0] == 0.625
    # different numbers of seeds
    assert ps.improvement([[2], [4], [0]], [[1]]) == (pytest.approx(2 / 3), None)


def test_interval_of_the_probability_of_improvement():
    sure, limits = ps.improvement([[5, 6], [7, 8]], [[1, 2], [3, 4]])
    assert (sure, limits) == (1, (1, 1))
    # with 1/4 ours are both 0, with 1/4 both 3: the probability is then 0 or 1
    value, limits = ps.improvement([[0], [3]], [[1], [2]])
    assert (value, limits) == (0.5, (0, 1))
    back, turned = ps.improvement([[1], [2]], [[0], [3]])
    assert (back, turned) == (0.5, (0, 1))


if __name__ == "__main__":
    sys.exit(pytest.main([__file__]))
