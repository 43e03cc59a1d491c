"""Which cars the evasion has to keep away from: those that break a duty, and whoever is around (jitted)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.control.spc.evasion import (
    ACCELERATION,
    ACCELERATION_MAX,
    ACCELERATION_MIN,
    ACROSS,
    ANSWERED,
    COLUMNS,
    GAINING,
    HALF_ACROSS,
    HALF_ALONG,
    HEADING,
    HEADING_MAX,
    HORIZON,
    PURSUES,
    ROOM_ENOUGH,
    SPEED,
    Evader,
    Motion,
    X,
    Y,
)
from hj_cosim.control.spc.pursuit import Abilities, abilities_of
from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.breach import DOES_DUTIES, breach
from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.games.highway.paths import game_from
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.scene.observation import Cars

# s, with some to spare: a manoeuvre and what is held before it, and the part of it that gains speed.
_LASTS, _GAINS = HORIZON + 0.1, GAINING + 0.2
_FAR_ALONG, _FAR_ACROSS = 80.0, 12.0  # m between centres; who is farther counts for nothing
_OF_EVADER = len(Evader._fields)
_IN_LANE = 0.5  # m between two sides, up to which one follows the other


class Seen(NamedTuple):
    """One car, as it is seen."""

    x: float  # m
    y: float  # m
    heading: float  # rad
    speed: float  # m/s
    acceleration: float  # m/s²
    length: float  # m
    width: float  # m


@kernel
def breach_by(duties: Disturbance, p_x: float, p_y: float, robot: Motion, car: Seen) -> int:
    """Return whether a car breaks a duty, as `breach` does; p_x, p_y as in a look-up of its size class, m."""
    leftwards, sine = robot.speed * math.sin(robot.heading), math.sin(car.heading)
    return int(breach(duties, p_x, p_y, leftwards, robot.speed, car.speed, sine, car.acceleration))


@kernel
def _stays_away(evader: Evader, robot: Motion, car: Seen) -> bool:
    """Return whether a car is so far ahead or behind that no manoeuvre makes it count: most of them are."""
    gap = abs(car.x - robot.x) - 0.5 * (evader.length + evader.width + car.length + car.width) - ROOM_ENOUGH
    if car.x < robot.x:
        fastest = car.speed + max(car.acceleration, 0.0) * _LASTS
        return gap > max(fastest - max(robot.speed + evader.acceleration_min * _LASTS, 0.0), 0.0) * _LASTS
    fastest = robot.speed + evader.acceleration_max * _GAINS
    slowest = max(car.speed + min(car.acceleration, 0.0) * _LASTS, 0.0)
    braking = max(fastest * fastest - slowest * slowest, 0.0) / (-2.0 * evader.acceleration_min)
    return gap > max(fastest - slowest, 0.0) * _LASTS + braking


@kernel
def write_car(evader: Evader, robot: Motion, car: Seen, breaks: bool, can: Abilities, row: np.ndarray) -> bool:
    """Write what the evasion needs of a car, (COLUMNS,), and return whether it counts.

    Who follows in the robot's lane and breaks no duty does not: it brakes if the robot does. Nor does one whose body
    is in the robot's already, nor who stays away.
    """
    if _stays_away(evader, robot, car):
        return False
    along, across = car.x - robot.x, car.y - robot.y
    sine = math.sin(car.heading)
    turned, straight = abs(sine), math.cos(car.heading)
    half_along = 0.5 * (car.length * straight + car.width * turned)
    half_across = 0.5 * (car.width * straight + car.length * turned)
    beside = abs(across) - half_across - 0.5 * evader.width
    apart = abs(along) - half_along - 0.5 * evader.length
    if (along < 0.0 and beside < _IN_LANE and not breaks) or (apart < 0.0 and beside < 0.0):
        return False
    row[X], row[Y], row[SPEED], row[ACCELERATION] = car.x, car.y, car.speed, car.acceleration
    row[ACROSS], row[HALF_ALONG], row[HALF_ACROSS] = car.speed * sine, half_along, half_across
    answered = not breaks or (along > 0.0 and apart > 0.0)
    row[ANSWERED], row[PURSUES], row[HEADING] = 1.0 if answered else 0.0, 1.0 if breaks else 0.0, car.heading
    row[HEADING_MAX], row[ACCELERATION_MIN], row[ACCELERATION_MAX] = can
    return True


@njit(cache=True)
def cars_to_evade(
    packed_evader: np.ndarray,
    place: np.ndarray,
    cars: Cars,
    acceleration: np.ndarray,
    games: np.ndarray,
    numbers: np.ndarray,
) -> tuple[np.ndarray, int]:
    """Return the cars that count, (n, COLUMNS), n = 0 where nobody breaks a duty, and the gravest breach.

    Args:
        packed_evader: of the robot, an Evader's in their order; quickly handed over, as nobody else is.
        place: (4,) p_x, p_y (m), θ (rad), v (m/s) of the robot.
        cars: the J cars.
        acceleration: (J,) m/s².
        games: (classes, n) of `Manoeuvres.games`.
        numbers: (classes, n) of `packed_escape`.
    """
    evader = Evader(*to_fixed_tuple(packed_evader, _OF_EVADER))
    robot = Motion(place[0], place[1], place[2], place[3])
    breaches, gravest = np.zeros(len(cars.x), np.int64), DOES_DUTIES
    known, duties = 0, game_from(games[0]).other
    for j in range(len(cars.x)):
        along, across = cars.x[j] - robot.x, cars.y[j] - robot.y
        if abs(along) > _FAR_ALONG or abs(across) > _FAR_ACROSS:
            continue
        kind = class_of(numbers, cars.length[j], cars.width[j])
        p_x, p_y = offsets_in_class(numbers, kind, -along, -across, cars.length[j], cars.width[j])
        if kind != known:
            known, duties = kind, game_from(games[kind]).other
        breaches[j] = breach_by(duties, p_x, p_y, robot, _seen(cars, acceleration, j))
        gravest = max(gravest, breaches[j])
    if gravest == DOES_DUTIES:
        return np.empty((0, COLUMNS)), gravest
    found, count, can = np.empty((len(cars.x), COLUMNS)), 0, abilities_of(game_from(games[0]).other)
    for j in range(len(cars.x)):
        if abs(cars.x[j] - robot.x) <= _FAR_ALONG and abs(cars.y[j] - robot.y) <= _FAR_ACROSS:
            breaks = breaches[j] != DOES_DUTIES
            count += write_car(evader, robot, _seen(cars, acceleration, j), breaks, can, found[count])
    return found[:count], gravest


@kernel
def _seen(cars: Cars, acceleration: np.ndarray, j: int) -> Seen:
    """Return one of the cars."""
    return Seen(cars.x[j], cars.y[j], cars.heading[j], cars.speed[j], acceleration[j], cars.length[j], cars.width[j])
