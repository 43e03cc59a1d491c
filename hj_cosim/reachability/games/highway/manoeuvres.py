"""What some manoeuvres guarantee in the highway game: a lower bound of V that needs no grid.

A manoeuvre turns the robot to a heading and keeps it, at one acceleration; whatever the other car does meanwhile, the
robot's path is known (`paths`). So the worst that the other car can do is known, too, at every instant by itself: for
the gap along the road it accelerates or brakes as hard as it may, for the gap across it also steers towards the robot.
The least of max(gap along, gap across) over the manoeuvre is what the manoeuvre guarantees, and the best manoeuvre's
guarantee is a lower bound of the game's value: the robot may do better, for it sees what the other car does.

Three things make the bound lower still, and none higher: the other car is granted the worst for both gaps at once, the
robot has to stay on one side, and bodies count as turned by the robot's heading, which V(0, ·) leaves out. Between two
instants both gaps count as straight lines, lowered by what they may bend below them (`paths`). Below −length, where
the bodies are beside each other, the gap along the road is not told apart any further. After the last instant nothing
is looked at.

A grid is wrong by metres where V comes from a corner of V(0, ·), and to the unsafe side; the bound is not. It
costs a simulation for every manoeuvre, so that it serves to cap a table at its nodes (`manoeuvre_cap`) and to judge a
single control (`control.spc.escape`).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.reachability.games.highway.paths import (
    AS_FRONT,
    AS_REAR,
    BEND_AHEAD,
    BEND_AHEAD_OF_FASTEST,
    BEND_BEHIND,
    BEND_LEFT,
    BEND_RIGHT,
    COLUMNS,
    LEFT,
    MOST_INSTANTS,
    RIGHT,
    TIME,
    Game,
    Start,
    X,
    Y,
    write_path,
)
from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.reachability.grid import Grid

# Of the largest heading; short of it, for a filter keeps as far away from the table's edge as the robot turns in a step.
_SHARES_OF_HEADING = (0.0, 0.49, -0.49, 0.98, -0.98)
_ROOT_STEPS = 80
_ROOT_TOLERANCE = 1e-9  # m


class Manoeuvres(NamedTuple):
    """Which manoeuvres there are, and the game that they are judged in; a NamedTuple, so that kernels take it."""

    heading: np.ndarray  # (M,) rad, turned to
    acceleration: np.ndarray  # (M,) m/s²
    # Apart from the arrays: jitted code counts references to every array of a tuple that it hands on.
    game: Game


# For who keeps no escape.
NO_MANOEUVRES = Manoeuvres(
    np.empty(0), np.empty(0), Game(*(0.0,) * 6, TargetFormula(*(0.0,) * len(TargetFormula._fields)))
)


def manoeuvres_of(parameters: Mapping[str, float], grid: Grid) -> Manoeuvres:
    """Return the manoeuvres of a highway game: straight on, half and fully to either side, each braking, coasting and
    accelerating, the straight ones and the braking ones first.

    Args:
        parameters: of the game (`games.highway.game.PARAMETERS`), all of them.
        grid: of the table, for the largest heading and the largest speeds.
    """
    headings = [min(max(share * grid.upper[2], grid.lower[2]), grid.upper[2]) for share in _SHARES_OF_HEADING]
    accelerations = (parameters["acceleration_min"], 0.0, parameters["acceleration_max"])
    pairs = np.array([(heading, acceleration) for heading in headings for acceleration in accelerations])
    return Manoeuvres(
        heading=pairs[:, 0].copy(),
        acceleration=pairs[:, 1].copy(),
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


class Paths(NamedTuple):
    """Room for the paths of all manoeuvres from one start, written one by one."""

    rows: np.ndarray  # (M, MOST_INSTANTS, COLUMNS)
    instants: np.ndarray  # (M,) int, of each path; 0 as long as it is not written


@njit(cache=True)
def room_for_paths(manoeuvres: Manoeuvres) -> Paths:
    """Return paths of which none is written."""
    count = len(manoeuvres.heading)
    return Paths(np.empty((count, MOST_INSTANTS, COLUMNS)), np.zeros(count, np.int64))


@njit(cache=True)
def require_path(manoeuvres: Manoeuvres, which: int, start: Start, paths: Paths) -> None:
    """Write a manoeuvre's path unless it is written; mostly the first few are all that is wanted."""
    if paths.instants[which] == 0:
        heading, acceleration = manoeuvres.heading[which], manoeuvres.acceleration[which]
        paths.instants[which] = write_path(manoeuvres.game, heading, acceleration, start, paths.rows[which])


