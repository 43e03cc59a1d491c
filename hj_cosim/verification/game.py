"""A game of a filtered robot with other cars, as kernels take it: what stays the same, and how the robot moves."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.control.spc.escape import Extent
from hj_cosim.control.spc.evasion import Evader
from hj_cosim.reachability.games.highway.manoeuvres import Manoeuvres
from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.table.table_arrays import TableArrays
from hj_cosim.verification.bodies import Bodies


class Game(NamedTuple):
    """What stays the same over all rollouts, as the kernel takes it."""

    table: TableArrays
    limits: np.ndarray  # (4,) lower and upper ω, lower and upper a
    bounds: np.ndarray  # (4,) lower and upper θ, lower and upper v
    other_speed_max: float
    weights: np.ndarray  # (3,) λ
    slack_is_free: bool
    epsilon: float
    recovery: float
    approach: float
    smooth: bool  # whether slopes are those of a mean over a cell
    sideways: float  # m/s², the most |v ω| of the robot's tyres
    step: float
    other: Disturbance  # what the table assumes of the other cars
    played: Disturbance  # what they may do
    extent: Extent
    manoeuvres: Manoeuvres  # that one is to remain of, or NO_MANOEUVRES
    driver: np.ndarray  # (6,) IDM parameters
    k_theta: float
    wheelbase: float
    bodies: Bodies
    evades: bool  # whether who breaks a duty is evaded
    evader: Evader
    curvature: float  # 1/m, of the road at d = 0; 0 of a straight one
    half_wave: float  # m, in which the curvature turns over to the other side, evenly; inf if it stays


@njit(cache=True)
def curvature_at(game: Game, along: float) -> float:
    """Return the road's curvature at s, 1/m: constant, or that of clothoids from one side to the other and back."""
    if game.half_wave == math.inf:
        return game.curvature
    waves = along / (2.0 * game.half_wave)
    return game.curvature * (4.0 * abs(waves - math.floor(waves) - 0.5) - 1.0)


@njit(cache=True)
def bent(game: Game, before: float, after: float, lateral: float) -> float:
    """Return the s (m) of who would have come from `before` to `after` on a straight road, but goes round a bend.

    Both cars are in the world, where ds/dt = v cosθ/(1 − κ d): on the inner side a metre of road is less of s.
    """
    if game.curvature == 0.0:
        return after
    return before + (after - before) / (1.0 - curvature_at(game, before) * lateral)


@njit(cache=True)
def gripped(limits: np.ndarray, speed: float, sideways: float) -> np.ndarray:
    """Return the robot's limits (4,) with ω no larger than its tyres hold at a speed."""
    held = limits.copy()
    held[1] = min(held[1], sideways / max(speed, 1e-3))
    held[0] = -held[1]
    return held


@njit(cache=True)
def game_step(robot: np.ndarray, omega: float, acceleration: float, speed_max: float, step: float) -> None:
    """Move the robot as the game's unicycle does, in place; Simpson's rule along the turn is exact to step⁵."""
    speed, heading = robot[3], robot[2]
    end = min(max(speed + acceleration * step, 0.0), speed_max)
    middle, middle_heading, end_heading = 0.5 * (speed + end), heading + 0.5 * omega * step, heading + omega * step
    robot[0] += (
        step / 6.0 * (speed * math.cos(heading) + 4.0 * middle * math.cos(middle_heading) + end * math.cos(end_heading))
    )
    robot[1] += (
        step / 6.0 * (speed * math.sin(heading) + 4.0 * middle * math.sin(middle_heading) + end * math.sin(end_heading))
    )
    robot[2], robot[3] = end_heading, end
