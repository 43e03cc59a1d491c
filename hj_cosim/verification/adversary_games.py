"""The adversary's search, one game after the other: the jitted part of `adversary`.

A game is filtered by SPC and keeps an escape as the guarantee's rollouts do (`filter_games`). What the adversary
chooses goes from −1 to 1 and is mapped to what the game grants in the state that it meets (`allowed`), so that limits
that depend on the state need no other search.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.control.problem.enumeration import least_cost_control
from hj_cosim.control.problem.safety_problem import available_controls
from hj_cosim.control.spc.approach import NOT_NEEDED, begun_row
from hj_cosim.control.spc.escape import NO_ESCAPE, NO_MANOEUVRE, is_to_be_looked_at, keep_escape
from hj_cosim.control.spc.evasion import NO_SHIFT
from hj_cosim.reachability.games.highway.other_car import allowed
from hj_cosim.reachability.games.highway.rows import write_row
from hj_cosim.reachability.games.highway.target import target_at
from hj_cosim.reachability.table.lookup import smooth_gradient_at, value_and_gradient_at
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for
from hj_cosim.verification.bodies import bodies_overlap
from hj_cosim.verification.evasion_games import evaded
from hj_cosim.verification.game import Game, game_step, gripped

CRUISE, FULL_THROTTLE, STEERING_AT_THE_CAR, WITHIN_TRACKING, CHOSEN = 0, 1, 2, 3, 4  # desired controls
INPUTS = 4  # θ_o, a_o, and of the desired control what turns and what accelerates
# The tracker's range: it turns towards a heading within this many rad, and follows a speed this many m/s away.
_TRACKED_HEADING, _TRACKED_SPEED = 0.3, 4.0
_K_ACCELERATION = 1.67  # 1/s, K_2 of the tracker
# Of the range −1 to 1: the deviation to begin with, and what is left of it at least.
_DEVIATION, _LEAST_DEVIATION = 1.0, 0.3
_SMOOTHING = 0.7  # how far mean and deviation move to the elite's; those that jump there miss all but the next minimum
_AFRESH = 4  # of so many sequences one is drawn as in the beginning, lest all go for the first minimum
_COLLISION = 100.0  # m, by which an adversary prefers a collision


class Search(NamedTuple):
    """How to search, as the kernel takes it."""

    desired: int
    samples: int
    segments: int
    population: int
    elite: int
    generations: int
    bicycle: bool


class Outcome(NamedTuple):
    """What a rollout came to."""

    least_target: float  # m, of V(0, ·)
    least_value: float  # m, of V as looked up
    collided: bool
    without_escape: bool  # at some instant no manoeuvre escaped


@njit(cache=True)
def _between(share: float, low: float, high: float) -> float:
    """Return what a choice from −1 to 1 means between two limits."""
    return low + 0.5 * (min(max(share, -1.0), 1.0) + 1.0) * (high - low)


@njit(cache=True)
def _desired_control(
    game: Game, desired: int, robot: np.ndarray, car: np.ndarray, cruising: float, choice: np.ndarray
) -> tuple[float, float]:
    """Return (ω, a) that the filter is asked for; `choice` is what the adversary has chosen, (4,)."""
    limits, heading = game.limits, 0.0
    acceleration = _K_ACCELERATION * (cruising - robot[3])
    if desired == CHOSEN:
        return _between(choice[2], limits[0], limits[1]), _between(choice[3], limits[2], limits[3])
    if desired == FULL_THROTTLE:
        acceleration = limits[3]
    elif desired == STEERING_AT_THE_CAR:
        heading = math.copysign(_TRACKED_HEADING, car[1] - robot[1])
    elif desired == WITHIN_TRACKING:
        heading = _TRACKED_HEADING * min(max(choice[2], -1.0), 1.0)
        acceleration = _K_ACCELERATION * _TRACKED_SPEED * min(max(choice[3], -1.0), 1.0)
    omega = min(max(game.k_theta * (heading - robot[2]), limits[0]), limits[1])
    return omega, min(max(acceleration, limits[2]), limits[3])


@njit(cache=True)
def _filtered(
    game: Game,
    robot: np.ndarray,
    car: np.ndarray,
    asked: tuple[float, float],
    previous_omega: float,
    driven: int,
    gradient: np.ndarray,
) -> tuple[float, float, float, int, bool]:
    """Return what SPC makes of the control asked for, ω and a; V; the manoeuvre driven; whether none escapes."""
    p_x, p_y = robot[0] - car[0], robot[1] - car[1]
    value = value_and_gradient_at(game.table.flat, game.table.grid, p_x, p_y, robot[2], robot[3], car[2], gradient)
    limits = gripped(game.limits, robot[3], game.sideways)
    box = available_controls(limits, robot[2], robot[3], game.bounds, game.step)
    omega, acceleration = min(max(asked[0], box[0]), box[1]), min(max(asked[1], box[2]), box[3])
    in_k = value <= game.epsilon
    if in_k or (game.approach > 0.0 and value < math.inf):
        state = np.array([p_x, p_y, robot[2], robot[3], car[2]])
        row = np.empty(8)
        if game.smooth:
            smooth_gradient_at(game.table.flat, game.table.grid, p_x, p_y, robot[2], robot[3], car[2], gradient)
        write_row(game.table.grid.target, game.other, state, value, gradient, row)
        begins = begun_row(row, game.epsilon, game.recovery, game.approach, box, omega, acceleration)
        if begins != NOT_NEEDED:
            p, q, c = row[begins + 1 : begins + 2], row[begins + 2 : begins + 3], row[begins + 3 : begins + 4]
            wanted = previous_omega if game.slack_is_free else omega
            omega, acceleration, _ = least_cost_control(
                p, q, c, wanted, acceleration, game.weights, game.slack_is_free, box
            )
    without = False
    if len(game.manoeuvres.heading) > 0 and is_to_be_looked_at(game.extent, value, p_x, p_y, robot[3], car[2]):
        others, minded = car.copy().reshape(1, 3), np.array([in_k])
        omega, acceleration, verdict, driven = keep_escape(
            game.manoeuvres, robot, others, minded, omega, acceleration, game.step, driven
        )
        omega, acceleration = min(max(omega, box[0]), box[1]), min(max(acceleration, box[2]), box[3])
        without = verdict == NO_ESCAPE
    else:
        driven = NO_MANOEUVRE
    return omega, acceleration, value, driven, without


@njit(cache=True)
def roll_out_choices(game: Game, search: Search, start: np.ndarray, choices: np.ndarray) -> Outcome:
    """Simulate one game in which the adversary's choices are known.

    Args:
        game: what does not change.
        search: the desired control, how long, and how the robot moves.
        start: (5,) relative state.
        choices: (segments, 4) from −1 to 1: of θ_o, a_o, and of the desired control, if that is searched for.
    """
    robot, car = np.array([0.0, 0.0, start[2], start[3]]), np.array([-start[0], -start[1], start[4]])
    cruising, previous_omega = start[3], 0.0
    driven = np.int64(NO_MANOEUVRE)  # for a constant `_filtered` would be compiled once more
    least_target = least_value = math.inf
    collided, without_escape, gradient = False, False, np.empty(5)
    inputs, evading = np.zeros((1, 2)), NO_SHIFT  # at first it goes straight on
    for sample in range(search.samples + 1):
        p_x, p_y = robot[0] - car[0], robot[1] - car[1]
        least_target = min(least_target, target_at(game.table.grid.target, p_x, p_y, robot[2], robot[3], car[2]))
        collided |= bodies_overlap(p_x, p_y, robot[2], game.bodies)
        choice = choices[min(sample * search.segments // search.samples, search.segments - 1)]
        asked = _desired_control(game, search.desired, robot, car, cruising, choice)
        omega, acceleration, value, driven, without = _filtered(
            game, robot, car, asked, previous_omega, driven, gradient
        )
        least_value = min(least_value, value)
        without_escape |= without
        if sample == search.samples or collided:
            break
        if game.evades:
            asked, others = (omega, acceleration), car.copy().reshape(1, 3)
            omega, acceleration, evading = evaded(game, robot, others, inputs, asked, not without, evading)
            if not math.isnan(evading.lateral):
                driven = np.int64(NO_MANOEUVRE)
        previous_omega = omega
        may = allowed(game.other, p_x, p_y, robot[3] * math.sin(robot[2]), robot[3], car[2])
        heading, gain = math.asin(_between(choice[0], may.right, may.left)), _between(choice[1], may.least, may.most)
        inputs[0, 0], inputs[0, 1] = heading, gain
        end = min(max(car[2] + gain * game.step, 0.0), game.other_speed_max)
        driven_way = 0.5 * (car[2] + end) * game.step
        car[0] += driven_way * math.cos(heading)
        car[1] += driven_way * math.sin(heading)
        car[2] = end
        if search.bicycle:
            steering = steering_for(omega, robot[3], game.wheelbase)
            moved = bicycle_step(robot, steering, acceleration, game.wheelbase, game.bounds[3], game.step)
            for axis in range(4):  # `robot[:] = moved` would take 2 s more to compile
                robot[axis] = moved[axis]
        else:
            game_step(robot, omega, acceleration, game.bounds[3], game.step)
    return Outcome(least_target, least_value, collided, without_escape)


@njit(cache=True, nogil=True)
def _search_game(game: Game, search: Search, start: np.ndarray, normals: np.ndarray, found: np.ndarray) -> None:
    shape = (search.segments, INPUTS)
    mean, deviation = np.zeros(shape), np.full(shape, _DEVIATION)
    choices, scores = np.empty((search.population, *shape)), np.empty(search.population)
    found[0], found[1], found[2], found[3] = math.inf, math.inf, 0.0, 0.0
    for generation in range(search.generations):
        for one in range(search.population):
            afresh = one % _AFRESH == 0
            for segment in range(search.segments):
                for which in range(INPUTS):
                    if afresh:
                        drawn = _DEVIATION * normals[generation, one, segment, which]
                    else:
                        drawn = (
                            mean[segment, which] + deviation[segment, which] * normals[generation, one, segment, which]
                        )
                    choices[one, segment, which] = min(max(drawn, -1.0), 1.0)
            outcome = roll_out_choices(game, search, start, choices[one])
            # V as well, for V(0, ·) is often least at the start and says nothing then.
            scores[one] = outcome.least_target + outcome.least_value - (_COLLISION if outcome.collided else 0.0)
            found[0], found[1] = min(found[0], outcome.least_target), min(found[1], outcome.least_value)
            found[2] = max(found[2], 1.0 if outcome.collided else 0.0)
            found[3] = max(found[3], 1.0 if outcome.without_escape else 0.0)
        elite = np.argsort(scores)[: search.elite]
        for segment in range(search.segments):
            for which in range(INPUTS):
                values = choices[elite, segment, which]
                mean[segment, which] += _SMOOTHING * (values.mean() - mean[segment, which])
                spread = deviation[segment, which] + _SMOOTHING * (values.std() - deviation[segment, which])
                deviation[segment, which] = max(spread, _LEAST_DEVIATION)


def search_games(game: Game, search: Search, starts: np.ndarray, normals: np.ndarray, found: np.ndarray) -> None:
    """Search for the worst of each game, by the cross-entropy method. Python calls them: each takes a while.

    Args:
        game, search: what does not change.
        starts: (n, 5) relative states.
        normals: (n, generations, population, segments, 4), drawn from the standard normal distribution.
        found: (n, 4), written: the least V(0, ·) and the least V of all rollouts, m; 1 if one collided; 1 if in one
            no manoeuvre escaped at some instant.
    """
    for i in range(len(starts)):
        _search_game(game, search, starts[i], normals[i], found[i])
