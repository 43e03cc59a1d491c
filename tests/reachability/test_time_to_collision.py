import numpy as np
import pytest
from fine_simulation import near_by_simulation
from test_manoeuvres import brute_force, only, others_inputs

from hj_cosim.errors import TableError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.highway.manoeuvres import lower_bounds, manoeuvres_of
from hj_cosim.reachability.games.highway.target import TargetFormula, target_and_gradient_at, target_at
from hj_cosim.reachability.table.store import find_specification, read_specification, solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import TableSpecification

TIME, GAP = 3.0, 2.0  # s, m; the game's defaults


@pytest.fixture(scope="module")
def formula() -> TargetFormula:
    return TargetFormula.of_game(find_game("highway_ttc").parameters)


@pytest.fixture(scope="module")
def specification(highway_small: TableSpecification) -> TableSpecification:
    return highway_small.model_copy(update={"dynamics": "highway_ttc"})


@pytest.fixture(scope="module")
def table(specification: TableSpecification) -> ValueTable:
    return solve_table(specification)


def drawn(count: int, seed: int) -> np.ndarray:
    low, high = [-120.0, -7.0, -0.35, 0.0, 0.0], [120.0, 7.0, 0.35, 40.0, 40.0]
    return np.random.default_rng(seed).uniform(low, high, (count, 5))


def test_along_the_road_it_is_the_least_of_the_gap_now_and_of_what_is_left_of_it_in_three_seconds(formula):
    for p_x, _, _, v_r, v_o in drawn(500, 0):
        rear, front = (0.0, abs(p_x)), (v_r, v_o) if p_x < 0.0 else (v_o, v_r)
        gap = rear[1] - rear[0] - 5.0
        later = (rear[1] + front[1] * TIME) - (rear[0] + front[0] * TIME) - 5.0  # nobody changes speed
        least = min(gap, later - GAP)
        if least > -30.0:  # below, the term across is the greater one
            assert target_at(formula, p_x, 0.0, 0.0, v_r, v_o) == pytest.approx(least, abs=1e-9)


def test_at_equal_speeds_it_asks_for_the_same_gap_however_fast_both_are(formula):
    assert [target_at(formula, -20.0, 0.0, 0.0, speed, speed) for speed in (5.0, 40.0)] == [13.0, 13.0]


def test_beside_it_is_the_highway_games_own(formula):
    by_rss = TargetFormula.of_game(find_game("highway").parameters)
    for _, p_y, theta, v_r, v_o in drawn(300, 1):
        # Bodies that overlap along the road: the lateral term is all there is, wherever it is not far below 0.
        here, there = (target_at(each, 0.0, p_y, theta, v_r, v_o) for each in (formula, by_rss))
        if min(here, there) > -5.0:
            assert here == there


def test_the_formula_is_the_solvers_target():
    game, states = find_game("highway_ttc"), drawn(3000, 2).astype(np.float32).astype(np.float64)
    for parameters in ({}, {"time_to_collision": 1.5, "gap_at_collision": 0.0}, {"turned_length": 4.0}):
        of = TargetFormula.of_game({**game.parameters, **parameters})
        expected = game.target_values(states, game.parameter_values(parameters, "the test"))
        assert [target_at(of, *state) for state in states] == pytest.approx(expected, rel=1e-5, abs=1e-3)


def test_its_gradient_is_the_slope_of_it(formula):
    step, checked = 1e-5, 0
    for state in drawn(600, 3):
        slopes, kink = [], False
        for axis in range(5):
            ahead, behind = state.copy(), state.copy()
            ahead[axis] += step
            behind[axis] -= step
            here, up, down = (target_at(formula, *each) for each in (state, ahead, behind))
            slopes.append((up - down) / (2.0 * step))
            kink |= abs(up + down - 2.0 * here) > 1e-6 * (1.0 + abs(here))
        if not kink:
            checked += 1
            found = target_and_gradient_at(formula, *state)
            assert list(found)[1:] == pytest.approx(slopes, rel=1e-4, abs=1e-3)
    assert checked > 500


def test_its_slopes_by_the_speeds_are_the_time_at_most(formula):
    along = [target_and_gradient_at(formula, p_x, 0.0, 0.0, v_r, v_o) for p_x, _, _, v_r, v_o in drawn(500, 4)]
    along = [term for term in along if term.value > -30.0]
    assert max(max(abs(term.by_r), abs(term.by_o)) for term in along) == TIME


def test_v_is_nowhere_above_v0_and_falls_with_the_horizon(specification, table):
    shorter = solve_table(specification.model_copy(update={"horizon": 1.0}))
    states = table.draw_states(4000, np.random.default_rng(5))
    v0 = table.target_values(states)
    assert (shorter.value(states) <= v0 + 1e-3).all()
    assert (table.value(states) <= shorter.value(states) + 1e-3).all()
    assert np.mean(table.value(states) < v0 - 0.5) > 0.05  # a lead car's braking does cost something


def test_no_other_car_gets_below_what_a_manoeuvre_guarantees(table):
    manoeuvres, generator = table.manoeuvres(), np.random.default_rng(6)
    states = table.draw_states(2000, generator)
    for which in (0, 1, 2, 3, 13):
        bounds = lower_bounds(only(manoeuvres, which), states)
        near = np.abs(bounds) < 5.0
        assert near.sum() > 20
        heading, acceleration = manoeuvres.heading[which], manoeuvres.acceleration[which]
        inputs = others_inputs(generator, int(near.sum()))
        least = brute_force(table, states[near], heading, acceleration, inputs)
        assert (least - bounds[near]).min() >= -0.03


@pytest.mark.parametrize("which", [6, 7])  # to the left, braking and not
def test_a_bound_is_never_above_a_fine_simulation_and_hardly_below_it(table, which):
    manoeuvres, generator = table.manoeuvres(), np.random.default_rng(7 + which)
    # The other car, ahead and slow, comes to a stop while the robot passes: there its distance ceases to grow.
    low, high = [-60.0, -3.0, -0.2, 5.0, 1.0], [-10.0, 5.0, 0.2, 20.0, 12.0]
    states = np.concatenate([generator.uniform(low, high, (6000, 5)), table.draw_states(2000, generator)])
    bounds = lower_bounds(only(manoeuvres, which), states)
    heading, acceleration = manoeuvres.heading[which], manoeuvres.acceleration[which]
    near, simulated = near_by_simulation(table.parameters, states, heading, acceleration)
    excess = bounds[near] - simulated
    assert len(excess) > 200
    assert excess.max() < 0.002  # what the simulation is wrong by
    assert np.median(excess) > -0.25
    assert np.quantile(excess, 0.02) > -0.4


def test_duties_keep_no_time_to_collision(table):
    with pytest.raises(TableError, match="braking keeps RSS's gaps, and no time to collision"):
        manoeuvres_of({**table.parameters, "responsible": 1.0}, table.grid)


def test_the_specification_that_comes_with_the_package_holds_all_that_it_calls_unsafe(formula):
    found = read_specification(find_specification("highway_ttc"))
    assert (found.parameters["time_to_collision"], found.parameters["gap_at_collision"]) == (TIME, GAP)
    for x in (found.grid.lower[0], found.grid.upper[0]):
        fast, slow = found.grid.upper[3], found.grid.lower[3]
        speeds = (fast, slow) if x < 0.0 else (slow, fast)
        assert target_at(formula, x, 0.0, 0.0, *speeds) > 0.0
        assert abs(x) > 5.0 + fast**2 / 12.0  # what it takes to stop
