"""What some manoeuvres guarantee in the highway game: a lower bound of V that needs no grid.

A manoeuvre turns the robot to a heading and keeps it, at one acceleration; whatever the other car does meanwhile, the
robot's path is known. So the worst that the other car can do is known, too, at every instant by itself: for the gap
along the road it accelerates or brakes as hard as it may, for the gap across it also steers towards the robot. The
least of max(gap along, gap across) over the manoeuvre is what the manoeuvre guarantees, and the best manoeuvre's
guarantee is a lower bound of the game's value: the robot may do better, for it sees what the other car does.

Three things make the bound lower still, and none higher but the steps: the other car is granted the worst for both
gaps at once, the robot has to stay on one side, and bodies count as turned by the robot's heading, which V(0, ·)
leaves out. Between two instants both gaps count as linear, so that steps of a tenth of a second are wrong by
centimetres. After the last instant nothing is looked at.

A grid is wrong by metres where V comes from a corner of V(0, ·), and to the unsafe side; the bound is not. It
costs a simulation for every manoeuvre, so that it serves to cap a table at its nodes (`manoeuvre_cap`) and to judge a
single control (`control.escape`).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.reachability.grid import Grid

# s between the instants looked at: close together as long as the robot may be turning.
_STEPS = (0.1,) * 30 + (0.25,) * 20
_SHARES_OF_HEADING = (0.0, 0.5, -0.5, 1.0, -1.0)  # of the largest heading
_NEWTON_STEPS = 3
# Columns of a path, and of a reach.
_X, _Y, _AS_REAR, _AS_FRONT, _LEFT, _RIGHT = range(6)
_LEAST, _MOST, _FROM_BEHIND, _TO_THE_FRONT, _SIDEWAYS = range(5)


class Game(NamedTuple):
    """What both cars can do, and V(0, ·)."""

    omega_max: float  # rad/s
    speed_max: float  # m/s, of the robot
    other_sideways: float  # sin θ̄
    other_acceleration_min: float  # m/s²
    other_acceleration_max: float
    other_speed_max: float  # m/s
    target: TargetFormula


class Manoeuvres(NamedTuple):
    """Which manoeuvres there are, and the game that they are judged in; a NamedTuple, so that kernels take it."""

    heading: np.ndarray  # (M,) rad, turned to
    acceleration: np.ndarray  # (M,) m/s²
    steps: np.ndarray  # (S,) s, between the instants looked at
    # Apart from the arrays: jitted code counts references to every array of a tuple that it hands on.
    game: Game


# For who keeps no escape.
NO_MANOEUVRES = Manoeuvres(
    np.empty(0), np.empty(0), np.empty(0), Game(*(0.0,) * 6, TargetFormula(*(0.0,) * len(TargetFormula._fields)))
)


def manoeuvres_of(parameters: Mapping[str, float], grid: Grid) -> Manoeuvres:
    """Return the manoeuvres of a highway game: straight on, half and fully to either side, each braking, coasting and
    accelerating, the straight ones and the braking ones first.

    Args:
        parameters: of the game (`systems.highway.PARAMETERS`), all of them.
        grid: of the table, for the largest heading and the largest speeds.
    """
    headings = [min(max(share * grid.upper[2], grid.lower[2]), grid.upper[2]) for share in _SHARES_OF_HEADING]
    accelerations = (parameters["acceleration_min"], 0.0, parameters["acceleration_max"])
    pairs = np.array([(heading, acceleration) for heading in headings for acceleration in accelerations])
    return Manoeuvres(
        heading=pairs[:, 0].copy(),
        acceleration=pairs[:, 1].copy(),
        steps=np.array(_STEPS),
        game=Game(
            omega_max=parameters["omega_max"],
            speed_max=grid.upper[3],
            other_sideways=math.sin(parameters["other_heading_max"]),
            other_acceleration_min=parameters["other_acceleration_min"],
            other_acceleration_max=parameters["other_acceleration_max"],
            other_speed_max=grid.upper[4],
            target=TargetFormula.of_game(parameters),
        ),
    )


@njit(cache=True)
def _write_instant(
    target: TargetFormula, x: float, y: float, sin: float, cos: float, speed: float, row: np.ndarray
) -> None:
    """Write what the gaps need of the robot at one instant, (6,); sine and cosine are its heading's."""
    turned = 0.5 * (target.length * abs(sin) + target.width * (1.0 + cos))  # between the centres of touching bodies
    row[_X], row[_Y] = x, y
    row[_AS_REAR] = target.rear_0 + speed * (target.rear_1 + speed * target.rear_2)
    row[_AS_FRONT] = target.front_2 * speed * speed
    leftwards = speed * sin
    for side, column in ((1.0, _LEFT), (-1.0, _RIGHT)):
        towards = -side * leftwards
        after = max(towards + target.gained, 0.0)
        distance = max(target.lateral_0 + target.response * towards + target.lateral_2 * after * after, 0.0)
        row[column] = max(target.width + distance, turned)