@njit(cache=True)
def least_between(along_0: float, across_0: float, along_1: float, across_1: float) -> float:
    """Return the least of max(along, 4 across³), m, where `along` and `across` go straight from one value to another.

    Both of the two rise or fall all the way. So the least lies at an end, or where one falls and the other rises, at
    the one place at which they are equal. That is sought by Newton's rule as long as it halves the difference, and by
    bisection else; beside it the smaller of the two is less than at it, so that what is returned is never too high.
    """
    cubic_0, cubic_1 = 4.0 * across_0 * across_0 * across_0, 4.0 * across_1 * across_1 * across_1
    before, after = along_0 - cubic_0, along_1 - cubic_1
    along_rise, across_rise = along_1 - along_0, across_1 - across_0
    if (before > 0.0) == (after > 0.0) or (along_rise > 0.0) == (across_rise > 0.0):
        return min(max(along_0, cubic_0), max(along_1, cubic_1))
    low, high, least, last = 0.0, 1.0, -math.inf, math.inf
    share = before / (before - after)
    for _ in range(_ROOT_STEPS):
        along, across = along_0 + share * along_rise, across_0 + share * across_rise
        cubic = 4.0 * across * across * across
        difference = along - cubic
        least = max(least, min(along, cubic))
        if abs(difference) <= _ROOT_TOLERANCE:
            break
        if (difference > 0.0) == (before > 0.0):
            low = share
        else:
            high = share
        slope = along_rise - 12.0 * across * across * across_rise  # not 0, for the two terms have one sign
        share -= difference / slope
        if not low < share < high or abs(difference) > 0.5 * last:
            share = 0.5 * (low + high)
        last = abs(difference)
    return least


class Other(NamedTuple):
    """What another car can reach, from the origin at time 0."""

    speed: float  # m/s
    until_stop: float  # s, at its hardest braking
    until_top: float  # s, at its strongest acceleration


@njit(cache=True)
def other_at(game: Game, speed: float) -> Other:
    """Return the other car at a speed, which is held to be within the game's, m/s."""
    speed = min(max(speed, 0.0), game.other_speed_max)
    braking, gain = game.other_acceleration_min, game.other_acceleration_max
    until_stop = speed / -braking if braking < 0.0 else math.inf
    return Other(speed, until_stop, (game.other_speed_max - speed) / gain if gain > 0.0 else math.inf)


@njit(cache=True)
def _gaps(
    game: Game, other: Other, time: float, x: float, y: float, as_rear: float, as_front: float
) -> tuple[float, float, float, float]:
    """Return the gaps along the road at their worst, m, of a robot that is ahead of the other car, and behind it; and
    how far it is to the left and to the right of where the other car may be, m."""
    target = game.target
    gaining, braking = min(time, other.until_top), min(time, other.until_stop)
    fastest = other.speed + game.other_acceleration_max * gaining
    slowest = other.speed + game.other_acceleration_min * braking
    most = 0.5 * (other.speed + fastest) * gaining + fastest * (time - gaining)
    least = 0.5 * (other.speed + slowest) * braking + slowest * (time - braking)
    from_behind = target.rear_0 + fastest * (target.rear_1 + fastest * target.rear_2) - as_front
    to_the_front = as_rear - target.front_2 * slowest * slowest
    ahead = x - most - target.length - max(from_behind, 0.0)
    behind = least - x - target.length - max(to_the_front, 0.0)
    sideways = game.other_sideways * most
    return ahead, behind, y - sideways, -y - sideways


@njit(cache=True)
def _between(before: np.ndarray, after: np.ndarray, column: int, share: float) -> float:
    return before[column] + share * (after[column] - before[column])


@njit(cache=True)
def _least_on_a_side(
    length: float,
    ahead: tuple[float, float],
    behind: tuple[float, float],
    across: tuple[float, float],
    known: float,
) -> float:
    """Return the least of max(ahead, behind, 4 across³) from one instant to the next, or `known` if that is less.

    Of ahead and behind one is at most −length. Where it is not the same all the way, either alone gives a lower bound.
    """
    nearest = min(across[0], across[1])
    if (
        min(ahead[0], ahead[1]) >= known
        or min(behind[0], behind[1]) >= known
        or 4.0 * nearest * nearest * nearest >= known
    ):
        return known
    is_ahead, is_behind = max(ahead[0], ahead[1]) > -length, max(behind[0], behind[1]) > -length
    least = -math.inf
    if is_ahead or not is_behind:
        least = least_between(ahead[0], across[0], ahead[1], across[1])
    if is_behind or not is_ahead:
        least = max(least, least_between(behind[0], across[0], behind[1], across[1]))
    return min(known, least)


