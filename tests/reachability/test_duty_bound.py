"""Straightening up and braking among cars that do their duties, against cars that are simulated and try to hurt."""

import math

import numpy as np
import pytest
from numba import njit

from hj_cosim.errors import TableError
from hj_cosim.reachability.games.highway.duty_bound import level_of_duties
from hj_cosim.reachability.games.highway.manoeuvre_cap import raised
from hj_cosim.reachability.games.highway.manoeuvres import highest_guarantee, lower_bounds, manoeuvres_of
from hj_cosim.reachability.games.highway.other_car import Disturbance, allowed
from hj_cosim.reachability.games.highway.parameters import PARAMETERS
from hj_cosim.reachability.games.highway.target import TargetFormula, target_at
from hj_cosim.reachability.grid import Grid

PARAMETERS_OF_DUTIES = {**PARAMETERS, "responsible": 1.0, "lateral_acceleration_max": 4.0, "turned_length": 5.0}
GRID = Grid((-145.0, -8.0, -0.4, 0.0, 0.0), (200.0, 8.0, 0.4, 40.0, 40.0), (5, 5, 5, 5, 5), ("linear",) * 5)
STEP, SAMPLES, HOLD = 0.01, 600, 40
TARGET, DUTIFUL = TargetFormula.of_game(PARAMETERS_OF_DUTIES), Disturbance.of_game(PARAMETERS_OF_DUTIES)


@pytest.fixture(scope="module")
def manoeuvres():
    return manoeuvres_of(PARAMETERS_OF_DUTIES, GRID)


@njit
def least_target(
    state: np.ndarray, held: float, choices: np.ndarray, target: TargetFormula, other: Disturbance
) -> float:
    """Return the least V(0, .) of a game: the robot straightens up at `held` m/s², then brakes; the other car chooses.

    Args:
        state: (5,) p_x, p_y, θ, v_r, v_o.
        held: m/s².
        choices: (holds, 2) from −1 to 1, of what the other car is allowed to steer and to accelerate.
    """
    x, y, theta, v, v_o = state
    least = math.inf
    for sample in range(SAMPLES):
        least = min(least, target_at(target, x, y, theta, v, v_o))
        may = allowed(other, x, y, v * math.sin(theta), v, v_o)
        steer, gain = choices[sample // HOLD]
        heading = math.asin(may.right + 0.5 * (steer + 1.0) * (may.left - may.right))
        acceleration = may.least + 0.5 * (gain + 1.0) * (may.most - may.least)
        turn = min(0.3, 4.0 / max(v, v + held * STEP, 1e-3)) * STEP
        turned = theta - min(max(theta, -turn), turn)
        faster = min(max(v + (held if theta != 0.0 else -6.0) * STEP, 0.0), 40.0)
        others = min(max(v_o + acceleration * STEP, 0.0), 40.0)
        driven, middle, way = 0.5 * (v + faster) * STEP, 0.5 * (theta + turned), 0.5 * (v_o + others) * STEP
        x += driven * math.cos(middle) - way * math.cos(heading)
        y += driven * math.sin(middle) - way * math.sin(heading)
        theta, v, v_o = turned, faster, others
    return least


def states_near(generator: np.random.Generator, count: int) -> np.ndarray:
    low, high = [-60.0, -6.0, -0.25, 3.0, 3.0], [60.0, 6.0, 0.25, 38.0, 38.0]
    return generator.uniform(low, high, (count, 5))


def test_no_car_that_does_its_duties_gets_below_what_straightening_up_and_braking_guarantees(manoeuvres) -> None:
    generator = np.random.default_rng(1)
    states = states_near(generator, 2000)
    states[:700, 2] *= 0.1  # as on the road
    looked_at = gained = 0
    for which, held in enumerate(manoeuvres.acceleration):
        one = manoeuvres._replace(heading=manoeuvres.heading[which : which + 1], acceleration=np.array([held]))
        bounds = lower_bounds(one, states)
        for state, bound in zip(states, bounds, strict=True):
            if bound <= 0.0:
                continue
            choices = generator.choice([-1.0, 1.0, 0.0], (12, SAMPLES // HOLD, 2))
            choices[0], choices[1] = (math.copysign(1.0, state[1]), 1.0), (math.copysign(1.0, state[1]), -1.0)
            least = min(least_target(state, held, choice, TARGET, DUTIFUL) for choice in choices)
            # Braking from the beginning it is a bound; else the other car may cut in as the robot is not yet braking.
            assert least > bound - (0.02 if held < 0.0 else 0.4), (state, held, bound, least)
            looked_at += 1
            gained += least < bound + 1.0
    assert looked_at > 1000
    assert gained > 100  # the bound is near what can be forced


def test_a_straight_robot_has_an_escape_wherever_rss_s_distances_are_kept(manoeuvres) -> None:
    states = states_near(np.random.default_rng(2), 5000)
    states[:, 2] = 0.0
    targets = np.array([target_at(TARGET, *state) for state in states])
    level = highest_guarantee(manoeuvres.game)
    assert lower_bounds(manoeuvres, states) == pytest.approx(np.minimum(targets, level))


def test_who_moves_towards_a_lane_is_not_let_in_by_those_behind(manoeuvres) -> None:
    keeping, moving = [25.0, 2.4, 0.0, 24.0, 27.0], [25.0, 2.4, -0.12, 24.0, 27.0]
    bounds = lower_bounds(manoeuvres, np.array([keeping, moving]))
    assert bounds[1] < bounds[0]


def test_the_level_is_the_side_margin_or_the_standing_gap_whichever_leaves_less() -> None:
    assert level_of_duties(TARGET, DUTIFUL) == 2.0
    closer = DUTIFUL._replace(side_margin=0.5)
    assert level_of_duties(TARGET, closer) == pytest.approx(4.0 * (0.5 - 0.1225) ** 3, rel=1e-6)


def test_a_robot_that_brakes_less_than_v_counts_on_has_no_such_escape() -> None:
    with pytest.raises(TableError, match=r"a robot that brakes with 4 m/s².*counts on 6 m/s².*keep_escape=false"):
        manoeuvres_of({**PARAMETERS_OF_DUTIES, "acceleration_min": -4.0}, GRID)


def test_a_cap_opens_towards_the_level_and_leaves_what_is_lost_as_it_is() -> None:
    assert raised(-3.0, 2.0) == -3.0
    assert raised(2.0, 2.0) == raised(5.0, 2.0) == math.inf
    caps = [raised(share, 2.0) for share in (0.1, 0.5, 1.0, 1.5, 1.9)]
    assert caps == sorted(caps)
    assert all(cap > share for cap, share in zip(caps, (0.1, 0.5, 1.0, 1.5, 1.9), strict=True))
    assert raised(1.5, math.inf) == 1.5