@njit(cache=True)
def _driven(speed: float, acceleration: float, duration: float, top: float) -> tuple[float, float]:
    """Return how far a car gets, m, and its speed then, which stays within [0, top]."""
    end = speed + acceleration * duration
    bound = min(max(end, 0.0), top)
    if end == bound:
        return 0.5 * (speed + end) * duration, end
    until = (bound - speed) / acceleration
    return 0.5 * (speed + bound) * until + bound * (duration - until), bound


@njit(cache=True)
def write_path(
    manoeuvres: Manoeuvres,
    which: int,
    heading: float,
    speed: float,
    omega: float,
    acceleration: float,
    held: float,
    path: np.ndarray,
) -> None:
    """Write the robot's path from the origin: a control for a while, then a manoeuvre.

    Args:
        manoeuvres: all of them.
        which: the index of the manoeuvre.
        heading, speed: θ and v of the robot, rad and m/s.
        omega, acceleration: rad/s and m/s², held at first.
        held: s, may be 0.
        path: (instants, 6), written: p_x, p_y; d_long's part as the rear and as the front car; the least |p_y| at
            which V(0, ·) > 0 and the bodies are apart, on the left and on the right of the other car; all m.
    """
    x, y = 0.0, 0.0
    game, steps = manoeuvres.game, manoeuvres.steps
    new_heading, new_acceleration = manoeuvres.heading[which], manoeuvres.acceleration[which]
    target, top = game.target, game.speed_max
    speed = min(max(speed, 0.0), top)
    sin, cos = math.sin(heading), math.cos(heading)
    _write_instant(target, x, y, sin, cos, speed, path[0])
    for instant in range(1, len(path)):
        if instant == 1:
            step, turning, gain = held, held, acceleration
            end = heading + omega * held
        else:
            step, gain, end = steps[instant - 2], new_acceleration, new_heading
            turning = abs(end - heading) / game.omega_max
            if turning > step:
                end, turning = heading + math.copysign(game.omega_max * step, end - heading), step
        if turning > 0.0:
            driven, speed = _driven(speed, gain, turning, top)
            middle = 0.5 * (heading + end)
            x += driven * math.cos(middle)
            y += driven * math.sin(middle)
            heading = end
            sin, cos = math.sin(heading), math.cos(heading)
        if turning < step:
            driven, speed = _driven(speed, gain, step - turning, top)
            x += driven * cos
            y += driven * sin
        _write_instant(target, x, y, sin, cos, speed, path[instant])


