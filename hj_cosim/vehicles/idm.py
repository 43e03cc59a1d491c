"""The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000), compiled.

What its parameters are, and what needs no compiler, is in drivers.py and can be had here too.
"""

import math

import numpy as np

from hj_cosim.kernels import kernel
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
    within_limits,
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
    "driver_of",
    "equilibrium_speed",
    "idm_acceleration",
    "mean_driver",
    "parameter_settings",
    "within_limits",
]


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
