"""Keeping an escape: a control passes only if a manoeuvre remains that escapes, whatever the other cars do.

A row of SPC says that V does not fall at this instant if V is right, along one gradient. Both fail where it matters:
V is wrong by metres at the corners of V(0, ·), and where the other car has two ways to lower V a robot that minds one
of them, then the other, loses to both. A manoeuvre is judged over its whole length instead
(`games.highway.manoeuvres`). If one escapes after the control, it is still there in the next step; so once there is an
escape there is always one, as far as manoeuvres are looked at. The control is the filter's own as long as one
remains, and else the best manoeuvre's.

From each car by itself there has to be an escape, as the game is one of two; from the cars in K, and from those from
which there would be none, there has to be one from all of them at once. Where no manoeuvre escapes from the worst
that those could do together, the one that guarantees most is driven, until a control is known to leave an escape.

Against the worst a manoeuvre keeps a heading and an acceleration for seconds. Among cars that do their duties it is
RSS's proper response: straighten up and brake (`games.highway.duty_bound`), the same for all cars, so that an escape
from each of those in K is mostly one from all.

The idea is that of backup controllers: Gurriet, Mote, Singletary, Nilsson, Feron & Ames 2020, A Scalable Safety
Critical Control Framework for Nonlinear Systems.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.errors import TableError
from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.manoeuvres import (
    Manoeuvres,
    Paths,
    game_with,
    guaranteed,
    other_at,
    require_path,
    room_for_paths,
)
from hj_cosim.reachability.games.highway.paths import Start, game_from, turning_max
from hj_cosim.reachability.games.highway.target import target_at
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import RobotSettings

# m of V. What must be left after the control; covers by how much less is guaranteed where the instants looked at lie
# otherwise, so that the manoeuvre that was seen to remain does so in the next step.
RESERVE = 0.2
# m of V. Cars with more are not looked at: so far above the bound no table is between its nodes.
HIGHEST = 10.0
STRAIGHT = 1e-3  # rad; what a step's rounding leaves of a heading does not count as turning
PASSED, ESCAPING, NO_ESCAPE = 0, 1, 2  # verdicts
NO_MANOEUVRE = -1


def manoeuvres_for(table: ValueTable, robot: RobotSettings) -> Manoeuvres:
    """Return the manoeuvres that a robot has, judged in the game of a table.

    Raises:
        TableError: if none are known for its game.
    """
    if table.game.manoeuvres is None:
        raise TableError(
            f"no manoeuvres are known for the game {table.game.name}; set filter.keep_escape=false to drive without"
        )
    limits = {
        "omega_max": robot.omega_max,
        "acceleration_min": robot.acceleration_min,
        "acceleration_max": robot.acceleration_max,
    }
    own, *larger = (each.manoeuvres(limits) for each in table.by_size)
    manoeuvres: Manoeuvres = own._replace(games=np.vstack([own.games, *(each.games for each in larger)]))
    return manoeuvres


class Extent(NamedTuple):
    """What of its grid tells where a look-up says "safe" for want of nodes; unpacked faster than the whole table."""

    lower_x: float  # m, of the first axis
    upper_x: float
    lower_y: float  # m
    upper_y: float
    braking_shear: float  # s²/m

    @classmethod
    def of(cls, table: ValueTable) -> "Extent":
        """Return a table's."""
        grid = table.arrays.grid
        return cls(grid.lower[0], grid.upper[0], grid.lower[1], grid.upper[1], grid.braking_shear)


@kernel
def is_to_be_looked_at(extent: Extent, value: float, p_x: float, p_y: float, v_r: float, v_o: float) -> bool:
    """Return whether an escape has to be kept from a car; the state as in a look-up, and V, m.

    One beside the table, where a look-up says "safe", too: a robot that comes back into the table too fast, and turned
    towards the car, has V <= 0 as soon as it is there.
    """
    xi = p_x - extent.braking_shear * (v_o * v_o - v_r * v_r)
    beside = (p_y < extent.lower_y or p_y > extent.upper_y) and extent.lower_x <= xi <= extent.upper_x
    return value <= HIGHEST or beside


@kernel
def _class_of(other: np.ndarray) -> int:
    """Return the size class of a car, (3,) p_x, p_y, v, or (4,) with it."""
    return int(other[3]) if len(other) > 3 else 0


@kernel
def _escapes_from_one(manoeuvres: Manoeuvres, start: Start, paths: Paths, robot: np.ndarray, other: np.ndarray) -> bool:
    """Return whether a manoeuvre keeps more than the reserve from one car by itself, a row of `keep_escape`'s."""
    count, kind = len(manoeuvres.heading), _class_of(other)
    game = game_with(manoeuvres, kind)
    reach = other_at(game, other[2])
    p_x, p_y = robot[0] - other[0], robot[1] - other[1]
    for which in range(kind * count, (kind + 1) * count):
        require_path(manoeuvres, which, start, paths)
        path = paths.rows[which, : paths.instants[which]]
        if guaranteed(game, path, 0, reach, p_x, p_y, RESERVE) > RESERVE:
            return True
    return False


