"""What a table is asked about is checked: shape, numbers, radians; of what is not finite nothing is known."""

from collections.abc import Callable

import numpy as np
import pytest
from test_value_table import a_table_of

from hj_cosim.errors import HjCosimError, StateError
from hj_cosim.reachability.table.table import ValueTable

QUESTIONS: dict[str, Callable[[ValueTable, object], object]] = {
    "value": ValueTable.value,
    "gradient": ValueTable.gradient,
    "value_and_gradient": ValueTable.value_and_gradient,
    "optimal_control": ValueTable.optimal_control,
    "optimal_disturbance": ValueTable.optimal_disturbance,
    "target_values": ValueTable.target_values,
    "in_grid": ValueTable.in_grid,
    "guaranteed": ValueTable.guaranteed,
    "extent": lambda table, states: table.extent(0, states),  # type: ignore[arg-type]
}


@pytest.fixture(scope="module")
def highway() -> ValueTable:
    return a_table_of("highway")


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("shape", [(), (0,), (3,), (7,), (5, 3), (2, 7), (5, 1), (2, 3, 5)])
def test_states_of_another_shape_are_refused_with_the_axes(
    highway: ValueTable, question: str, shape: tuple[int, ...]
) -> None:
    with pytest.raises(StateError, match="p_x, p_y, theta, v_r, v_o"):
        QUESTIONS[question](highway, np.zeros(shape))


@pytest.mark.parametrize("question", QUESTIONS)
def test_an_angle_in_degrees_is_refused_with_its_place(highway: ValueTable, question: str) -> None:
    states = np.zeros((3, 5)) if question != "extent" else np.zeros((1, 5))
    states[-1, 2] = 90.0
    with pytest.raises(StateError, match=rf"theta = 90 in state {len(states) - 1} .*radians"):
        QUESTIONS[question](highway, states if question != "extent" else states[0])


@pytest.mark.parametrize("states", ["north", [["a"] * 5], [[1.0, 2.0], [3.0]], {"p_x": 1.0}, None])
def test_what_is_no_numbers_is_refused(highway: ValueTable, states: object) -> None:
    with pytest.raises(StateError, match="p_x, p_y, theta, v_r, v_o"):
        highway.value(states)  # type: ignore[arg-type]


def test_a_state_error_is_a_value_error_that_the_command_line_shows() -> None:
    assert issubclass(StateError, ValueError)
    assert issubclass(StateError, HjCosimError)


def test_a_heading_of_pi_is_a_heading(highway: ValueTable) -> None:
    for heading in (np.pi, -np.pi, np.float32(np.pi)):
        assert np.isfinite(highway.value(np.array([0.0, 3.0, heading, 20.0, 20.0]))).all()


@pytest.mark.parametrize("heading", [3.15, -3.15, 6.0])
def test_a_heading_beyond_pi_is_none(highway: ValueTable, heading: float) -> None:
    with pytest.raises(StateError, match=f"theta = {heading:g} in state 0"):
        highway.value(np.array([0.0, 3.0, heading, 20.0, 20.0]))


def test_one_state_alone_may_be_flat(highway: ValueTable) -> None:
    state = np.array([5.0, 2.0, 0.1, 20.0, 15.0])
    assert highway.value(state) == highway.value(state[None, :])
    assert highway.optimal_control(state).shape == (1, 2)


def test_no_states_have_no_values(highway: ValueTable) -> None:
    assert highway.value(np.empty((0, 5))).shape == (0,)
    assert highway.optimal_disturbance(np.empty((0, 5))).shape == (0, 2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", range(5))
def test_every_answer_about_a_state_that_is_not_finite_is_unknown(highway: ValueTable, bad: float, axis: int) -> None:
    states = np.full((3, 5), 0.1)
    states[1, axis] = bad
    for question in ("value", "gradient", "optimal_control", "optimal_disturbance", "target_values", "guaranteed"):
        answer = np.asarray(QUESTIONS[question](highway, states), np.float64)
        assert np.isnan(answer[1]).all(), question
        assert np.isfinite(answer[[0, 2]]).all(), question
    assert highway.in_grid(states).tolist() == [True, False, True]


def test_what_was_asked_is_left_as_it_was(highway: ValueTable) -> None:
    states = np.full((2, 5), np.nan)
    states[0] = 1.0
    before = states.copy()
    for question in QUESTIONS:
        QUESTIONS[question](highway, states[0].copy() if question == "extent" else states)
    np.testing.assert_array_equal(states, before)
