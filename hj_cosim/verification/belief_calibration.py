"""Whether the belief that a driver means harm is calibrated: of those it calls 80 % rogue, 80 % are."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hj_cosim.control.belief.watcher import PERIOD, Watcher
from hj_cosim.recording.record import RunRecord
from hj_cosim.settings import DEFAULT_DRIVERS, DriverSettings

NEAR = 100.0  # m along the road from the robot: within, rogues have mostly begun
EDGES = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0)  # of the beliefs' bins


@dataclass(frozen=True)
class Bin:
    """Those of whom about the same is believed."""

    low: float
    high: float
    count: int  # samples of cars
    said: float  # their mean belief; NaN where there are none
    are: float  # the share of them whose drivers mean harm; NaN likewise


def beliefs_of(record: RunRecord, drivers: DriverSettings = DEFAULT_DRIVERS) -> tuple[np.ndarray, np.ndarray]:
    """Return when the cars of a recorded drive were looked at, (n,) int samples, and what was believed, (n, J).

    It is what a filter with `filter.priority = "belief"` believed in that drive, or would have: nothing else goes into
    the belief than what is recorded and what the scenario says of its drivers. Of a car that was not there at a sample
    it is NaN.
    """
    watcher = Watcher(record.robot_length, record.road.lane_width, drivers)
    every = max(round(PERIOD / (record.time[1] - record.time[0])), 1) if len(record.time) > 1 else 1
    samples = np.arange(0, len(record.time), every)
    found = np.full((len(samples), len(record.traffic.names)), np.nan)
    for row, sample in enumerate(samples):
        observation = record.observation(int(sample))
        watcher.see(observation)
        found[row, observation.vehicle] = watcher.belief(observation.vehicle)
    return samples, found


def reliability(
    records: Iterable[RunRecord],
    near: float = NEAR,
    edges: Sequence[float] = EDGES,
    drivers: DriverSettings = DEFAULT_DRIVERS,
) -> list[Bin]:
    """Return, by bins of the belief, what was said and what is so, over all cars near the robot at all looks.

    Args:
        records: drives, whose rogues are known.
        near: m along the road.
        edges: of the bins, ascending.
        drivers: those of the drives' scenario.
    """
    said, are = [np.empty(0)], [np.empty(0, np.bool_)]
    for record in records:
        samples, belief = beliefs_of(record, drivers)
        distance = np.abs(record.traffic.x[samples] - record.robot.x[samples][:, None])
        counted = np.isfinite(belief) & (distance <= near)
        said.append(belief[counted])
        are.append(np.broadcast_to(record.is_rogue, counted.shape)[counted])
    return _binned(np.concatenate(said), np.concatenate(are), edges)


def _binned(said: np.ndarray, are: np.ndarray, edges: Sequence[float]) -> list[Bin]:
    place = np.clip(np.searchsorted(edges, said, side="right") - 1, 0, len(edges) - 2)
    bins = []
    for number, (low, high) in enumerate(itertools.pairwise(edges)):
        chosen = place == number
        count = int(chosen.sum())
        means = (float(said[chosen].mean()), float(are[chosen].mean())) if count else (np.nan, np.nan)
        bins.append(Bin(low, high, count, *means))
    return bins
