import dataclasses

import numpy as np
import pytest
from filter_in_loop import FilterInLoop
from fine_simulation import guaranteed_by_simulation

from hj_cosim.control.spc.escape import (
    ESCAPING,
    NO_ESCAPE,
    NO_MANOEUVRE,
    PASSED,
    can_escape,
    keep_escape,
    manoeuvres_for,
)
from hj_cosim.control.spc.filter import ESCAPED, HAD_NO_ESCAPE
from hj_cosim.errors import TableError
from hj_cosim.reachability.games.highway.manoeuvres import lower_bounds
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.verification.guarantee import RolloutSettings, measure_guarantee

ROBOT, STEP = RobotSettings(), 0.02
FULL_SPEED = (0.0, 4.0)  # ω, a


@pytest.fixture(scope="module")
def manoeuvres(table):
    return manoeuvres_for(table, ROBOT)


def kept(manoeuvres, robot, others, control=FULL_SPEED, in_k=True, driven=NO_MANOEUVRE):
    """Return ω, a, the verdict and the manoeuvre."""
    others, robot = np.array(others, float).reshape(-1, 3), np.array(robot, float)
    return keep_escape(manoeuvres, robot, others, np.full(len(others), in_k), *control, STEP, driven)


def distance_behind(table, margin):
    """Return how far behind a car at 22 m/s a robot at 25 m/s has V(0, ·) = margin."""
    state = np.array([[-100.0, 0.0, 0.0, 25.0, 22.0]])
    return 100.0 - float(table.target_values(state)[0]) + margin


@pytest.mark.parametrize("in_k", [True, False])
def test_a_control_passes_as_long_as_braking_afterwards_is_in_time(table, manoeuvres, in_k):
    far, near = distance_behind(table, 1.2), distance_behind(table, 0.05)
    assert kept(manoeuvres, [0.0, 0.0, 0.0, 25.0], [[far, 0.0, 22.0]], in_k=in_k) == (*FULL_SPEED, PASSED, NO_MANOEUVRE)
    assert kept(manoeuvres, [0.0, 0.0, 0.0, 25.0], [[near, 0.0, 22.0]], in_k=in_k)[2] == ESCAPING


def test_an_escape_is_a_manoeuvre_s_own_control(table, manoeuvres):
    # A car to the left, so close that the robot may no longer turn towards it.
    omega, acceleration, verdict, driven = kept(
        manoeuvres, [0.0, 0.0, 0.0, 25.0], [[0.0, 3.0, 25.0]], control=(0.3, 4.0)
    )
    assert verdict == ESCAPING
    assert omega == -0.3
    assert acceleration == manoeuvres.acceleration[driven]


def test_no_car_is_no_reason_to_escape(manoeuvres):
    assert kept(manoeuvres, [0.0, 0.0, 0.0, 25.0], []) == (*FULL_SPEED, PASSED, NO_MANOEUVRE)


BOXED_IN = [[7.0, 0.0, 20.0], [-7.0, 0.0, 30.0], [0.0, 3.0, 25.0], [0.0, -3.0, 25.0]]


def test_where_nothing_escapes_the_manoeuvre_that_guarantees_most_is_driven(table, manoeuvres):
    # A little too close behind a slower car, braking straight on loses nothing more; ahead of a faster one, driving on.
    gap = distance_behind(table, -0.5)
    omega, acceleration, verdict, _ = kept(manoeuvres, [0.0, 0.0, 0.0, 25.0], [[gap, 0.0, 22.0]])
    assert (omega, acceleration, verdict) == (0.0, ROBOT.acceleration_min, NO_ESCAPE)
    _, acceleration, verdict, _ = kept(manoeuvres, [0.0, 0.0, 0.0, 20.0], [[-14.0, 0.0, 25.0]])
    assert (acceleration, verdict) == (ROBOT.acceleration_max, NO_ESCAPE)
    assert kept(manoeuvres, [0.0, 0.0, 0.0, 25.0], BOXED_IN)[2] == NO_ESCAPE