@njit(cache=True)
def _least_between(along_0: float, across_0: float, along_1: float, across_1: float) -> float:
    """Return the least of max(along, 4 across³) from one instant to the next, but for the first of them.

    Where the larger one changes, one falls and the other rises, and the least lies where they are equal: a root of a
    cubic, found by Newton's rule from where the straight line through both ends has it. Beside the root the smaller
    one is less than at it.
    """
    cubic_0, cubic_1 = 4.0 * across_0 * across_0 * across_0, 4.0 * across_1 * across_1 * across_1
    before, after = along_0 - cubic_0, along_1 - cubic_1
    least = max(along_1, cubic_1)
    if (before > 0.0) == (after > 0.0):
        return least
    along_rise, across_rise = along_1 - along_0, across_1 - across_0
    share = before / (before - after)
    for _ in range(_NEWTON_STEPS):
        across = across_0 + share * across_rise
        slope = along_rise - 12.0 * across * across * across_rise
        if slope != 0.0:
            share -= (along_0 + share * along_rise - 4.0 * across * across * across) / slope
        share = min(max(share, 0.0), 1.0)
    across = across_0 + share * across_rise
    return min(least, min(along_0 + share * along_rise, 4.0 * across * across * across))


@njit(cache=True)
def _write_reach(game: Game, least: float, slowest: float, most: float, fastest: float, row: np.ndarray) -> None:
    """Write what the gaps need of the other car at one instant, (5,): how far and how fast it may be, m and m/s."""
    target = game.target
    row[_LEAST], row[_MOST] = least, most
    row[_FROM_BEHIND] = target.rear_0 + fastest * (target.rear_1 + fastest * target.rear_2)
    row[_TO_THE_FRONT] = target.front_2 * slowest * slowest
    row[_SIDEWAYS] = game.other_sideways * most


@njit(cache=True)
def write_reach(manoeuvres: Manoeuvres, speed: float, held: float, reach: np.ndarray) -> tuple[int, float]:
    """Write how far the other car may get, from the origin.

    Args:
        manoeuvres: the game and the instants.
        speed: v_o, m/s.
        held: s, as in `write_path`.
        reach: (instants + 1, 5), written, all m: the least and the most that it may have driven, d_long's part as
            the rear car and as the front car, and how far it may be to a side. The last row is of the instant at
            which it reaches its top speed.

    Returns:
        the step in which it reaches its top speed, and at which share of it; an instant that there is not if it does
        not. There the gap along the road stops shrinking as fast, so that it is not linear over this step.
    """
    game, steps = manoeuvres.game, manoeuvres.steps
    top, braking, gain = game.other_speed_max, game.other_acceleration_min, game.other_acceleration_max
    slowest = fastest = min(max(speed, 0.0), top)
    least = most = 0.0
    bend, share = len(reach), 0.0
    _write_reach(game, least, slowest, most, fastest, reach[0])
    for instant in range(1, len(reach) - 1):
        step = held if instant == 1 else steps[instant - 2]
        until = (top - fastest) / gain
        if 0.0 < until < step:
            bend, share = instant, until / step
            so_far, slower = _driven(slowest, braking, until, top)
            _write_reach(game, least + so_far, slower, most + 0.5 * (fastest + top) * until, top, reach[-1])
        driven, slowest = _driven(slowest, braking, step, top)
        least += driven
        driven, fastest = _driven(fastest, gain, step, top)
        most += driven
        _write_reach(game, least, slowest, most, fastest, reach[instant])
    return bend, share


@njit(cache=True)
def _worst_gap_along(length: float, x: float, as_rear: float, as_front: float, other: np.ndarray) -> float:
    """Return the gap along the road at its worst, m; `x` is robot − other's first place, `other` a row of its reach."""
    from_behind, to_the_front = other[_FROM_BEHIND] - as_front, as_rear - other[_TO_THE_FRONT]
    if x > other[_MOST]:  # ahead, whatever the other car does
        return x - other[_MOST] - length - max(from_behind, 0.0)
    if x <= other[_LEAST]:
        return other[_LEAST] - x - length - max(to_the_front, 0.0)
    return -length - max(from_behind, to_the_front, 0.0)


