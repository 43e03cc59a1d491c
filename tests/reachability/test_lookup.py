import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from hj_cosim.reachability.lookup import TableArrays, value_and_gradient_at, value_at, values_and_gradients

AXES = (
    np.linspace(-60.0, 60.0, 13),
    np.linspace(-8.0, 8.0, 9),
    np.linspace(-0.4, 0.4, 7),
    np.linspace(0.0, 40.0, 8),
    np.linspace(5.0, 40.0, 6),
)
LOW = np.array([axis[0] for axis in AXES])
HIGH = np.array([axis[-1] for axis in AXES])


def arrays_of(values: np.ndarray) -> TableArrays:
    values = np.ascontiguousarray(values, np.float32)
    return TableArrays(
        values,
        values.reshape(-1),
        tuple(float(axis[0]) for axis in AXES),  # type: ignore[arg-type]
        tuple(float(1.0 / (axis[1] - axis[0])) for axis in AXES),  # type: ignore[arg-type]
    )


@pytest.fixture(scope="module")
def rough() -> TableArrays:
    return arrays_of(np.random.default_rng(3).normal(size=[len(axis) for axis in AXES]))


def test_values_are_those_of_scipy(rough: TableArrays) -> None:
    states = np.random.default_rng(4).uniform(LOW, HIGH, (500, 5))
    expected = RegularGridInterpolator(AXES, rough.values.astype(np.float64))(states)
    values, _ = values_and_gradients(rough, states)
    assert values == pytest.approx(expected, abs=1e-5)
    assert [value_at(rough, *state) for state in states] == pytest.approx(expected, abs=1e-5)


def test_gradients_are_difference_quotients_of_values(rough: TableArrays) -> None:
    states = np.random.default_rng(5).uniform(LOW, HIGH, (200, 5))
    # Within a cell the value is linear in each coordinate: a difference over any part of the cell is exact.
    index = np.floor((states - LOW) * rough.inverse_spacing)
    low_end = LOW + (index + 0.1) / rough.inverse_spacing
    high_end = LOW + (index + 0.9) / rough.inverse_spacing
    _, gradients = values_and_gradients(rough, states)
    for axis in range(5):
        one, other = states.copy(), states.copy()
        one[:, axis], other[:, axis] = low_end[:, axis], high_end[:, axis]
        rise = values_and_gradients(rough, other)[0] - values_and_gradients(rough, one)[0]
        assert gradients[:, axis] == pytest.approx(rise / (other - one)[:, axis], rel=1e-3, abs=1e-3)


def test_a_linear_table_is_reproduced_exactly() -> None:
    slopes = np.array([0.5, -2.0, 30.0, 0.25, -1.0])
    mesh = np.meshgrid(*AXES, indexing="ij")
    table = arrays_of(sum(slope * coordinate for slope, coordinate in zip(slopes, mesh, strict=True)))
    states = np.random.default_rng(6).uniform(LOW, HIGH, (100, 5))
    values, gradients = values_and_gradients(table, states)
    assert values == pytest.approx(states @ slopes, abs=1e-3)
    assert gradients == pytest.approx(np.tile(slopes, (100, 1)), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize(
    "state", [(60.1, 0, 0, 20, 20), (-60.1, 0, 0, 20, 20), (0, 8.1, 0, 20, 20), (0, -9, 0, 20, 20)]
)
def test_a_car_beyond_the_grid_in_position_is_safe(rough: TableArrays, state: tuple[float, ...]) -> None:
    gradient = np.ones(5)
    assert value_and_gradient_at(rough, *map(float, state), gradient) == np.inf
    assert value_at(rough, *map(float, state)) == np.inf
    assert (gradient == 0.0).all()


def test_headings_and_speeds_beyond_the_grid_are_clamped_not_safe(rough: TableArrays) -> None:
    assert value_at(rough, 3.0, 1.0, 9.0, 99.0, -5.0) == value_at(rough, 3.0, 1.0, 0.4, 40.0, 5.0)


def test_the_very_faces_belong_to_the_grid(rough: TableArrays) -> None:
    for corner in (LOW, HIGH):
        node = tuple(0 if corner is LOW else -1 for _ in range(5))
        assert value_at(rough, *corner) == pytest.approx(float(rough.values[node]), abs=1e-6)
