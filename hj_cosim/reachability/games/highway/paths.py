"""The robot's path in a manoeuvre, at instants, and how far its gaps may bend below straight lines between them.

The instants are close together while the robot turns, and there is one wherever its turning or its acceleration ends.
In between everything that the gaps are made of is smooth, and of a smooth f with f'' <= K it is known that over a step
h it stays above the straight line between its ends less K h²/8. K is worked out for every step and every gap from the
ranges of speed and heading in it; [·]_+ and the larger of two distances in a gap only bend it upwards, or as K says.
For a robot that goes straight K is mostly 0: RSS's distances are quadratic in the speed exactly so that they match.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.other_car import Disturbance, disturbance_from
from hj_cosim.reachability.games.highway.target import FORMULA_NUMBERS, TargetFormula, formula_from

DURATION = 8.0  # s, of a manoeuvre
_TURNING_STEP, _STRAIGHT_STEP = 0.1, 0.25  # s, between instants
_INSTANT = 1e-9  # s; what is shorter is no step
_TURN = 1e-9  # rad, likewise
_SLOWEST = 1e-3  # m/s, below which tyres hold any turn
_FINE_TURNING_STEP = 0.05  # s, where nothing is known of what lies between instants (`duty_bound`)
# A robot that turns all the time, the beginning, and five ends: of what is held, of turning, of accelerating in each.
MOST_INSTANTS = round(DURATION / _TURNING_STEP) + 10
# Columns of a path: s, m, m; d_long's part as the rear and as the front car, m; the least |p_y| at which V(0, ·) > 0
# and the bodies are apart, on the left and on the right of the other car, m.
TIME, X, Y, AS_REAR, AS_FRONT, LEFT, RIGHT = range(7)
# And by how much, m, gaps may bend below the straight line from the instant before: behind the other car; ahead of it
# while it accelerates, and at its top speed; on the left and on the right of it.
BEND_BEHIND, BEND_AHEAD, BEND_AHEAD_OF_FASTEST, BEND_LEFT, BEND_RIGHT = range(7, 12)
# The robot's speed, and its speed to the left, m/s.
SPEED, LEFTWARDS = range(12, 14)
COLUMNS = 14


class Game(NamedTuple):
    """What both cars can do, and V(0, ·)."""

    omega_max: float  # rad/s
    sideways: float  # m/s², the most |v ω| that the robot's tyres hold
    speed_max: float  # m/s, of the robot
    duration: float  # s, of a manoeuvre, up to DURATION
    other_forward: float  # cos θ̄, the least of its speed that goes along the road
    other_sideways: float  # sin θ̄
    other_acceleration_min: float  # m/s²
    other_acceleration_max: float
    other_speed_max: float  # m/s
    target: TargetFormula
    other: (
        Disturbance  # what is assumed of it; if it does its duties, a manoeuvre ends as soon as the robot is straight
    )


_OF_ITS_OWN = len(Game._fields) - 2  # numbers


@kernel
def game_from(numbers: np.ndarray) -> Game:
    """Return the game whose numbers these are (`reachability.packing`)."""
    own, rest = to_fixed_tuple(numbers, _OF_ITS_OWN), numbers[_OF_ITS_OWN:]
    both = formula_from(rest), disturbance_from(rest[FORMULA_NUMBERS:])
    return Game(*(own + both))


class Start(NamedTuple):
    """Where a manoeuvre begins: the robot's heading and speed, and the control that it holds before."""

    heading: float  # rad
    speed: float  # m/s
    omega: float  # rad/s
    acceleration: float  # m/s²
    held: float  # s, may be 0


class Motion(NamedTuple):
    """The robot at an instant."""

    time: float  # s
    x: float  # m
    y: float  # m
    heading: float  # rad
    speed: float  # m/s
    sin: float  # of the heading
    cos: float