def test_the_manoeuvre_driven_without_an_escape_is_the_best_by_simulation(table, manoeuvres):
    states = table.draw_states(30_000, np.random.default_rng(5))
    bounds = lower_bounds(manoeuvres, states)
    states = states[(bounds < -0.3) & (bounds > -3.0) & (table.target_values(states) > 0.5)][:200]
    assert len(states) == 200
    driven = []
    for p_x, p_y, heading, v_r, v_o in states:
        _, _, verdict, which = kept(manoeuvres, [0.0, 0.0, heading, v_r], [[-p_x, -p_y, v_o]])
        assert verdict == NO_ESCAPE
        driven.append(which)
    simulated = np.stack(
        [
            guaranteed_by_simulation(table.parameters, states, heading, acceleration)
            for heading, acceleration in zip(manoeuvres.heading, manoeuvres.acceleration, strict=True)
        ]
    )
    short = simulated.max(axis=0) - simulated[driven, np.arange(len(states))]
    assert np.quantile(short, 0.95) < 0.1
    assert short.max() < 1.5


def test_an_escape_is_kept_while_it_escapes_though_another_would_guarantee_more(table, manoeuvres):
    robot, car = [0.0, 0.0, 0.0, 25.0], [[distance_behind(table, 0.05), 0.0, 22.0]]
    best = kept(manoeuvres, robot, car)[3]
    escaping = [w for w in range(len(manoeuvres.heading)) if kept(manoeuvres, robot, car, driven=w)[3] == w]
    assert best in escaping
    assert 1 < len(escaping) < len(manoeuvres.heading)
    # One that does not escape is given up for the best.
    given_up = next(w for w in range(len(manoeuvres.heading)) if w not in escaping)
    assert kept(manoeuvres, robot, car, driven=given_up)[3] == best


def test_the_cars_in_k_have_to_be_escaped_from_together(table, manoeuvres):
    # From either car by itself a manoeuvre escapes after the control, from both at once none does: K decides.
    robot, coasting = [0.0, 0.0, 0.0, 25.0], (0.0, 0.0)
    ahead, behind = [distance_behind(table, 1.0), 0.0, 22.0], [-14.0, 0.0, 24.0]
    assert [kept(manoeuvres, robot, [car], coasting)[2] for car in (ahead, behind)] == [PASSED, PASSED]
    assert kept(manoeuvres, robot, [ahead, behind], coasting, in_k=False)[2] == PASSED
    assert kept(manoeuvres, robot, [ahead, behind], coasting, in_k=True)[2] != PASSED


def test_what_escapes_from_each_car_need_not_escape_from_both(table, manoeuvres):
    gap = distance_behind(table, 0.5)
    robot, ahead, behind = np.array([[0.0, 0.0, 0.0, 25.0]]), [gap, 0.0, 22.0], [-60.0, 0.0, 27.0]
    apart = [can_escape(manoeuvres, robot, np.array([[car]]))[0] for car in (ahead, behind)]
    assert apart == [True, True]  # by braking from the one, by driving on or aside from the other
    squeezed = np.array([[ahead, behind, [0.0, 3.2, 25.0], [0.0, -3.2, 25.0]]])
    assert not can_escape(manoeuvres, robot, squeezed)[0]


def test_can_escape_agrees_with_the_lower_bound_against_one_car(table, manoeuvres):
    states = table.draw_states(3000, np.random.default_rng(0))
    robots = np.column_stack([np.zeros((3000, 2)), states[:, 2:4]])
    others = np.column_stack([-states[:, 0], -states[:, 1], states[:, 4]])[:, None]
    escapes = can_escape(manoeuvres, robots, others)
    assert 0.1 < escapes.mean() < 0.9
    np.testing.assert_array_equal(escapes, lower_bounds(manoeuvres, states) > 0.0)


@pytest.mark.parametrize("desire", ["cruise", "random", "collide"])
@pytest.mark.parametrize("model", ["game", "bicycle"])
def test_who_keeps_an_escape_is_caught_only_where_there_was_none_at_the_start(table, desire, model):
    settings = RolloutSettings(rollouts=150, duration=5.0, desire=desire, model=model, seed=3)
    keeping = measure_guarantee(table, settings, FilterSettings(keep_escape=True))
    alone = measure_guarantee(table, settings)
    assert keeping.without_escape == alone.without_escape > 0  # the table here is V(0, ·) alone
    assert keeping.entered <= keeping.causes["no escape"]
    assert alone.entered > keeping.entered


