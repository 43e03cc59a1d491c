"""Drivers as the Intelligent Driver Model has them: six parameters, and the speed at which they neither gain nor lose.

Nothing here is compiled: who only lists or reads drivers does not wait for a compiler. The model itself is in idm.py.
"""

import numpy as np

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


def equilibrium_speed(gap: float, driver: np.ndarray) -> float:
    """Return the speed at which IDM neither brakes nor accelerates behind a leader of the same speed.

    There its acceleration is a [1 − (v/v_0)^δ − ((s_0 + v T)/s)²].

    Args:
        gap: s, bumper to bumper, m; `math.inf` when nobody is ahead.
        driver: (6,) the driver's parameters in this module's order.

    Returns:
        The speed, m/s, by bisection to 1e-6 m/s; 0 where the gap is below the minimum gap.
    """
    desired_speed, _, _, headway, minimum_gap, exponent = driver.tolist()
    room = max(float(gap), SMALLEST_GAP)
    low, high = 0.0, desired_speed
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        share = (minimum_gap + middle * headway) / room
        if 1.0 - (middle / desired_speed) ** exponent - share * share > 0.0:
            low = middle
        else:
            high = middle
    return low


def within_limits(drivers: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Return drivers (J, 6) who desire no more than speed limits (J,), m/s."""
    limited = drivers.copy()
    limited[:, DESIRED_SPEED] = np.minimum(drivers[:, DESIRED_SPEED], limits)
    return limited


def parameter_settings(settings: DriverSettings) -> tuple[NormalDistribution | float, ...]:
    """Return what the six parameters are drawn from, in this module's order; a number is the same for everybody."""
    return tuple(getattr(settings, name) for name in PARAMETER_NAMES)


def mean_driver(settings: DriverSettings) -> np.ndarray:
    """Return the mean parameters, (6,) in this module's order: all that a planner knows of the other drivers."""
    return np.array(
        [each.mean if isinstance(each, NormalDistribution) else each for each in parameter_settings(settings)]
    )


def means_of(drivers: DriverSettings) -> DriverSettings:
    """Return the drivers with nothing of how they scatter."""
    scattered = {name: value for name, value in drivers if isinstance(value, NormalDistribution)}
    means = {name: value.model_copy(update={"deviation": 0.0}) for name, value in scattered.items()}
    return drivers.model_copy(update=means)