@njit(cache=True)
def guaranteed(
    game: Game,
    path: np.ndarray,
    reach: np.ndarray,
    bend: int,
    share: float,
    p_x: float,
    p_y: float,
    floor: float,
) -> float:
    """Return what a path guarantees against one other car, m: the least of V(0, ·), bodies turned, that it can force.

    Args:
        game: of the manoeuvres.
        path: (instants, 6) of `write_path`.
        reach: (instants + 1, 5) of `write_reach`, for the same instants.
        bend, share: what it returned.
        p_x, p_y: m, robot − other, at the beginning.
        floor: m; once nothing above it is possible, the search is given up and what was found so far is returned.
    """
    length = game.target.length
    row, other = path[0], reach[0]
    along = _worst_gap_along(length, p_x, row[_AS_REAR], row[_AS_FRONT], other)
    on_left, on_right = p_y - row[_LEFT], -p_y - row[_RIGHT]
    left, right = max(along, 4.0 * on_left**3), max(along, 4.0 * on_right**3)
    for instant in range(1, len(path)):
        along_0, left_0, right_0 = along, on_left, on_right
        if instant == bend:
            before, after, other = path[instant - 1], path[instant], reach[-1]
            x = p_x + before[_X] + share * (after[_X] - before[_X])
            y = p_y + before[_Y] + share * (after[_Y] - before[_Y])
            as_rear = before[_AS_REAR] + share * (after[_AS_REAR] - before[_AS_REAR])
            as_front = before[_AS_FRONT] + share * (after[_AS_FRONT] - before[_AS_FRONT])
            along_0 = _worst_gap_along(length, x, as_rear, as_front, other)
            left_0 = y - other[_SIDEWAYS] - before[_LEFT] - share * (after[_LEFT] - before[_LEFT])
            right_0 = -y - other[_SIDEWAYS] - before[_RIGHT] - share * (after[_RIGHT] - before[_RIGHT])
            left = min(left, _least_between(along, on_left, along_0, left_0))
            right = min(right, _least_between(along, on_right, along_0, right_0))
        row, other = path[instant], reach[instant]
        along = _worst_gap_along(length, p_x + row[_X], row[_AS_REAR], row[_AS_FRONT], other)
        y, sideways = p_y + row[_Y], other[_SIDEWAYS]
        on_left, on_right = y - sideways - row[_LEFT], -y - sideways - row[_RIGHT]
        left = min(left, _least_between(along_0, left_0, along, on_left))
        right = min(right, _least_between(along_0, right_0, along, on_right))
        if max(left, right) <= floor:
            break
    return max(left, right)


@njit(cache=True)
def best_guarantee(
    game: Game, paths: np.ndarray, reach: np.ndarray, bend: int, share: float, p_x: float, p_y: float, enough: float
) -> float:
    """Return what the best of some paths guarantees against one car, or the first that is `enough`, m."""
    best = -math.inf
    for which in range(len(paths)):
        best = max(best, guaranteed(game, paths[which], reach, bend, share, p_x, p_y, best))
        if best >= enough:
            break
    return best


@njit(cache=True, nogil=True)
def lower_bounds(manoeuvres: Manoeuvres, states: np.ndarray) -> np.ndarray:
    """Return what the best manoeuvre guarantees at `states` (N, 5), (N,), m."""
    bounds = np.empty(len(states))
    paths = np.empty((len(manoeuvres.heading), len(manoeuvres.steps) + 2, 6))
    reach = np.empty((paths.shape[1] + 1, 5))
    for i in range(len(states)):
        p_x, p_y, heading, v_r, v_o = states[i]
        for which in range(len(paths)):
            write_path(manoeuvres, which, heading, v_r, 0.0, 0.0, 0.0, paths[which])
        bend, share = write_reach(manoeuvres, v_o, 0.0, reach)
        bounds[i] = best_guarantee(manoeuvres.game, paths, reach, bend, share, p_x, p_y, math.inf)
    return bounds