def test_the_filter_counts_what_it_gave_way_to_and_holds_the_robots_limits(table, observe):
    near = distance_behind(table, 0.05)
    spc = FilterInLoop(FilterSettings(keep_escape=True), table)
    result = spc.filter(observe([0.0, 4.0, 0.0, 25.0], [[near, 4.0, 0.0, 22.0]]), Control(0.0, 4.0))
    assert result.escaping
    assert result.control.acceleration == ROBOT.acceleration_min
    assert spc.counts == {ESCAPED: 1}
    boxed_in = [[7.0, 4.0, 0.0, 20.0], [-7.0, 4.0, 0.0, 30.0], [0.0, 7.0, 0.0, 25.0], [0.0, 1.0, 0.0, 25.0]]
    assert spc.filter(observe([0.0, 4.0, 0.0, 25.0], boxed_in), Control(0.0, 4.0)).escaping
    assert spc.counts == {ESCAPED: 1, HAD_NO_ESCAPE: 1}


def test_without_it_the_filter_is_the_papers(table, observe):
    near = observe([0.0, 4.0, 0.0, 25.0], [[distance_behind(table, 0.05), 4.0, 0.0, 22.0]])
    alone = FilterInLoop(FilterSettings(), table)
    result = alone.filter(near, Control(0.0, 4.0))
    assert not result.escaping
    assert not alone.counts
    assert result.control.acceleration > ROBOT.acceleration_min


def test_a_weaker_robot_escapes_within_its_own_limits(table):
    found = manoeuvres_for(table, ROBOT.model_copy(update={"acceleration_min": -3.0}))
    assert found.acceleration.min() == -3.0
    gap = distance_behind(table, 1.0)
    assert kept(found, [0.0, 0.0, 0.0, 25.0], [[gap, 0.0, 22.0]])[2] != PASSED


def test_another_game_s_table_has_no_manoeuvres_to_keep(linear_table):
    with pytest.raises(TableError, match="no manoeuvres"):
        FilterInLoop(FilterSettings(keep_escape=True), linear_table)


@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize(("heading", "least", "most"), [(0.3999, -0.3, 0.0), (-0.3999, 0.0, 0.3), (0.5, -0.3, -0.3)])
def test_the_heading_stays_within_the_table_s_though_nobody_is_near(table, observe, keep, heading, least, most):
    spc = FilterInLoop(FilterSettings(keep_escape=keep), table)
    for desired in (-0.3, 0.3):
        result = spc.filter(observe([0.0, 4.0, heading, 25.0], []), Control(desired, 0.0))
        assert least <= result.control.omega <= most
        assert abs(heading + result.control.omega * STEP) < max(0.4, abs(heading))


@pytest.fixture(scope="module")
def dutiful(table):
    """The manoeuvres among cars that do their duties."""
    parameters = {"responsible": 1.0, "brake_min": 6.0}
    specification = table.specification.model_copy(update={"parameters": parameters})
    return manoeuvres_for(dataclasses.replace(table, specification=specification), ROBOT)


@pytest.mark.parametrize("heading", [0.0, 1e-7, -1e-7], ids=str)
def test_behind_a_car_that_cuts_in_the_robot_brakes_though_its_heading_is_rounded(dutiful, heading):
    robot, driven = [0.0, 0.0, heading, 25.0], NO_MANOEUVRE
    for _ in range(3):
        omega, acceleration, verdict, driven = kept(dutiful, robot, [[12.0, 0.5, 22.0]], driven=driven)
        assert (acceleration, verdict) == (ROBOT.acceleration_min, NO_ESCAPE)
        assert omega == pytest.approx(0.0, abs=1e-5)


def test_nobody_brakes_for_a_car_behind_that_does_not_do_its_duty(dutiful):
    robot, too_close = [0.0, 0.0, 0.0, 22.0], [-7.0, 0.0, 22.0]
    assert kept(dutiful, robot, [too_close]) == (*FULL_SPEED, PASSED, NO_MANOEUVRE)
    # Who is ahead counts all the same.
    assert kept(dutiful, robot, [too_close, [9.0, 0.0, 22.0]])[1:3] == (ROBOT.acceleration_min, NO_ESCAPE)


def test_among_the_worst_who_is_behind_counts(manoeuvres):
    assert kept(manoeuvres, [0.0, 0.0, 0.0, 22.0], [[-7.0, 0.0, 22.0]])[2] == NO_ESCAPE
