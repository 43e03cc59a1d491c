"""What some manoeuvres guarantee in the highway game: a lower bound of V that needs no grid.

A manoeuvre turns the robot to a heading and keeps it, at one acceleration; whatever the other car does meanwhile, the
robot's path is known (`paths`). So the worst that the other car can do is known, too, at every instant by itself: for
the gap along the road it accelerates as hard as it may, or brakes and weaves, which takes a little of its way; for the
gap across it also steers towards the robot.
The least of max(gap along, gap across) over the manoeuvre is what the manoeuvre guarantees, and the best manoeuvre's
guarantee is a lower bound of the game's value: the robot may do better, for it sees what the other car does.

Three things make the bound lower still, and none higher: the other car is granted the worst for both gaps at once, the
robot has to stay on one side, and bodies count as turned by the robot's heading, which V(0, ·) leaves out. Between two
instants both gaps count as straight lines, lowered by what they may bend below them (`paths`). Only how far below
−length it is, where one car passes through the other within a step, may be missed. After the last instant nothing is
looked at.

A grid is wrong by metres where V comes from a corner of V(0, ·), and to the unsafe side; the bound is not. It
costs a simulation for every manoeuvre, so that it serves to cap a table at its nodes (`manoeuvre_cap`) and to judge a
single control (`control.spc.escape`).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.duty_bound import guaranteed_by_duties, level_of_duties, require_hold
from hj_cosim.reachability.games.highway.least_between import least_of_step
from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.games.highway.paths import (
    AS_FRONT,
    AS_REAR,
    BEND_AHEAD,
    BEND_AHEAD_OF_FASTEST,
    BEND_BEHIND,
    BEND_LEFT,
    BEND_RIGHT,
    COLUMNS,
    DURATION,
    LEFT,
    MOST_INSTANTS,
    RIGHT,
    TIME,
    Game,
    Start,
    X,
    Y,
    game_from,
    write_path,
)
from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.packing import packed

# Of the largest heading; short of it, for a filter stays as far from the table's edge as the robot turns in a step.
_SHARES_OF_HEADING = (0.0, 0.49, -0.49, 0.98, -0.98)


class Manoeuvres(NamedTuple):
    """Which manoeuvres there are, and the game that they are judged in; a NamedTuple, so that kernels take it."""

    heading: np.ndarray  # (M,) rad, turned to
    acceleration: np.ndarray  # (M,) m/s²
    # Apart from the arrays: jitted code counts references to every array of a tuple that it hands on.
    game: Game
    games: np.ndarray  # (classes, n) the numbers of the games with cars of each size class, this one's first


def _without_larger(heading: np.ndarray, acceleration: np.ndarray, game: Game) -> Manoeuvres:
    return Manoeuvres(heading, acceleration, game, packed(game)[np.newaxis])


# For who keeps no escape.
NO_MANOEUVRES = _without_larger(
    np.empty(0),
    np.empty(0),
    Game(*(0.0,) * 9, TargetFormula(*(0.0,) * len(TargetFormula._fields)), Disturbance(0.0, 0.0, 0.0)),
)


@kernel
def game_with(manoeuvres: Manoeuvres, kind: int) -> Game:
    """Return the game with other cars of a size class."""
    return manoeuvres.game if kind == 0 else game_from(manoeuvres.games[kind])


def manoeuvres_of(parameters: Mapping[str, float], grid: Grid) -> Manoeuvres:
    """Return the manoeuvres of a highway game, those first that are most likely to escape.

    Against the worst: straight on, half and fully to either side, each braking, coasting and accelerating. Among cars
    that do their duties: straightening up at each of these, and braking then (`duty_bound`).

    Args:
        parameters: of the game (`games.highway.game.PARAMETERS`), all of them.
        grid: of the table, for the largest heading and the largest speeds.
    """
    other = Disturbance.of_game(parameters)
    shares = (0.0,) if other.responsible else _SHARES_OF_HEADING
    headings = [min(max(share * grid.upper[2], grid.lower[2]), grid.upper[2]) for share in shares]
    accelerations = (parameters["acceleration_min"], 0.0, parameters["acceleration_max"])
    pairs = np.array([(heading, acceleration) for heading in headings for acceleration in accelerations])
    game = Game(
        omega_max=parameters["omega_max"],
        sideways=parameters["lateral_acceleration_max"],
        speed_max=grid.upper[3],
        duration=DURATION,
        other_forward=math.cos(other.heading_max),
        other_sideways=math.sin(other.heading_max),
        other_acceleration_min=other.acceleration_min,
        other_acceleration_max=other.acceleration_max,
        other_speed_max=grid.upper[4],
        target=TargetFormula.of_game(parameters),
        other=other,
    )
    if other.responsible:
        require_hold(game, parameters["acceleration_min"])
    return _without_larger(pairs[:, 0].copy(), pairs[:, 1].copy(), game)


class Paths(NamedTuple):
    """Room for the paths of all manoeuvres from one start, written one by one; after the M of a size class the next's.

    A path has how near the robot may come to the side of another car, which depends on that one's size.
    """

    rows: np.ndarray  # (classes M, MOST_INSTANTS, COLUMNS)
    instants: np.ndarray  # (classes M,) int, of each path; 0 as long as it is not written


@njit(cache=True)
def room_for_paths(manoeuvres: Manoeuvres) -> Paths:
    """Return paths of which none is written."""
    count = len(manoeuvres.heading) * len(manoeuvres.games)
    return Paths(np.empty((count, MOST_INSTANTS, COLUMNS)), np.zeros(count, np.int64))


@kernel
def require_path(manoeuvres: Manoeuvres, which: int, start: Start, paths: Paths) -> None:
    """Write a path, by its row, unless it is written; mostly the first few are all that is wanted."""
    if paths.instants[which] == 0:
        kind, manoeuvre = divmod(which, len(manoeuvres.heading))
        heading, acceleration = manoeuvres.heading[manoeuvre], manoeuvres.acceleration[manoeuvre]
        paths.instants[which] = write_path(game_with(manoeuvres, kind), heading, acceleration, start, paths.rows[which])


class Other(NamedTuple):
    """What another car can reach, from the origin at time 0."""

    speed: float  # m/s
    until_stop: float  # s, at its hardest braking
    until_top: float  # s, at its strongest acceleration


@kernel
def other_at(game: Game, speed: float) -> Other:
    """Return the other car at a speed, which is held to be within the game's, m/s."""
    speed = min(max(speed, 0.0), game.other_speed_max)
    braking, gain = game.other_acceleration_min, game.other_acceleration_max
    until_stop = speed / -braking if braking < 0.0 else math.inf
    return Other(speed, until_stop, (game.other_speed_max - speed) / gain if gain > 0.0 else math.inf)


