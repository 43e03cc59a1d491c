"""Keeping an escape: a control passes only if a manoeuvre remains that escapes, whatever the other cars do.

A row of SPC says that V does not fall at this instant if V is right, along one gradient. Both fail where it matters:
V is wrong by metres at the corners of V(0, ·), and where the other car has two ways to lower V a robot that minds one
of them, then the other, loses to both. A manoeuvre is judged over its whole length instead
(`reachability.manoeuvres`). If one escapes after the control, it is still there in the next step; so once there is an
escape there is always one, as far as manoeuvres are looked at. The control is the filter's own as long as one
remains, and else the best manoeuvre's.

From each car by itself there has to be an escape, as the game is one of two; from the cars in K, and from those from
which there would be none, there has to be one from all of them at once. Where no manoeuvre escapes from the worst
that those could do together there is nothing to keep: the control passes.

The idea is that of backup controllers: Gurriet, Mote, Singletary, Nilsson, Feron & Ames 2020, A Scalable Safety
Critical Control Framework for Nonlinear Systems.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.errors import TableError
from hj_cosim.reachability.games.highway.manoeuvres import Manoeuvres, guaranteed, write_path, write_reach
from hj_cosim.reachability.games.highway.target import target_at
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import RobotSettings

# m of V. What must be left after the control; covers what the manoeuvres' steps are wrong by, so that the manoeuvre
# that was seen to remain does so in the next step.
RESERVE = 0.1
# m of V. Cars with more are not looked at: so far above the bound no table is between its nodes.
HIGHEST = 10.0
PASSED, ESCAPING, NO_ESCAPE = 0, 1, 2  # verdicts


def manoeuvres_for(table: ValueTable, robot: RobotSettings) -> Manoeuvres:
    """Return the manoeuvres that a robot has, judged in the game of a table.

    Raises:
        TableError: if none are known for its game.
    """
    if table.game.manoeuvres is None:
        raise TableError(
            f"no manoeuvres are known for the game {table.game.name}; set filter.keep_escape=false to drive without"
        )
    manoeuvres: Manoeuvres = table.manoeuvres(
        {
            "omega_max": robot.omega_max,
            "acceleration_min": robot.acceleration_min,
            "acceleration_max": robot.acceleration_max,
        }
    )
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
        arrays = table.arrays
        return cls(arrays.lower[0], arrays.upper[0], arrays.lower[1], arrays.upper[1], arrays.braking_shear)


@njit(cache=True)
def is_to_be_looked_at(extent: Extent, value: float, p_x: float, p_y: float, v_r: float, v_o: float) -> bool:
    """Return whether an escape has to be kept from a car; the state as in a look-up, and V, m.

    One beside the table, where a look-up says "safe", too: a robot that comes back into the table too fast, and turned
    towards the car, has V <= 0 as soon as it is there.
    """
    xi = p_x - extent.braking_shear * (v_o * v_o - v_r * v_r)
    beside = (p_y < extent.lower_y or p_y > extent.upper_y) and extent.lower_x <= xi <= extent.upper_x
    return value <= HIGHEST or beside


class _Start(NamedTuple):
    """Where manoeuvres begin: the robot's heading and speed, and the control that it holds before."""

    heading: float  # rad
    speed: float  # m/s
    omega: float  # rad/s
    acceleration: float  # m/s²
    held: float  # s


@njit(cache=True)
def _path(manoeuvres: Manoeuvres, which: int, start: _Start, paths: np.ndarray, written: np.ndarray) -> np.ndarray:
    """Return a manoeuvre's path, written only once it is wanted: mostly the first few escape."""
    if not written[which]:
        heading, speed, omega, acceleration, held = start
        write_path(manoeuvres, which, heading, speed, omega, acceleration, held, paths[which])
        written[which] = True
    return paths[which]


@njit(cache=True)
def _escapes_from_one(
    manoeuvres: Manoeuvres, start: _Start, paths: np.ndarray, written: np.ndarray, robot: np.ndarray, other: np.ndarray
) -> bool:
    """Return whether a manoeuvre keeps more than the reserve from one car by itself, (3,) p_x, p_y, v."""
    reach = np.empty((paths.shape[1] + 1, 5))
    bend, share = write_reach(manoeuvres, other[2], start.held, reach)
    p_x, p_y = robot[0] - other[0], robot[1] - other[1]
    for which in range(len(paths)):
        path = _path(manoeuvres, which, start, paths, written)
        if guaranteed(manoeuvres.game, path, reach, bend, share, p_x, p_y, RESERVE) > RESERVE:
            return True
    return False