@njit(cache=True)
def guaranteed(
    game: Game, path: np.ndarray, first: int, other: Other, p_x: float, p_y: float, floor: float
) -> float:
    """Return what a path guarantees against one other car, m: the least of V(0, ·), bodies turned, that it can force.

    Args:
        game: of the manoeuvres.
        path: (instants, COLUMNS) of `write_path`.
        first: the instant from which on it counts.
        other: the other car.
        p_x, p_y: m, robot − other, at the beginning.
        floor: m; once nothing above it is possible, the search is given up and what was found so far is returned.
    """
    length, row = game.target.length, path[first]
    ahead_0, behind_0, left_0, right_0 = _gaps(
        game, other, row[TIME], p_x + row[X], p_y + row[Y], row[AS_REAR], row[AS_FRONT]
    )
    left_0, right_0 = left_0 - row[LEFT], right_0 - row[RIGHT]
    along = max(ahead_0, behind_0)
    left, right = max(along, 4.0 * left_0**3), max(along, 4.0 * right_0**3)
    for instant in range(first + 1, len(path)):
        before, row = path[instant - 1], path[instant]
        time, bend_ahead, bend_behind = row[TIME], row[BEND_AHEAD], row[BEND_BEHIND]
        bend_left, bend_right = row[BEND_LEFT], row[BEND_RIGHT]
        if before[TIME] < other.until_top < time:
            # There the gap ahead of the other car ceases to shrink as fast: an instant of its own, the robot where it
            # is at least.
            bend_ahead = row[BEND_AHEAD_OF_FASTEST]
            share = (other.until_top - before[TIME]) / (time - before[TIME])
            ahead, behind, on_left, on_right = _gaps(
                game,
                other,
                other.until_top,
                p_x + _between(before, row, X, share),
                p_y + _between(before, row, Y, share),
                _between(before, row, AS_REAR, share),
                _between(before, row, AS_FRONT, share),
            )
            ahead, behind = ahead - bend_ahead, behind - bend_behind
            on_left -= _between(before, row, LEFT, share) + bend_left
            on_right -= _between(before, row, RIGHT, share) + bend_right
            aheads = (ahead_0 - bend_ahead, ahead - bend_ahead)
            behinds = (behind_0 - bend_behind, behind - bend_behind)
            left = _least_on_a_side(length, aheads, behinds, (left_0 - bend_left, on_left - bend_left), left)
            right = _least_on_a_side(length, aheads, behinds, (right_0 - bend_right, on_right - bend_right), right)
            ahead_0, behind_0, left_0, right_0 = ahead, behind, on_left, on_right
        elif before[TIME] >= other.until_top:
            bend_ahead = row[BEND_AHEAD_OF_FASTEST]
        ahead, behind, on_left, on_right = _gaps(
            game, other, time, p_x + row[X], p_y + row[Y], row[AS_REAR], row[AS_FRONT]
        )
        on_left, on_right = on_left - row[LEFT], on_right - row[RIGHT]
        aheads = (ahead_0 - bend_ahead, ahead - bend_ahead)
        behinds = (behind_0 - bend_behind, behind - bend_behind)
        left = _least_on_a_side(length, aheads, behinds, (left_0 - bend_left, on_left - bend_left), left)
        right = _least_on_a_side(length, aheads, behinds, (right_0 - bend_right, on_right - bend_right), right)
        if max(left, right) <= floor:
            break
        ahead_0, behind_0, left_0, right_0 = ahead, behind, on_left, on_right
    return max(left, right)


@njit(cache=True)
def best_guarantee(
    manoeuvres: Manoeuvres, start: Start, paths: Paths, other: Other, p_x: float, p_y: float, enough: float
) -> float:
    """Return what the best manoeuvre guarantees against one car, or the first that is `enough`, m."""
    best = -math.inf
    for which in range(len(paths.instants)):
        require_path(manoeuvres, which, start, paths)
        path = paths.rows[which, : paths.instants[which]]
        best = max(best, guaranteed(manoeuvres.game, path, 0, other, p_x, p_y, best))
        if best >= enough:
            break
    return best


@njit(cache=True, nogil=True)
def lower_bounds(manoeuvres: Manoeuvres, states: np.ndarray) -> np.ndarray:
    """Return what the best manoeuvre guarantees at `states` (N, 5), (N,), m."""
    bounds = np.empty(len(states))
    for i in range(len(states)):
        p_x, p_y, heading, v_r, v_o = states[i]
        paths, start = room_for_paths(manoeuvres), Start(heading, v_r, 0.0, 0.0, 0.0)
        other = other_at(manoeuvres.game, v_o)
        bounds[i] = best_guarantee(manoeuvres, start, paths, other, p_x, p_y, math.inf)
    return bounds
