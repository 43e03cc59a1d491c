"""What a row is about besides V: what may be kept instead, where V(0, .) bends from one distance to the other."""

import numpy as np
import pytest

from hj_cosim.control.spc.approach import NOT_NEEDED, begun_row
from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.games.highway.rows import value_of_lesser_term, write_row
from hj_cosim.reachability.games.highway.target import terms_at
from hj_cosim.reachability.table.lookup import smooth_gradient_at, value_and_gradient_at
from hj_cosim.reachability.table.table import ValueTable

BOX = np.array([-0.13, 0.13, -6.0, 4.0])


def states_in(table: ValueTable, seed: int, count: int) -> np.ndarray:
    states = table.draw_states(count, np.random.default_rng(seed))
    return states[table.value(states) > 0.5]


def lesser(table: ValueTable, state: np.ndarray) -> float:
    gradient = np.empty(5)
    value = value_and_gradient_at(*table.arrays, *state, gradient)
    return value_of_lesser_term(table.arrays.grid.target, state, value, gradient)


def test_what_may_be_kept_instead_of_v_is_nowhere_above_it_and_is_v_where_v_bends(small_table: ValueTable) -> None:
    bends = 0
    for state in states_in(small_table, 1, 1000):
        assert lesser(small_table, state) <= small_table.value(state[None])[0] + 1e-9
        terms = terms_at(small_table.arrays.grid.target, state[0], 7.0, 0.0, state[3], state[4])
        along = next(term.value for term in terms if term.by_x != 0.0)
        if along > 1.0:  # beside it at the distance at which the cubic is as much
            state[1], state[2] = 2.0 + 0.1225 + np.cbrt(along / 4.0), 0.0
            assert lesser(small_table, state) == pytest.approx(small_table.value(state[None])[0], rel=1e-2, abs=1e-2)
            bends += 1
    assert bends > 50


def test_its_gradient_is_its_slope(small_table: ValueTable) -> None:
    agreed = []
    for state in states_in(small_table, 2, 400):
        gradient = np.empty(5)
        value = value_and_gradient_at(*small_table.arrays, *state, gradient)
        value_of_lesser_term(small_table.arrays.grid.target, state, value, gradient)
        for axis, step in enumerate((1e-3, 1e-4, 1e-5, 1e-4, 1e-4)):
            shift = step * np.eye(5)[axis]
            rise = (lesser(small_table, state + shift) - lesser(small_table, state - shift)) / (2.0 * step)
            agreed.append(abs(rise - gradient[axis]) <= 0.02 * abs(rise) + 0.5)
    assert np.mean(agreed) > 0.95  # but for kinks between cells and where the terms change places


def test_smooth_slopes_do_not_jump_between_cells_and_v_is_the_same(small_table: ValueTable) -> None:
    plain, smooth = np.empty((2, 5)), np.empty((2, 5))
    node = small_table.grid.axes[2][len(small_table.grid.axes[2]) // 2 + 1]  # of the heading, beside the middle
    jumps = []
    for state in states_in(small_table, 3, 1500):
        for side, heading in enumerate((node - 1e-7, node + 1e-7)):
            at = (state[0], state[1], heading, state[3], state[4])
            value = value_and_gradient_at(*small_table.arrays, *at, plain[side])
            assert smooth_gradient_at(*small_table.arrays, *at, smooth[side]) == pytest.approx(value, abs=1e-4)
        jumps.append((abs(plain[1, 2] - plain[0, 2]), abs(smooth[1, 2] - smooth[0, 2])))
    plainly, smoothly = np.quantile(jumps, 0.95, axis=0)
    assert plainly > 20.0
    assert smoothly < 0.01 * plainly


def test_where_v_is_v_0_all_around_smooth_slopes_are_its_own(small_table: ValueTable) -> None:
    for state in states_in(small_table, 4, 500):
        plain, smooth = np.empty(5), np.empty(5)
        value_and_gradient_at(*small_table.arrays, *state, plain)
        smooth_gradient_at(*small_table.arrays, *state, smooth)
        around = [state + 1.5 * sign * np.diag(small_table.grid.spacing)[axis] for axis in range(5) for sign in (-1, 1)]
        if all(small_table.value(np.array(around)) == small_table.target_values(np.array(around))):
            assert smooth == pytest.approx(plain)


def test_a_row_gives_way_to_the_other_distance_as_long_as_that_is_above_epsilon() -> None:
    # V falls by 100 m/s in the row of V itself; the other distance is sure to be kept.
    row = np.array([20.0, -1.0, 0.0, -300.0, 18.0, 0.0, 0.0, 0.0])
    assert begun_row(row.copy(), 0.5, 0.0, 4.0, BOX, 0.0, 0.0) == NOT_NEEDED
    low = row.copy()
    low[4] = 0.4  # not above epsilon: V itself has to be kept
    assert begun_row(low, 0.5, 0.0, 4.0, BOX, 0.0, 0.0) == 0
    in_k = row.copy()
    in_k[0] = 0.5
    assert begun_row(in_k, 0.5, 0.0, 4.0, BOX, 0.0, 0.0) == 0


def test_of_two_that_can_be_missed_the_one_is_kept_that_the_desired_control_meets() -> None:
    steering, braking = [20.0, 1000.0, 0.0, -200.0], [18.0, 0.0, -40.0, -200.0]
    row = np.array([*steering, *braking])
    assert begun_row(row.copy(), 0.5, 0.0, 4.0, BOX, 0.1, 4.0) == 0
    assert begun_row(row.copy(), 0.5, 0.0, 4.0, BOX, -0.1, -6.0) == 4


def test_written_rows_are_about_v_first(small_table: ValueTable) -> None:
    other, row = Disturbance.of_game(small_table.parameters), np.empty(8)
    state = np.array([-40.0, 3.9, 0.0, 25.0, 22.0])
    value, gradient = small_table.value_and_gradient(state[None])
    write_row(small_table.arrays.grid.target, other, state, value[0], gradient[0], row)
    assert row[:3] == pytest.approx([value[0], *gradient[0, 2:4]])
    assert row[4] == pytest.approx(lesser(small_table, state))