@njit(cache=True)
def _best_escape(
    manoeuvres: Manoeuvres,
    start: _Start,
    paths: np.ndarray,
    written: np.ndarray,
    robot: np.ndarray,
    others: np.ndarray,
    floor: float,
    enough: float,
) -> int:
    """Return the manoeuvre that guarantees most against all of the cars at once, if that is more than `floor`, else −1.

    The first that guarantees more than `enough` will do.
    """
    best, most = -1, floor
    reaches = np.empty((len(others), paths.shape[1] + 1, 5))
    bends, shares = np.empty(len(others), np.int64), np.empty(len(others))
    for j in range(len(others)):
        bends[j], shares[j] = write_reach(manoeuvres, others[j, 2], start.held, reaches[j])
    for which in range(len(paths)):
        path, least = _path(manoeuvres, which, start, paths, written), math.inf
        for j in range(len(others)):
            p_x, p_y = robot[0] - others[j, 0], robot[1] - others[j, 1]
            least = min(least, guaranteed(manoeuvres.game, path, reaches[j], bends[j], shares[j], p_x, p_y, most))
            if least <= most:
                break
        if least > most:
            best, most = which, least
            if most > enough:
                break
    return best


@njit(cache=True)
def keep_escape(
    manoeuvres: Manoeuvres,
    robot: np.ndarray,
    others: np.ndarray,
    in_k: np.ndarray,
    omega: float,
    acceleration: float,
    step: float,
) -> tuple[float, float, int]:
    """Return the control to apply: the one asked for, or a manoeuvre's.

    Args:
        manoeuvres: which there are.
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        others: (J, 3) p_x, p_y, v of the other cars, which go along the road.
        in_k: (J,) bool, which of them are in K.
        omega, acceleration: the control asked for, rad/s and m/s².
        step: s, for which a control is held.

    Returns:
        ω, a and the verdict: PASSED, ESCAPING or NO_ESCAPE, in which case the control is the one asked for.
    """
    for j in range(len(others)):  # nothing escapes from the target set; that is quickly seen
        p_x, p_y = robot[0] - others[j, 0], robot[1] - others[j, 1]
        if in_k[j] and target_at(manoeuvres.game.target, p_x, p_y, robot[2], robot[3], others[j, 2]) <= 0.0:
            return omega, acceleration, NO_ESCAPE
    paths = np.empty((len(manoeuvres.heading), len(manoeuvres.steps) + 2, 6))
    written, minded = np.zeros(len(paths), np.bool_), in_k.copy()
    after = _Start(robot[2], robot[3], omega, acceleration, step)
    for j in range(len(others)):
        if not minded[j]:
            minded[j] = not _escapes_from_one(manoeuvres, after, paths, written, robot, others[j])
    if not minded.any():
        return omega, acceleration, PASSED
    threats = others[minded]
    if _best_escape(manoeuvres, after, paths, written, robot, threats, RESERVE, RESERVE) >= 0:
        return omega, acceleration, PASSED
    written[:] = False
    now = _Start(robot[2], robot[3], 0.0, 0.0, 0.0)
    best = _best_escape(manoeuvres, now, paths, written, robot, threats, 0.0, math.inf)
    if best < 0:
        return omega, acceleration, NO_ESCAPE
    omega_max = manoeuvres.game.omega_max
    turning = min(max((manoeuvres.heading[best] - robot[2]) / step, -omega_max), omega_max)
    return turning, manoeuvres.acceleration[best], ESCAPING


@njit(cache=True)
def keep_escape_in_traffic(
    manoeuvres: Manoeuvres,
    extent: Extent,
    robot: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    values: np.ndarray,
    epsilon: float,
    omega: float,
    acceleration: float,
    step: float,
) -> tuple[float, float, int]:
    """Return what `keep_escape` does among all cars, (J,) arrays in m, m, m/s and m; those with V <= ε are in K."""
    others, in_k = np.empty((len(x), 3)), np.empty(len(x), np.bool_)
    count = 0
    for j in range(len(x)):
        p_x, p_y = robot[0] - x[j], robot[1] - y[j]
        if is_to_be_looked_at(extent, values[j], p_x, p_y, robot[3], speed[j]):
            others[count, 0], others[count, 1], others[count, 2] = x[j], y[j], speed[j]
            in_k[count] = values[j] <= epsilon
            count += 1
    return keep_escape(manoeuvres, robot, others[:count], in_k[:count], omega, acceleration, step)


@njit(cache=True, nogil=True)
def can_escape(manoeuvres: Manoeuvres, robots: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return from which scenes a manoeuvre escapes from all cars at once, (n,) bool.

    Args:
        manoeuvres: which there are.
        robots: (n, 4) p_x, p_y (m), θ (rad), v (m/s).
        others: (n, J, 3) p_x, p_y, v of the other cars.
    """
    found = np.empty(len(robots), np.bool_)
    paths = np.empty((len(manoeuvres.heading), len(manoeuvres.steps) + 2, 6))
    written = np.empty(len(paths), np.bool_)
    for i in range(len(robots)):
        written[:] = False
        now = _Start(robots[i, 2], robots[i, 3], 0.0, 0.0, 0.0)
        found[i] = _best_escape(manoeuvres, now, paths, written, robots[i], others[i], 0.0, 0.0) >= 0
    return found
