"""The metrics of a row of the table, over all its episodes, and their bootstrap replicates.

How the episodes of a row become one number is declared with each metric (`metrics.catalogue`). The paper's fractions
and means are over samples: an episode's summary holds those of its own samples, so that those of the row are the
averages weighted by the number of samples; percentiles need the samples themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hj_cosim.metrics.catalogue import METRICS, require_declared
from hj_cosim.metrics.declaration import (
    SUM_OVER_EPISODES,
    EpisodesWith,
    Metric,
    OverEpisodes,
    PercentileOfSamples,
    WeightedMean,
)
from hj_cosim.study.bootstrap import DRAW_SEED, PooledPercentile, draw_weights, interval

Replicates = Mapping[str, np.ndarray]

OTHER_DRAW_SEED = DRAW_SEED + 1  # of a row whose episodes have nothing in common with another's


@dataclass(frozen=True)
class EpisodeResult:
    """What the tables take from an episode's run folder."""

    seed: int
    summary: Mapping[str, Any]  # summary.json, +inf where it has null
    samples: Mapping[str, np.ndarray]  # (N,) each of metrics.catalogue.SAMPLE_COLUMNS
    timing: Mapping[str, float] = field(default_factory=dict)  # timing.json


def replicates(results: Sequence[EpisodeResult], weights: np.ndarray) -> dict[str, np.ndarray]:
    """Return every metric (R,) of the episodes, each counted as often as each row of `weights` says.

    Args:
        results: E episodes, one or more, whose summaries have the same metrics.
        weights: (R, E) whole numbers; a row of ones is the data themselves.

    Raises:
        MetricError: if a summary has a metric that is not declared: nobody would know how to pool it.
    """
    for result in results:
        require_declared(result.summary)
    known = results[0].summary
    return {
        name: _pooled(metric, results, weights)
        for name, metric in METRICS.items()
        if (metric.pooling.metric if isinstance(metric.pooling, EpisodesWith) else name) in known
    }


def _pooled(metric: Metric, results: Sequence[EpisodeResult], weights: np.ndarray) -> np.ndarray:
    """Return a metric (R,) of the episodes as it is declared; arguments as `replicates`."""

    def of_episodes(name: str) -> np.ndarray:
        return np.array([result.summary[name] for result in results], float)

    match metric.pooling:
        case PercentileOfSamples(column, percent, upwards):
            return PooledPercentile([result.samples[column] for result in results], percent, upwards=upwards)(weights)
        case EpisodesWith(other):
            return _weighted_sum(weights, (of_episodes(other) > 0.0).astype(float))
        case WeightedMean(by):
            by_episodes = weights * of_episodes(by)
            # Where all weights are zero (nothing was promised), every episode counts the same.
            nothing = by_episodes.sum(axis=1, keepdims=True) == 0.0
            chosen = np.where(nothing, weights, by_episodes)
            return _weighted_sum(chosen, of_episodes(metric.name)) / chosen.sum(axis=1)
        case OverEpisodes(of):
            return _over_episodes(of, weights, of_episodes(metric.name))


def _over_episodes(of: str, weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return (R,) the mean, sum, smallest or largest of the episodes' values (E,) that are drawn."""
    if of == "smallest":
        return np.where(weights > 0, values, np.inf).min(axis=1)
    if of == "largest":
        return np.where(weights > 0, values, -np.inf).max(axis=1)
    total = _weighted_sum(weights, values)
    return total / weights.sum(axis=1) if of == "mean" else total


def _weighted_sum(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    # Not a matrix product: its order of summation depends on the library and the machine, and a table is to be the
    # same byte for byte. An episode that was not drawn adds nothing, even if its value is infinite.
    return np.where(weights > 0, weights * np.where(weights > 0, values, 0.0), 0.0).sum(axis=1)


@dataclass(frozen=True)
class Estimate:
    """A metric with its 95 % bootstrap interval over episodes."""

    value: float
    low: float
    high: float


class RowStatistics:
    """The statistics of one row of the table, over all its episodes or over those of some seeds."""

    def __init__(self, results: Sequence[EpisodeResult]) -> None:
        """Take a row's episodes, no seed twice."""
        self._results = {result.seed: result for result in sorted(results, key=lambda result: result.seed)}
        self._known: dict[tuple[int, ...], tuple[Replicates, Replicates]] = {}

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of the episodes that there are, ascending."""
        return tuple(self._results)

    def summary(self, seed: int) -> Mapping[str, Any]:
        """Return the summary of the episode of a seed, +inf where summary.json has null."""
        return self._results[seed].summary

    def estimates(self) -> dict[str, Estimate]:
        """Return every metric with its interval; empty without episodes."""
        observed, drawn = self.observed_and_drawn(self.seeds)
        return _estimates(observed, drawn, len(self.seeds))

    def differences(self, other: "RowStatistics") -> tuple[int, dict[str, Estimate]]:
        """Return how much each metric exceeds that of another row, on the seeds that both have.

        Both rows get the same draws of seeds: traffic that is hard for one is mostly hard for the other, too, and
        falls out of the difference.

        Returns:
            The number of common seeds, and the differences; none without common seeds.
        """
        common = tuple(seed for seed in self.seeds if seed in other._results)
        ours, theirs = self.observed_and_drawn(common), other.observed_and_drawn(common)
        return len(common), _estimates(_minus(ours[0], theirs[0]), _minus(ours[1], theirs[1]), len(common))

    def independent_differences(self, other: "RowStatistics") -> dict[str, Estimate]:
        """Return how much each metric exceeds that of another row whose episodes have nothing in common with these.

        Sums over unequally many episodes are not compared.
        """
        ours, theirs = self.observed_and_drawn(self.seeds), other._observed_and_drawn(other.seeds, OTHER_DRAW_SEED)
        alike = [name for name in ours[0] if name in theirs[0]]
        if len(self.seeds) != len(other.seeds):
            alike = [name for name in alike if not _is_sum(METRICS[name])]
        observed, drawn = ({name: part[name] for name in alike} for part in ours)
        return _estimates(_minus(observed, theirs[0]), _minus(drawn, theirs[1]), min(len(self.seeds), len(other.seeds)))

    def observed_and_drawn(self, seeds: tuple[int, ...]) -> tuple[Replicates, Replicates]:
        """Return every metric of the episodes of `seeds` (1,), and their bootstrap replicates (RESAMPLES,)."""
        if seeds not in self._known:
            self._known[seeds] = self._observed_and_drawn(seeds, DRAW_SEED)
        return self._known[seeds]

    def _observed_and_drawn(self, seeds: tuple[int, ...], draw_seed: int) -> tuple[Replicates, Replicates]:
        if not seeds:
            return {}, {}
        chosen = [self._results[seed] for seed in seeds]
        once = np.ones((1, len(chosen)), np.int32)
        return replicates(chosen, once), replicates(chosen, draw_weights(len(chosen), seed=draw_seed))


def _is_sum(metric: Metric) -> bool:
    return isinstance(metric.pooling, EpisodesWith) or metric.pooling == SUM_OVER_EPISODES


def _estimates(observed: Replicates, drawn: Replicates, episodes: int) -> dict[str, Estimate]:
    return {name: Estimate(float(observed[name][0]), *interval(drawn[name], episodes)) for name in observed}


def _minus(ours: Replicates, theirs: Replicates) -> dict[str, np.ndarray]:
    """Return the differences; two infinite values that are equal differ by nothing."""
    return {
        name: np.subtract(own, theirs[name], out=np.zeros_like(own), where=own != theirs[name])
        for name, own in ours.items()
    }