@kernel
def _guaranteed_against_all(
    manoeuvres: Manoeuvres,
    manoeuvre: int,
    start: Start,
    paths: Paths,
    first: int,
    robot: np.ndarray,
    others: np.ndarray,
    floor: float,
) -> float:
    """Return what a manoeuvre guarantees against the worst of all cars from an instant on, m.

    Where it is not above `floor`, it is something less.
    """
    least = math.inf
    for j in range(len(others)):
        kind = _class_of(others[j])
        game, which = game_with(manoeuvres, kind), kind * len(manoeuvres.heading) + manoeuvre
        require_path(manoeuvres, which, start, paths)
        path = paths.rows[which, : paths.instants[which]]
        reach = other_at(game, others[j, 2])
        p_x, p_y = robot[0] - others[j, 0], robot[1] - others[j, 1]
        least = min(least, guaranteed(game, path, first, reach, p_x, p_y, floor))
        if least <= floor:
            break
    return least


@kernel
def _one_escapes_from_all(
    manoeuvres: Manoeuvres, start: Start, paths: Paths, robot: np.ndarray, others: np.ndarray, floor: float
) -> bool:
    """Return whether some manoeuvre guarantees more than `floor` against all of the cars at once."""
    for which in range(len(manoeuvres.heading)):
        if _guaranteed_against_all(manoeuvres, which, start, paths, 0, robot, others, floor) > floor:
            return True
    return False


@kernel
def _is_in_target_set(manoeuvres: Manoeuvres, robot: np.ndarray, others: np.ndarray) -> bool:
    """Return whether V(0, ·) <= 0 with any of the cars, from where no control keeps the reserve; quickly seen."""
    for j in range(len(others)):
        p_x, p_y = robot[0] - others[j, 0], robot[1] - others[j, 1]
        target = game_with(manoeuvres, _class_of(others[j])).target
        if target_at(target, p_x, p_y, robot[2], robot[3], others[j, 2]) <= 0.0:
            return True
    return False


@kernel
def _follows_too_closely(manoeuvres: Manoeuvres, robot: np.ndarray, other: np.ndarray) -> bool:
    """Return whether a car, a row of others, is behind where it does not do its duty: no manoeuvre is bound by that.

    To brake for it, as for who is ahead, would only bring it nearer.
    """
    game = game_with(manoeuvres, _class_of(other))
    p_x, p_y = robot[0] - other[0], robot[1] - other[1]
    if not (game.other.responsible and p_x > game.target.length):
        return False
    return target_at(game.target, p_x, p_y, robot[2], robot[3], other[2]) <= 0.0


@kernel
def _first_control(
    manoeuvres: Manoeuvres, which: int, heading: float, speed: float, step: float
) -> tuple[float, float]:
    """Return the control, rad/s and m/s², that a manoeuvre holds over the next step."""
    game = manoeuvres.game
    omega_max, rest = turning_max(game, speed), manoeuvres.heading[which] - heading
    # Among cars that do their duties every manoeuvre ends in braking straight on, as the first one begins.
    ended = game.other.responsible and abs(rest) <= STRAIGHT
    acceleration = manoeuvres.acceleration[0 if ended else which]
    return min(max(rest / step, -omega_max), omega_max), acceleration


@kernel
def _best_manoeuvre(
    manoeuvres: Manoeuvres, paths: Paths, robot: np.ndarray, others: np.ndarray, step: float, driven: int
) -> tuple[int, float]:
    """Return the manoeuvre to drive, and what it guarantees against all of the cars at once, m.

    It is the one driven before as long as it escapes, and else the one that guarantees most, however little. What
    counts begins a step from now: what is lost already is lost in every manoeuvre, and would hide which is best.
    `paths` is room, in which no path is kept.
    """
    best, most = 0, -math.inf
    paths.instants[:] = 0
    for turn in range(-1, len(manoeuvres.heading)):
        which = driven if turn < 0 else turn
        if which < 0 or (turn >= 0 and turn == driven):
            continue
        omega, acceleration = _first_control(manoeuvres, which, robot[2], robot[3], step)
        start = Start(robot[2], robot[3], omega, acceleration, step)
        least = _guaranteed_against_all(manoeuvres, which, start, paths, 1, robot, others, most)
        if least > most:
            best, most = which, least
        if turn < 0 and most > 0.0:
            break
    return best, most


