"""The probability of each car that its driver means harm: a recursive Bayes filter over two hypotheses (jitted).

One hypothesis is an ordinary driver: IDM's acceleration with the population's spread about it, and changes of lane that
MOBIL lets pass. The other is a driver who now and then does anything that a car can. Drivers may change their minds:
what was seen is forgotten with a time constant. What is seen of a driver a moment later is mostly the same again, for
the parameters expected of it are not its own; so a sample counts as the share of an independent one that it is (a
tempered likelihood).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.control.belief.evidence import evidence_of
from hj_cosim.scene.observation import Cars

LARGEST_LOG_ODDS = 12.0  # no belief is beyond what rounding lets come back


class Hypotheses(NamedTuple):
    """What each of the two says; fitted on drives with seeds below 100 (tests/README.md)."""

    prior: float = 0.05  # of a car of which nothing has been seen
    forgetting_time: float = 30.0  # s
    independent_after: float = 1.0  # s, from when on a sample counts as a new one
    deviation: float = 0.4  # m/s², the scale of Student's t about IDM's acceleration
    ordinary_outliers: float = 0.02  # share of an ordinary driver's accelerations that are anything
    rogue_outliers: float = 0.3  # of a rogue's
    range_of_anything: float = 26.0  # m/s², of residuals
    # How often either keeps its lane, changes it, moves at an odd pace, takes somebody's room.
    ordinary_across: tuple[float, float, float, float] = (0.952, 0.044, 0.002, 0.002)
    rogue_across: tuple[float, float, float, float] = (0.82, 0.05, 0.07, 0.06)


ASSUMED = Hypotheses()


@njit(cache=True)
def prior_log_odds(of: Hypotheses) -> float:
    """Return the log-odds that a driver means harm of whom nothing has been seen."""
    return math.log(of.prior / (1.0 - of.prior))


@njit(cache=True)
def log_likelihood_ratio(residual: float, across: int, of: Hypotheses) -> float:
    """Return log p(seen | rogue) / p(seen | ordinary) of one independent sample; see `evidence_of`."""
    z = residual / of.deviation
    near = 2.0 / (math.pi * math.sqrt(3.0) * of.deviation * (1.0 + z * z / 3.0) ** 2)  # Student's t, 3 degrees
    anything = 1.0 / of.range_of_anything
    rogue = (1.0 - of.rogue_outliers) * near + of.rogue_outliers * anything
    ordinary = (1.0 - of.ordinary_outliers) * near + of.ordinary_outliers * anything
    return math.log(rogue / ordinary) + math.log(of.rogue_across[across] / of.ordinary_across[across])


@njit(cache=True)
def forgotten(log_odds: float, elapsed: float, of: Hypotheses) -> float:
    """Return log-odds after `elapsed` s in which nothing was seen: on their way back to the prior's."""
    belief = 1.0 / (1.0 + math.exp(-log_odds))
    later = of.prior + (belief - of.prior) * math.exp(-elapsed / of.forgetting_time)
    return math.log(later / (1.0 - later))


@njit(cache=True)
def updated(log_odds: float, residual: float, across: int, elapsed: float, of: Hypotheses) -> float:
    """Return the log-odds that a driver means harm, after `elapsed` s and one more sample of it.

    A sample that is not finite changes nothing but the forgetting.
    """
    later = forgotten(log_odds, elapsed, of)
    if math.isfinite(residual):
        share = min(elapsed / of.independent_after, 1.0)
        later += share * log_likelihood_ratio(residual, across, of)
    return min(max(later, -LARGEST_LOG_ODDS), LARGEST_LOG_ODDS)


# Nine parameters: what is seen, by whom, and what is believed so far, which is written.
@njit(cache=True)
def watch(
    robot: np.ndarray,
    robot_length: float,
    cars: Cars,
    acceleration: np.ndarray,
    drivers: np.ndarray,
    lane_width: float,
    time: float,
    believed: np.ndarray,
    of: Hypotheses,
) -> None:
    """Take one sample of all cars; the first arguments as `evidence_of` has them.

    Args:
        time: s, of the sample.
        believed: (vehicles, 2) by a car's number: log-odds that it means harm, and when it was last seen, s, NaN for
            one that has never been; written.
        of: the two hypotheses.
    """
    residual, across = evidence_of(robot, robot_length, cars, acceleration, drivers, lane_width)
    for j in range(len(residual)):
        row = believed[cars.vehicle[j]]
        elapsed = time - row[1]
        if math.isnan(elapsed):
            row[0] = prior_log_odds(of)
        else:
            row[0] = updated(row[0], residual[j], across[j], elapsed, of)
        row[1] = time
