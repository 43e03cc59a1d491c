"""The metrics of a row of the table, over all samples of all its episodes, and their bootstrap replicates.

The paper's fractions, percentiles and means are over samples. An episode's summary holds the fractions and means of
its own samples, so that those of the row are the averages weighted by the number of samples; percentiles need the
samples themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hj_cosim.study.bootstrap import PooledPercentile, draw_weights, interval

# Which percentile of which column of robot.parquet, and whether the larger neighbour is the more dangerous one.
PERCENTILES: Mapping[str, tuple[str, float, bool]] = {
    "ttc_p10": ("ttc", 10.0, False),
    "ttc_p1": ("ttc", 1.0, False),
    "btn_p90": ("btn", 90.0, True),
    "stn_p90": ("stn", 90.0, True),
}
SAMPLE_COLUMNS = tuple(dict.fromkeys(column for column, _, _ in PERCENTILES.values()))

_TOTALS = (
    *("collisions", "hard_brakes_imposed", "promise_samples"),
    *("not_judged_samples", "desired_not_finite_samples", "solver_failures"),
    *("escape_samples", "no_escape_samples"),
)
_MINIMA = ("min_gap", "min_gap_ahead", "headway_min")
_MAXIMA = ("drac_max", "max_abs_jerk", "max_abs_lateral_acceleration")
_PER_EPISODE = ("distance", "lane_changes", "time_value_le_0", "headway_p10", "drac_p90")
COLLISION_EPISODES = "collision_episodes"
# Facts about an episode that are no result of it, and what depends on the machine.
_NOT_METRICS = (
    *("planner", "filter", "scheme", "seed", "scenario", "duration", "ended", "samples"),
    *("wall_seconds", "real_time_factor"),
)


Replicates = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class EpisodeResult:
    """What the tables take from an episode's run folder."""

    seed: int
    summary: Mapping[str, Any]  # summary.json, +inf where it has null
    samples: Mapping[str, np.ndarray]  # (N,) each of SAMPLE_COLUMNS


def _summary_metrics(results: Sequence[EpisodeResult]) -> tuple[str, ...]:
    """Return the metrics of the summaries, in their order."""
    return tuple(name for name in results[0].summary if name not in _NOT_METRICS)


def replicates(results: Sequence[EpisodeResult], weights: np.ndarray) -> dict[str, np.ndarray]:
    """Return every metric (R,) of the episodes, each counted as often as each row of `weights` says.

    The paper's fractions, means and percentiles are over all samples. Collisions and imposed brakes are added up;
    collision_episodes counts the episodes with a collision; smallest and largest values are over all episodes; what
    an episode has one of (distance, lane changes, the percentiles beyond the paper's) is averaged over episodes.

    Args:
        results: E episodes, one or more.
        weights: (R, E) whole numbers; a row of ones is the data themselves.
    """
    lengths = np.array([result.summary["samples"] for result in results], float)
    by_samples = weights * lengths
    metrics = {}
    for name in _summary_metrics(results):
        values = np.array([result.summary[name] for result in results], float)
        if name in PERCENTILES:
            column, percent, upwards = PERCENTILES[name]
            pooled = PooledPercentile([result.samples[column] for result in results], percent, upwards=upwards)
            metrics[name] = pooled(weights)
        elif name in _TOTALS:
            metrics[name] = _weighted_sum(weights, values)
        elif name in _MINIMA:
            metrics[name] = np.where(weights > 0, values, np.inf).min(axis=1)
        elif name in _MAXIMA:
            metrics[name] = np.where(weights > 0, values, -np.inf).max(axis=1)
        elif name in _PER_EPISODE:
            metrics[name] = _weighted_sum(weights, values) / weights.sum(axis=1)
        else:
            metrics[name] = _weighted_sum(by_samples, values) / by_samples.sum(axis=1)
    crashed = np.array([result.summary["collisions"] > 0 for result in results], float)
    metrics[COLLISION_EPISODES] = _weighted_sum(weights, crashed)
    return metrics


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

    def estimates(self) -> dict[str, Estimate]:
        """Return every metric with its interval; empty without episodes."""
        observed, drawn = self.observed_and_drawn(self.seeds)
        return _estimates(observed, drawn)

    def differences(self, other: "RowStatistics") -> tuple[int, dict[str, Estimate]]:
        """Return how much each metric exceeds that of another row, on the seeds that both have.

        Both rows get the same draws of seeds: traffic that is hard for one is mostly hard for the other, too, and
        falls out of the difference.

        Returns:
            The number of common seeds, and the differences; none without common seeds.
        """
        common = tuple(seed for seed in self.seeds if seed in other._results)
        ours, theirs = self.observed_and_drawn(common), other.observed_and_drawn(common)
        return len(common), _estimates(_minus(ours[0], theirs[0]), _minus(ours[1], theirs[1]))

    def observed_and_drawn(self, seeds: tuple[int, ...]) -> tuple[Replicates, Replicates]:
        """Return every metric of the episodes of `seeds` (1,), and their bootstrap replicates (RESAMPLES,)."""
        if not seeds:
            return {}, {}
        if seeds not in self._known:
            chosen = [self._results[seed] for seed in seeds]
            once = np.ones((1, len(chosen)), np.int32)
            self._known[seeds] = replicates(chosen, once), replicates(chosen, draw_weights(len(chosen)))
        return self._known[seeds]


def _estimates(observed: Replicates, drawn: Replicates) -> dict[str, Estimate]:
    return {name: Estimate(float(observed[name][0]), *interval(drawn[name])) for name in observed}


def _minus(ours: Replicates, theirs: Replicates) -> dict[str, np.ndarray]:
    """Return the differences; two infinite values that are equal differ by nothing."""
    return {
        name: np.subtract(own, theirs[name], out=np.zeros_like(own), where=own != theirs[name])
        for name, own in ours.items()
    }