@njit(cache=True)
def keep_escape(
    manoeuvres: Manoeuvres,
    robot: np.ndarray,
    others: np.ndarray,
    in_k: np.ndarray,
    omega: float,
    acceleration: float,
    step: float,
    driven: int,
) -> tuple[float, float, int, int]:
    """Return the control to apply: the one asked for if it is known to leave an escape, or else a manoeuvre's.

    Args:
        manoeuvres: which there are.
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        others: (J, 3) p_x, p_y, v of the other cars, which go along the road, or (J, 4) with their size classes.
        in_k: (J,) bool, from which of them there has to be an escape at once; from the rest, from each by itself.
        omega, acceleration: the control asked for, rad/s and m/s².
        step: s, for which a control is held.
        driven: the manoeuvre that gave the last control, NO_MANOEUVRE if none did.

    Returns:
        ω, a; the verdict, which is PASSED, ESCAPING, or NO_ESCAPE if the manoeuvre is the best there is and does not
        escape; and the manoeuvre that is driven now, NO_MANOEUVRE if the control passed.
    """
    paths, minded = room_for_paths(manoeuvres), in_k.copy()
    after = Start(robot[2], robot[3], omega, acceleration, step)
    for j in range(len(others)):
        if _follows_too_closely(manoeuvres, robot, others[j]):
            minded[j] = False
        elif not minded[j]:
            minded[j] = not _escapes_from_one(manoeuvres, after, paths, robot, others[j])
    if not minded.any():
        return omega, acceleration, PASSED, NO_MANOEUVRE
    threats = others[minded]
    if not _is_in_target_set(manoeuvres, robot, threats) and _one_escapes_from_all(
        manoeuvres, after, paths, robot, threats, RESERVE
    ):
        return omega, acceleration, PASSED, NO_MANOEUVRE
    best, most = _best_manoeuvre(manoeuvres, paths, robot, threats, step, driven)
    turning, gain = _first_control(manoeuvres, best, robot[2], robot[3], step)
    return turning, gain, ESCAPING if most > 0.0 else NO_ESCAPE, best


_OF_EXTENT = len(Extent._fields)


def packed_escape(table: ValueTable, epsilon: float, step: float) -> np.ndarray:
    """Return the numbers that `keep_escape_in_traffic` takes, quickly handed over.

    Args:
        table: V.
        epsilon: ε, m.
        step: s, for which a control is held.

    Returns:
        (classes, n), a row per size class: its largest body, the extent of its table, ε, the step.
    """
    return np.array([(each.size.length, each.size.width, *Extent.of(each), epsilon, step) for each in table.by_size])


# Twelve parameters: a NamedTuple of arrays costs a microsecond to hand over, at every step.
@njit(cache=True)
def keep_escape_in_traffic(
    manoeuvres_of: tuple[np.ndarray, np.ndarray, np.ndarray],
    numbers: np.ndarray,
    robot: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    values: np.ndarray,
    omega: float,
    acceleration: float,
    driven: int,
) -> tuple[float, float, int, int]:
    """Return what `keep_escape` does among all cars; those with V <= ε are in K.

    Args:
        manoeuvres_of: (M,) headings and accelerations of the manoeuvres, and the numbers of their games.
        numbers: of `packed_escape`.
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        x, y, speed, length, width, values: (J,) of the cars; SI.
        omega, acceleration, driven: as `keep_escape` takes them.
    """
    headings, accelerations, games = manoeuvres_of
    epsilon, step = numbers[0, 2 + _OF_EXTENT], numbers[0, 3 + _OF_EXTENT]
    manoeuvres = Manoeuvres(headings, accelerations, game_from(games[0]), games)
    others, in_k = np.empty((len(x), 4)), np.empty(len(x), np.bool_)
    count = 0
    for j in range(len(x)):
        kind = class_of(numbers, length[j], width[j])
        p_x, p_y = offsets_in_class(numbers, kind, robot[0] - x[j], robot[1] - y[j], length[j], width[j])
        extent = Extent(*to_fixed_tuple(numbers[kind, 2:], _OF_EXTENT))
        if is_to_be_looked_at(extent, values[j], p_x, p_y, robot[3], speed[j]):
            # Where the part of its body is that counts; exactly its place where that is all of it.
            others[count, 0] = x[j] + (robot[0] - x[j] - p_x)
            others[count, 1] = y[j] + (robot[1] - y[j] - p_y)
            others[count, 2], others[count, 3] = speed[j], kind
            in_k[count] = values[j] <= epsilon
            count += 1
    return keep_escape(manoeuvres, robot, others[:count], in_k[:count], omega, acceleration, step, driven)


@njit(cache=True, nogil=True)
def can_escape(manoeuvres: Manoeuvres, robots: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return from which scenes a manoeuvre escapes from all cars at once, (n,) bool.

    Args:
        manoeuvres: which there are.
        robots: (n, 4) p_x, p_y (m), θ (rad), v (m/s).
        others: (n, J, 3) p_x, p_y, v of the other cars.
    """
    found = np.empty(len(robots), np.bool_)
    for i in range(len(robots)):
        paths = room_for_paths(manoeuvres)
        now = Start(robots[i, 2], robots[i, 3], 0.0, 0.0, 0.0)
        found[i] = _one_escapes_from_all(manoeuvres, now, paths, robots[i], others[i], 0.0)
    return found