@kernel
def _write_instant(target: TargetFormula, at: Motion, row: np.ndarray) -> None:
    """Write what the gaps need of the robot at one instant, but for how they bend before it."""
    turned = 0.5 * (target.length * abs(at.sin) + target.width * (1.0 + at.cos))  # between centres of touching bodies
    sticking = target.sticking * abs(at.sin)
    row[TIME], row[X], row[Y] = at.time, at.x, at.y
    row[AS_REAR] = target.rear_0 + at.speed * (target.rear_1 + at.speed * target.rear_2)
    row[AS_FRONT] = at.speed * (target.front_1 + at.speed * target.front_2)
    leftwards = at.speed * at.sin
    row[SPEED], row[LEFTWARDS] = at.speed, leftwards
    for side, column in ((1.0, LEFT), (-1.0, RIGHT)):
        towards = -side * leftwards
        after = max(towards + target.gained, 0.0)
        distance = max(target.lateral_0 + target.response * towards + target.lateral_2 * after * after, 0.0)
        row[column] = max(target.width + sticking + distance, turned)


@kernel
def _product(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Return the range of the product of two numbers that are known by their ranges."""
    first, second, third, fourth = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    return min(min(first, second), min(third, fourth)), max(max(first, second), max(third, fourth))


@kernel
def _lateral_bend(
    target: TargetFormula,
    towards: tuple[float, float],
    rate: tuple[float, float],
    curvature: tuple[float, float],
    turned: float,
    sticking: float,
) -> float:
    """Return how fast a lateral distance may bend upwards at most, m/s², at least 0.

    Args:
        target: its formula, d_lat(s).
        towards, rate, curvature: ranges of s, ds/dt and d²s/dt², of the robot's speed towards the other car's side.
        turned: m/s², likewise of the distance at which turned bodies touch.
        sticking: m/s², likewise of what a turned body adds to d_lat.
    """
    steepest = target.response + 2.0 * target.lateral_2 * max(towards[1] + target.gained, 0.0)
    bend = steepest * max(-curvature[0], 0.0)
    if towards[0] + target.gained > 0.0:
        slowest = max(max(rate[0], -rate[1]), 0.0)
        bend -= 2.0 * target.lateral_2 * slowest * slowest
    return max(max(bend + sticking, turned), 0.0)


@kernel
def _write_bends(game: Game, before: Motion, after: Motion, omega: float, acceleration: float, row: np.ndarray) -> None:
    """Write how far the gaps may bend below straight lines in the step that ends at a row."""
    target, step = game.target, after.time - before.time
    turn = omega * step
    beyond = 0.125 * turn * turn  # by which a sine may exceed its values at both ends
    sin = (min(before.sin, after.sin) - beyond, max(before.sin, after.sin) + beyond)
    cos = (min(before.cos, after.cos) - beyond, max(before.cos, after.cos) + beyond)
    speed = (min(before.speed, after.speed), max(before.speed, after.speed))
    faster, sideways = (acceleration, acceleration), _product(speed, (omega, omega))
    # d²x/dt² = a cosθ − v ω sinθ, d²y/dt² = a sinθ + v ω cosθ = d(v sinθ)/dt
    gain, centripetal = _product(faster, cos), _product(sideways, sin)
    along = (gain[0] - centripetal[1], gain[1] - centripetal[0])
    gain, centripetal = _product(faster, sin), _product(sideways, cos)
    across = (gain[0] + centripetal[0], gain[1] + centripetal[1])
    own = acceleration * acceleration
    braking, gaining = game.other_acceleration_min, game.other_acceleration_max
    # Behind: the other car brakes or stands, d_long counts or, while it moves, may be 0.
    slowing = braking * game.other_forward
    behind = max(
        slowing - along[0],
        max(slowing + 2.0 * target.front_2 * braking * braking, 0.0) - along[0] - 2.0 * target.rear_2 * own,
    )
    ahead = (
        along[1] - gaining + max(2.0 * target.front_2 * own - 2.0 * target.rear_2 * gaining * gaining, 0.0)
    )  # d_long counts, or is 0
    fastest = along[1] + 2.0 * target.front_2 * own
    left = right = 0.0
    if omega != 0.0:
        # d²(v sinθ)/dt² = 2 a ω cosθ − v ω² sinθ
        twice, inwards = 2.0 * acceleration * omega, _product(sideways, (omega, omega))
        gain, inwards = _product((twice, twice), cos), _product(inwards, sin)
        curvature = (gain[0] - inwards[1], gain[1] - inwards[0])
        over = 0.125 * step * step * max(-curvature[0], curvature[1])
        ends = (before.speed * before.sin, after.speed * after.sin)
        leftwards = (min(ends[0], ends[1]) - over, max(ends[0], ends[1]) + over)
        steepest = max(-sin[0], sin[1])
        turned = 0.5 * omega * omega * (target.length * steepest + target.width * cos[1])
        sticking = omega * omega * target.sticking * steepest
        rightwards, away = (-leftwards[1], -leftwards[0]), (-across[1], -across[0])
        left = _lateral_bend(target, rightwards, away, (-curvature[1], -curvature[0]), turned, sticking)
        right = _lateral_bend(target, leftwards, across, curvature, turned, sticking)
    eighth = 0.125 * step * step
    row[BEND_BEHIND], row[BEND_AHEAD] = eighth * max(behind, 0.0), eighth * max(ahead, 0.0)
    row[BEND_AHEAD_OF_FASTEST] = eighth * max(fastest, 0.0)
    row[BEND_LEFT], row[BEND_RIGHT] = eighth * max(across[1] + left, 0.0), eighth * max(right - across[0], 0.0)


@kernel
def _moved(at: Motion, omega: float, acceleration: float, step: float) -> Motion:
    """Return the robot a step later, by Simpson's rule."""
    end = at.speed + acceleration * step
    middle = 0.5 * (at.speed + end)
    if omega == 0.0:
        driven = middle * step
        return Motion(at.time + step, at.x + driven * at.cos, at.y + driven * at.sin, at.heading, end, at.sin, at.cos)
    heading, half_way = at.heading + omega * step, at.heading + 0.5 * omega * step
    sin, cos = math.sin(heading), math.cos(heading)
    return Motion(
        at.time + step,
        at.x + step / 6.0 * (at.speed * at.cos + 4.0 * middle * math.cos(half_way) + end * cos),
        at.y + step / 6.0 * (at.speed * at.sin + 4.0 * middle * math.sin(half_way) + end * sin),
        heading,
        end,
        sin,
        cos,
    )


@kernel
def turning_max(game: Game, speed: float) -> float:
    """Return the largest |ω|, rad/s, at a speed, m/s: the robot's limit, and what its tyres hold."""
    return min(game.omega_max, game.sideways / max(speed, _SLOWEST))


@kernel
def write_path(game: Game, heading: float, acceleration: float, start: Start, path: np.ndarray) -> int:
    """Write the robot's path from the origin: a control for a while, then a manoeuvre.

    Args:
        game: what the robot can do.
        heading, acceleration: of the manoeuvre, rad and m/s².
        start: where it begins, and what is held before.
        path: (MOST_INSTANTS, COLUMNS), written.

    Returns:
        how many instants were written. The second is the end of what is held, unless the robot stops or reaches its
        top speed before.
    """
    speed = min(max(start.speed, 0.0), game.speed_max)
    at = Motion(0.0, 0.0, 0.0, start.heading, speed, math.sin(start.heading), math.cos(start.heading))
    _write_instant(game.target, at, path[0])
    count, end = 1, start.held + game.duration
    rest = heading - start.heading - start.omega * start.held  # rad, to turn by
    finest = _FINE_TURNING_STEP if game.other.responsible else _TURNING_STEP
    while at.time < end - _INSTANT and count < MOST_INSTANTS:
        if at.time < start.held - _INSTANT:
            omega, gain, step = start.omega, start.acceleration, start.held - at.time
        elif abs(rest) > _TURN:
            fastest = min(max(at.speed, at.speed + acceleration * finest), game.speed_max)
            omega = math.copysign(turning_max(game, fastest), rest)
            gain, step = acceleration, min(finest, rest / omega, end - at.time)
        elif game.other.responsible:
            break
        else:
            omega, gain, step = 0.0, acceleration, min(_STRAIGHT_STEP, end - at.time)
        if gain != 0.0:
            until = ((game.speed_max if gain > 0.0 else 0.0) - at.speed) / gain
            if until <= _INSTANT:
                gain = 0.0
            else:
                step = min(step, until)
        later = _moved(at, omega, gain, step)
        if at.time >= start.held - _INSTANT and omega != 0.0:
            rest -= omega * step
        _write_instant(game.target, later, path[count])
        _write_bends(game, at, later, omega, gain, path[count])
        at = later
        count += 1
    return count
