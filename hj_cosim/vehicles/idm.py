"""The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000), compiled.

What its parameters are, and what needs no compiler, is in drivers.py and can be had here too.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.vehicles.drivers import (
    COMFORTABLE_DECELERATION,
    DESIRED_SPEED,
    EXPONENT,
    MAX_ACCELERATION,
    MINIMUM_GAP,
    PARAMETER_NAMES,
    SMALLEST_GAP,
    TIME_HEADWAY,
    equilibrium_speed,
    mean_driver,
    parameter_settings,
)

__all__ = [
    "COMFORTABLE_DECELERATION",
    "DESIRED_SPEED",
    "EXPONENT",
    "MAX_ACCELERATION",
    "MINIMUM_GAP",
    "PARAMETER_NAMES",
    "SMALLEST_GAP",
    "TIME_HEADWAY",
    "Following",
    "acceleration_behind",
    "equilibrium_speed",
    "following",
    "idm_acceleration",
    "mean_driver",
    "parameter_settings",
]


class Following(NamedTuple):
    """What IDM makes of a car at its speed, whoever is ahead: the terms that need not be worked out for each leader."""

    speed: float  # v, m/s
    max_acceleration: float  # a, m/s²
    free: float  # (v/v_0)^δ
    headway: float  # v T, m
    braking: float  # 2 √(a b), m/s²
    minimum_gap: float  # s_0, m


@njit(cache=True)
def following(speed: float, driver: np.ndarray) -> Following:
    """Return IDM's terms of a car at `speed` (m/s) with the parameters `driver` (6,), in the order of drivers.py."""
    max_acceleration = driver[MAX_ACCELERATION]
    ratio = max(speed, 0.0) / driver[DESIRED_SPEED]
    if driver[EXPONENT] == 4.0:  # the usual exponent, some ten times cheaper than pow
        free = ratio * ratio * ratio * ratio
    else:
        free = ratio ** driver[EXPONENT]
    braking = 2.0 * math.sqrt(max_acceleration * driver[COMFORTABLE_DECELERATION])
    return Following(speed, max_acceleration, free, speed * driver[TIME_HEADWAY], braking, driver[MINIMUM_GAP])


@njit(cache=True)
def acceleration_behind(car: Following, gap: float, lead_speed: float) -> float:
    """Return IDM's acceleration of a car behind a leader; arguments and result as `idm_acceleration` has them."""
    if gap == math.inf:
        return car.max_acceleration * (1.0 - car.free)
    dynamic = car.headway + car.speed * (car.speed - lead_speed) / car.braking
    interaction = (car.minimum_gap + max(0.0, dynamic)) / max(gap, SMALLEST_GAP)
    return car.max_acceleration * (1.0 - car.free - interaction * interaction)


@njit(cache=True)
def idm_acceleration(speed: float, gap: float, lead_speed: float, driver: np.ndarray) -> float:
    """Return IDM's acceleration a [1 − (v/v_0)^δ − (s*/s)²], with s* = s_0 + max(0, v T + v Δv / (2 √(a b))).

    Args:
        speed: v, m/s.
        gap: s, bumper to bumper, m; `math.inf` when nobody is ahead.
        lead_speed: m/s; anything when nobody is ahead.
        driver: (6,) the driver's parameters in the order of drivers.py.

    Returns:
        The acceleration, m/s²; not limited from below.
    """
    return acceleration_behind(following(speed, driver), gap, lead_speed)
