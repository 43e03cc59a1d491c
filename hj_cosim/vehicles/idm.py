"""The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000)."""

import math

import numpy as np

from hj_cosim.kernels import kernel
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


@kernel
def driver_of(drivers: np.ndarray, car: int) -> tuple[float, float, float, float, float, float]:
    """Return a driver's parameters out of (J, 6), as numbers: kernels keep these in registers."""
    return (
        drivers[car, DESIRED_SPEED],
        drivers[car, MAX_ACCELERATION],
        drivers[car, COMFORTABLE_DECELERATION],
        drivers[car, TIME_HEADWAY],
        drivers[car, MINIMUM_GAP],
        drivers[car, EXPONENT],
    )


@kernel
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
    max_acceleration = driver[MAX_ACCELERATION]
    ratio = max(speed, 0.0) / driver[DESIRED_SPEED]
    if driver[EXPONENT] == 4.0:  # the usual exponent, some ten times cheaper than pow
        free = ratio * ratio * ratio * ratio
    else:
        free = ratio ** driver[EXPONENT]
    if gap == math.inf:
        return max_acceleration * (1.0 - free)
    dynamic = speed * driver[TIME_HEADWAY] + speed * (speed - lead_speed) / (
        2.0 * math.sqrt(max_acceleration * driver[COMFORTABLE_DECELERATION])
    )
    desired_gap = driver[MINIMUM_GAP] + max(0.0, dynamic)
    interaction = desired_gap / max(gap, SMALLEST_GAP)
    return max_acceleration * (1.0 - free - interaction * interaction)


@kernel
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
