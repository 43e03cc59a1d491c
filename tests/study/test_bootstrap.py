import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hj_cosim.study.bootstrap import PooledPercentile, draw_weights, interval


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 10.0, 50.0, 90.0, 99.0]), st.booleans())
def test_a_weighted_percentile_is_that_of_the_repeated_samples(seed, percent, upwards):
    draw = np.random.default_rng(seed)
    samples = [np.round(draw.normal(size=draw.integers(1, 30)), 1) for _ in range(draw.integers(1, 6))]
    samples[0][0] = np.inf
    weights = draw.integers(0, 4, (5, len(samples)))
    weights[:, 0] += weights.sum(axis=1) == 0
    method = "higher" if upwards else "lower"
    expected = [
        np.percentile(
            np.concatenate([np.tile(own, n) for own, n in zip(samples, row, strict=True)]), percent, method=method
        )
        for row in weights
    ]
    pooled = PooledPercentile(samples, percent, upwards=upwards)
    np.testing.assert_array_equal(pooled(weights), expected)


def test_every_resample_has_as_many_episodes_as_there_are_and_draws_repeat():
    weights = draw_weights(20)
    assert weights.shape == (2000, 20)
    assert (weights.sum(axis=1) == 20).all()
    np.testing.assert_array_equal(weights, draw_weights(20))


def test_each_episode_is_drawn_equally_often():
    weights = draw_weights(25, resamples=4000)
    deviations = (weights.mean(axis=0) - 1.0) / np.sqrt((1 - 1 / 25) / 4000)
    assert np.abs(deviations).max() < 4.0


def test_the_interval_of_a_mean_agrees_with_the_normal_theory():
    data = np.random.default_rng(3).normal(10.0, 2.0, 200)
    means = draw_weights(len(data)) @ data / len(data)
    low, high = interval(means, len(data))
    error = data.std() / np.sqrt(len(data))
    assert low == pytest.approx(data.mean() - 1.96 * error, abs=0.15 * error)
    assert high == pytest.approx(data.mean() + 1.96 * error, abs=0.15 * error)


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    draw = np.random.default_rng(5)
    weights = draw_weights(40, resamples=1000)
    hits = 0
    for _ in range(400):
        low, high = interval(weights @ draw.normal(size=40) / 40, 40)
        hits += low <= 0.0 <= high
    assert 0.90 <= hits / 400 <= 0.98


def test_an_interval_may_be_infinite_but_never_nan():
    assert interval(np.array([1.0] * 50 + [np.inf] * 50), 2) == (1.0, np.inf)
    assert interval(np.full(100, np.inf), 2) == (np.inf, np.inf)


def test_a_single_episode_says_nothing_of_how_much_another_would_differ():
    assert np.isnan(interval(np.full(100, 3.0), 1)).all()
