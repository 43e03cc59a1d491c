"""Bootstrap intervals over episodes: whole episodes are drawn with replacement, samples within one never part.

Samples of one episode follow each other by 0.02 s and are anything but independent, so that an interval over samples
would be far too narrow (Efron & Tibshirani 1993, section 8.6). Two rows on the same seeds are given the same draws,
which makes the interval of their difference a paired one.
"""

import numpy as np
from numba import njit

RESAMPLES = 2000
DRAW_SEED = 20  # of the draws, so that a table is the same byte for byte, whenever it is made


def draw_weights(episodes: int, resamples: int = RESAMPLES, seed: int = DRAW_SEED) -> np.ndarray:
    """Return (resamples, episodes) int32, how often each resample drew each episode; the same for the same seed."""
    draws = np.random.default_rng(seed).integers(0, episodes, (resamples, episodes))
    shifted = draws + episodes * np.arange(resamples)[:, None]
    counts = np.bincount(shifted.ravel(), minlength=resamples * episodes)
    return counts.reshape(resamples, episodes).astype(np.int32)


def interval(replicates: np.ndarray, episodes: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval of a statistic's replicates (R,), which may be infinite.

    Its ends are replicates themselves, the outer ones of the neighbours. NaN of a single episode: all its resamples
    are itself, which says nothing of how much another would differ.
    """
    if episodes < 2:
        return float("nan"), float("nan")
    ordered = np.sort(replicates)
    tail = 0.5 * (1.0 - confidence) * (len(ordered) - 1)
    return float(ordered[int(np.floor(tail))]), float(ordered[len(ordered) - 1 - int(np.floor(tail))])


class PooledPercentile:
    """A percentile of all samples of all episodes, for any number of times that each episode counts.

    It is a sample itself, as `numpy.percentile` with the methods `lower` and `higher` has it: TTC may be infinite, and
    so cannot be interpolated.
    """

    def __init__(self, samples: list[np.ndarray], percent: float, *, upwards: bool) -> None:
        """Take the samples of each episode.

        Args:
            samples: (N_e,) per episode, without NaN.
            percent: of the samples that are at most the percentile.
            upwards: take the larger of the two neighbours, and else the smaller.
        """
        self._percent, self._upwards = percent, upwards
        self._lengths = np.array([len(own) for own in samples], np.int64)
        values = np.concatenate(samples)
        episode = np.repeat(np.arange(len(samples), dtype=np.int32), self._lengths)
        order = np.argsort(values, kind="stable")
        if upwards:
            order = order[::-1]
        self._values, self._episode = values[order], episode[order]

    def __call__(self, weights: np.ndarray) -> np.ndarray:
        """Return the percentile (R,) for each row of `weights` (R, episodes), whole numbers."""
        last = weights @ self._lengths - 1
        rank = self._percent / 100.0 * last
        # Ranks are counted from the end that is near: from the largest sample for a high percentile.
        steps = last - np.ceil(rank) if self._upwards else np.floor(rank)
        return self._values[_positions(self._episode, weights, steps.astype(np.int64))]


# A walk from the near tail: a percentile of 10 needs a tenth of the samples, and nothing of shape (R, samples).
@njit(cache=True)
def _positions(episode: np.ndarray, weights: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return (R,) the place of the sample that has more than `steps` (R,) samples up to and with it."""
    places = np.empty(len(steps), np.int64)
    for resample in range(len(steps)):
        place, passed = -1, 0
        while passed <= steps[resample]:
            place += 1
            passed += weights[resample, episode[place]]
        places[resample] = place
    return places
