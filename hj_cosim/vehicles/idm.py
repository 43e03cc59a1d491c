"""The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.settings import DriverSettings, NormalDistribution

# Columns of a driver's parameters, an array (J, 6) or (6,), in this order everywhere.
DESIRED_SPEED = 0  # m/s
MAX_ACCELERATION = 1  # m/s²
COMFORTABLE_DECELERATION = 2  # m/s²
TIME_HEADWAY = 3  # s
MINIMUM_GAP = 4  # m, bumper to bumper
EXPONENT = 5
PARAMETER_NAMES = (
    "desired_speed",
    "max_acceleration",
    "comfortable_deceleration",
    "time_headway",
    "minimum_gap",
    "exponent",
)

# What the model asks of a car that already touches its leader: the gap is not let below this (m).
SMALLEST_GAP = 0.1


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
    """Return IDM's terms of a car at `speed` (m/s) with the parameters `driver` (6,), in this module's order."""
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
        driver: (6,) the driver's parameters in this module's order.

    Returns:
        The acceleration, m/s²; not limited from below.
    """
    return acceleration_behind(following(speed, driver), gap, lead_speed)


@njit(cache=True)
def equilibrium_speed(gap: float, driver: np.ndarray) -> float:
    """Return the speed at which IDM neither brakes nor accelerates behind a leader of the same speed.

    Args:
        gap: bumper to bumper, m; `math.inf` when nobody is ahead.
        driver: (6,) the driver's parameters in this module's order.

    Returns:
        The speed, m/s, by bisection to 1e-6 m/s; 0 where the gap is below the minimum gap.
    """
    low, high = 0.0, driver[DESIRED_SPEED]
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if idm_acceleration(middle, gap, middle, driver) > 0.0:
            low = middle
        else:
            high = middle
    return low


def parameter_settings(settings: DriverSettings) -> tuple[NormalDistribution | float, ...]:
    """Return what the six parameters are drawn from, in this module's order; a number is the same for everybody."""
    return tuple(getattr(settings, name) for name in PARAMETER_NAMES)


def mean_driver(settings: DriverSettings) -> np.ndarray:
    """Return the mean parameters, (6,) in this module's order: all that a planner knows of the other drivers."""
    return np.array(
        [each.mean if isinstance(each, NormalDistribution) else each for each in parameter_settings(settings)]
    )
