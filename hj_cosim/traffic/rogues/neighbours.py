"""Who is around a rogue's car, compiled: each asks in every step, and one call of NumPy's costs more than 150 cars."""

import math

import numpy as np

from hj_cosim.kernels import kernel
from hj_cosim.scene.observation import Cars
from hj_cosim.vehicles.idm import idm_acceleration


@kernel
def car_ahead(cars: Cars, own: int, reach: float) -> tuple[float, float]:
    """Return the gap (m) to the nearest car that is ahead within `reach` m sideways, and its speed (m/s).

    A gap is negative beside who is ahead by less than a length; where nobody is ahead it is inf, and the speed 0.
    """
    nearest, its_speed = math.inf, 0.0
    for other in range(len(cars.x)):
        if _is_ahead(cars, own, other, reach):
            gap = _gap(cars, own, other)
            if gap < nearest:
                nearest, its_speed = gap, cars.speed[other]
    return nearest, its_speed


@kernel
def acceleration_behind_all(cars: Cars, own: int, reach: float, to_end: float, driver: np.ndarray) -> float:
    """Return the least of IDM's accelerations (m/s²) behind each car ahead within `reach` m sideways.

    Args:
        cars: all of them.
        own: the index of who drives.
        reach: m, from centre to centre.
        to_end: m, to where the lane ends, which counts as one who stands; inf where it does not end.
        driver: (6,) IDM's parameters.
    """
    speed = cars.speed[own]
    least = idm_acceleration(speed, to_end, 0.0, driver)
    for other in range(len(cars.x)):
        if _is_ahead(cars, own, other, reach):
            least = min(least, idm_acceleration(speed, _gap(cars, own, other), cars.speed[other], driver))
    return least


@kernel
def room_beside(cars: Cars, own: int, distance: float) -> tuple[float, float]:
    """Return how far (m) the nearest bodies beside a car are from its own, on the right and on the left; inf for none.

    Args:
        cars: all of them.
        own: the index of the car.
        distance: m between the bumpers up to which another one counts as beside it.
    """
    right, left = math.inf, math.inf
    for other in range(len(cars.x)):
        apart = abs(cars.x[other] - cars.x[own])
        if apart >= 0.5 * (cars.length[other] + cars.length[own]) + distance:
            continue
        aside = cars.y[other] - cars.y[own]
        room = abs(aside) - 0.5 * (cars.width[other] + cars.width[own])
        if aside > 0.0:
            left = min(left, room)
        elif aside < 0.0:
            right = min(right, room)
    return right, left


@kernel
def _is_ahead(cars: Cars, own: int, other: int, reach: float) -> bool:
    return cars.x[other] > cars.x[own] and abs(cars.y[other] - cars.y[own]) < reach


@kernel
def _gap(cars: Cars, own: int, other: int) -> float:
    return cars.x[other] - cars.x[own] - 0.5 * (cars.length[other] + cars.length[own])