class Place(NamedTuple):
    """The robot at an instant, as the gaps need it: what `paths` writes, m."""

    x: float
    y: float
    as_rear: float
    as_front: float
    left: float
    right: float


@kernel
def _place_at(row: np.ndarray) -> Place:
    """Return where the robot is at a row of a path."""
    return Place(row[X], row[Y], row[AS_REAR], row[AS_FRONT], row[LEFT], row[RIGHT])


@kernel
def _place_between(last: np.ndarray, row: np.ndarray, share: float) -> Place:
    """Return where the robot is after a share of the step between two rows, as if everything went straight."""
    return Place(
        last[X] + share * (row[X] - last[X]),
        last[Y] + share * (row[Y] - last[Y]),
        last[AS_REAR] + share * (row[AS_REAR] - last[AS_REAR]),
        last[AS_FRONT] + share * (row[AS_FRONT] - last[AS_FRONT]),
        last[LEFT] + share * (row[LEFT] - last[LEFT]),
        last[RIGHT] + share * (row[RIGHT] - last[RIGHT]),
    )


class Gaps(NamedTuple):
    """Between the robot and wherever the other car may be at an instant, each at its worst, m."""

    ahead: float  # along the road, of a robot that is ahead of the other car
    behind: float  # of one that is behind it
    beside: float  # of one that may be either
    place: int  # 1 ahead, −1 behind, 0 beside
    left: float  # across the road, of a robot that stays on the left of the other car
    right: float


@kernel
def _gaps(game: Game, other: Other, time: float, p_x: float, p_y: float, robot: Place) -> Gaps:
    """Return the gaps at an instant; p_x, p_y are robot − other at the beginning, m."""
    target = game.target
    gaining, braking = min(time, other.until_top), min(time, other.until_stop)
    fastest = other.speed + game.other_acceleration_max * gaining
    slowest = other.speed + game.other_acceleration_min * braking
    most = 0.5 * (other.speed + fastest) * gaining + fastest * (time - gaining)
    least = game.other_forward * (0.5 * (other.speed + slowest) * braking + slowest * (time - braking))
    from_behind = max(target.rear_0 + fastest * (target.rear_1 + fastest * target.rear_2) - robot.as_front, 0.0)
    to_the_front = max(robot.as_rear - slowest * (target.front_1 + slowest * target.front_2), 0.0)
    x, y, sideways = p_x + robot.x, p_y + robot.y, game.other_sideways * most
    return Gaps(
        ahead=x - most - target.length - from_behind,
        behind=least - x - target.length - to_the_front,
        beside=-target.length - max(from_behind, to_the_front),
        place=1 if x > most else (-1 if x < least else 0),
        left=y - sideways - robot.left,
        right=-y - sideways - robot.right,
    )


@kernel
def _lowered(gaps: Gaps, bends: np.ndarray, ahead: float) -> Gaps:
    """Return gaps less what they may bend below straight lines in a step, `bends` of a path's row and `ahead`, m."""
    return Gaps(
        gaps.ahead - ahead,
        gaps.behind - bends[BEND_BEHIND],
        gaps.beside - max(ahead, bends[BEND_BEHIND]),
        gaps.place,
        gaps.left - bends[BEND_LEFT],
        gaps.right - bends[BEND_RIGHT],
    )


@kernel
def _along(before: Gaps, after: Gaps) -> tuple[float, float]:
    """Return the gap along the road at both ends of a step, of the place where the robot is at one of them at least.

    What is said of another place than its own is too low as soon as the robot has left its own.
    """
    if before.place == 0 and after.place == 0:
        return before.beside, after.beside
    if before.place + after.place >= 0:
        return before.ahead, after.ahead
    return before.behind, after.behind


@kernel
def _worst_of_step(
    before: Gaps, after: Gaps, bends: np.ndarray, ahead: float, left: float, right: float
) -> tuple[float, float]:
    """Return the least of either side so far, `left` and `right`, m, with a step that ends at a row of a path."""
    low_before, low_after = _lowered(before, bends, ahead), _lowered(after, bends, ahead)
    along = _along(low_before, low_after)
    left = least_of_step(along, (low_before.left, low_after.left), left)
    right = least_of_step(along, (low_before.right, low_after.right), right)
    if after.place == 0:
        left = min(left, max(after.beside, 4.0 * after.left**3))
        right = min(right, max(after.beside, 4.0 * after.right**3))
    return left, right


@kernel
def guaranteed(game: Game, path: np.ndarray, first: int, other: Other, p_x: float, p_y: float, floor: float) -> float:
    """Return what a path guarantees against one other car, m: the least of V(0, ·), bodies turned, that it can force.

    Args:
        game: of the manoeuvres.
        path: (instants, COLUMNS) of `write_path`.
        first: the instant from which on it counts.
        other: the other car.
        p_x, p_y: m, robot − other, at the beginning.
        floor: m; once nothing above it is possible, the search is given up and what was found so far is returned.
    """
    if game.other.responsible:
        return guaranteed_by_duties(game, path, first, other.speed, p_x, p_y, floor)
    before = _gaps(game, other, path[first, TIME], p_x, p_y, _place_at(path[first]))
    # Where a gap ceases to shrink as fast: ahead of the other car at its top speed, and behind it where it stops, if
    # the distance shrinks in proportion to its speed.
    until_stop = other.until_stop if game.target.front_1 > 0.0 else math.inf
    kinks = (min(until_stop, other.until_top), max(until_stop, other.until_top))
    along, _ = _along(before, before)
    left, right = max(along, 4.0 * before.left**3), max(along, 4.0 * before.right**3)
    for instant in range(first + 1, len(path)):
        last, row = path[instant - 1], path[instant]
        bend_ahead = row[BEND_AHEAD] if row[TIME] <= other.until_top else row[BEND_AHEAD_OF_FASTEST]
        for at in kinks:
            if last[TIME] < at < row[TIME]:  # an instant of its own, the robot's gaps where they are at least
                share = (at - last[TIME]) / (row[TIME] - last[TIME])
                between = _lowered(_gaps(game, other, at, p_x, p_y, _place_between(last, row, share)), row, bend_ahead)
                left, right = _worst_of_step(before, between, row, bend_ahead, left, right)
                before = between
        after = _gaps(game, other, row[TIME], p_x, p_y, _place_at(row))
        left, right = _worst_of_step(before, after, row, bend_ahead, left, right)
        if max(left, right) <= floor:
            break
        before = after
    return max(left, right)


@kernel
def highest_guarantee(game: Game) -> float:
    """Return what no manoeuvre guarantees more than, m; +inf where there is no such bound."""
    return level_of_duties(game.target, game.other) if game.other.responsible else math.inf


@kernel
def best_guarantee(
    manoeuvres: Manoeuvres, start: Start, paths: Paths, other: Other, p_x: float, p_y: float, enough: float
) -> float:
    """Return what the best manoeuvre guarantees against one car, or the first that is `enough`, m."""
    best = -math.inf
    for which in range(len(manoeuvres.heading)):
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
