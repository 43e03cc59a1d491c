import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from hj_cosim.reachability.games.highway import game as highway
from hj_cosim.reachability.games.highway.target import TargetFormula, target_and_gradient_at, target_at
from hj_cosim.reachability.table.lookup import value_and_gradient_at, value_at, values_and_gradients
from hj_cosim.reachability.table.store import solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.reachability.table.table_arrays import TableArrays, TableGrid
from hj_cosim.settings import TableSpecification

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
    """Return the arrays of another game than the highway's, whose V is interpolated itself."""
    deficit = np.ascontiguousarray(-values, np.float32)
    grid = TableGrid(
        0,
        deficit.shape,
        tuple(float(axis[0]) for axis in AXES),  # type: ignore[arg-type]
        tuple(float(axis[-1]) for axis in AXES),  # type: ignore[arg-type]
        tuple(float(1.0 / (axis[1] - axis[0])) for axis in AXES),  # type: ignore[arg-type]
        0.0,
        TargetFormula(*[0.0] * len(TargetFormula._fields)),
        has_target=False,
    )
    return TableArrays(deficit.reshape(-1), grid)


@pytest.fixture(scope="module")
def rough() -> TableArrays:
    return arrays_of(np.random.default_rng(3).normal(size=[len(axis) for axis in AXES]))


def test_values_are_those_of_scipy(rough: TableArrays) -> None:
    states = np.random.default_rng(4).uniform(LOW, HIGH, (500, 5))
    expected = RegularGridInterpolator(AXES, -rough.flat.reshape(rough.grid.shape).astype(np.float64))(states)
    values, _ = values_and_gradients(*rough, states)
    assert values == pytest.approx(expected, abs=1e-5)
    assert [value_at(*rough, *state) for state in states] == pytest.approx(expected, abs=1e-5)


def test_gradients_are_difference_quotients_of_values(rough: TableArrays) -> None:
    states = np.random.default_rng(5).uniform(LOW, HIGH, (200, 5))
    # Within a cell the value is linear in each coordinate: a difference over any part of the cell is exact.
    index = np.floor((states - LOW) * rough.grid.inverse_spacing)
    low_end = LOW + (index + 0.1) / rough.grid.inverse_spacing
    high_end = LOW + (index + 0.9) / rough.grid.inverse_spacing
    _, gradients = values_and_gradients(*rough, states)
    for axis in range(5):
        one, other = states.copy(), states.copy()
        one[:, axis], other[:, axis] = low_end[:, axis], high_end[:, axis]
        rise = values_and_gradients(*rough, other)[0] - values_and_gradients(*rough, one)[0]
        assert gradients[:, axis] == pytest.approx(rise / (other - one)[:, axis], rel=1e-3, abs=1e-3)


def test_a_linear_table_is_reproduced_exactly() -> None:
    slopes = np.array([0.5, -2.0, 30.0, 0.25, -1.0])
    mesh = np.meshgrid(*AXES, indexing="ij")
    table = arrays_of(sum(slope * coordinate for slope, coordinate in zip(slopes, mesh, strict=True)))
    states = np.random.default_rng(6).uniform(LOW, HIGH, (100, 5))
    values, gradients = values_and_gradients(*table, states)
    assert values == pytest.approx(states @ slopes, abs=1e-3)
    assert gradients == pytest.approx(np.tile(slopes, (100, 1)), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize(
    "state", [(60.1, 0, 0, 20, 20), (-60.1, 0, 0, 20, 20), (0, 8.1, 0, 20, 20), (0, -9, 0, 20, 20)]
)
def test_a_car_beyond_the_grid_in_position_is_safe(rough: TableArrays, state: tuple[float, ...]) -> None:
    gradient = np.ones(5)
    assert value_and_gradient_at(*rough, *map(float, state), gradient) == np.inf
    assert value_at(*rough, *map(float, state)) == np.inf
    assert (gradient == 0.0).all()


def test_headings_and_speeds_beyond_the_grid_are_clamped_not_safe(rough: TableArrays) -> None:
    assert value_at(*rough, 3.0, 1.0, 0.4, 99.0, -5.0) == value_at(*rough, 3.0, 1.0, 0.4, 40.0, 5.0)
    assert value_at(*rough, 3.0, 1.0, 0.4, 40.0, 5.0) > 0.0
    for beyond in (0.401, 9.0, -0.401):
        assert value_at(*rough, 3.0, 1.0, beyond, 40.0, 5.0) <= 0.0
    assert value_at(*rough, 1e4, 1.0, 9.0, 40.0, 5.0) == np.inf  # a car that is far away is so however the robot heads


def test_with_a_heading_beyond_the_table_no_state_of_the_game_is_called_safe(small_table: ValueTable) -> None:
    states = states_in(small_table, 11, 5000)
    assert (small_table.value(states) > 0.0).mean() > 0.5
    for heading in (-0.45, 0.45):
        states[:, 2] = heading
        values, _ = values_and_gradients(*small_table.arrays, states)
        assert (values <= 0.0).all()
        one_by_one = [value_at(*small_table.arrays, *state) for state in states]
        np.testing.assert_allclose(values, one_by_one, rtol=1e-9, atol=1e-12)


def test_the_very_faces_belong_to_the_grid(rough: TableArrays) -> None:
    for corner in (LOW, HIGH):
        node = tuple(0 if corner is LOW else -1 for _ in range(5))
        assert value_at(*rough, *corner) == pytest.approx(-float(rough.flat.reshape(rough.grid.shape)[node]), abs=1e-6)


def states_in(table: ValueTable, seed: int, count: int = 2000, stretch: float = 1.0) -> np.ndarray:
    lower, upper = np.array(table.grid.lower), np.array(table.grid.upper)
    return np.random.default_rng(seed).uniform(lower * stretch, upper * stretch, (count, 5))


def test_no_state_is_worth_more_than_the_formula_says(small_table: ValueTable) -> None:
    states = states_in(small_table, 7, 20_000)
    # float32 rounds a state, and the cubic is as steep as 400 at the grid's edge
    assert (small_table.value(states) <= small_table.target_values(states) + 1e-2).all()
    near = np.abs(small_table.target_values(states)) < 5.0
    assert (small_table.value(states) <= small_table.target_values(states) + 1e-4)[near].all()


def on_scale(value: np.ndarray) -> np.ndarray:
    """The value as a lateral gap, softened by 0.5 m around 0."""
    return np.sign(value) * ((np.abs(value) / 4.0 + 0.5**3) ** (1.0 / 3.0) - 0.5)


def test_the_look_up_is_the_formula_less_what_scipy_makes_of_the_deficit(small_table: ValueTable) -> None:
    states = states_in(small_table, 8)
    nodes = np.stack(np.meshgrid(*small_table.grid.axes, indexing="ij"), axis=-1).reshape(-1, 5)
    target = small_table.target_values(nodes).reshape(small_table.values.shape).astype(float)
    deficit = on_scale(target) - on_scale(small_table.values.astype(float))
    expected = on_scale(small_table.target_values(states).astype(float))
    expected -= RegularGridInterpolator(small_table.grid.axes, deficit)(states)
    assert on_scale(small_table.value(states)) == pytest.approx(expected, abs=1e-4)
    assert [value_at(*small_table.arrays, *state) for state in states] == pytest.approx(small_table.value(states))


def test_a_sheared_grid_is_looked_up_where_its_braking_distances_say(sheared_table: ValueTable) -> None:
    generator = np.random.default_rng(16)
    index = np.stack([generator.integers(0, nodes, 2000) for nodes in sheared_table.grid.shape], axis=-1)
    states = np.stack([axis[i] for axis, i in zip(sheared_table.grid.axes, index.T, strict=True)], axis=-1)
    robot_braking, other_braking = states[:, 3] ** 2 / 12.0, states[:, 4] ** 2 / 12.0
    states[:, 0] += other_braking - robot_braking
    inside = np.abs(states[:, 0] - other_braking + robot_braking) < 160.0  # rounding may push a face's nodes out
    assert sheared_table.value(states[inside]) == pytest.approx(
        sheared_table.values[tuple(index[inside].T)], rel=1e-4, abs=1e-2
    )


def test_on_a_sheared_grid_too_the_gradient_is_the_slope_of_the_look_up(sheared_table: ValueTable) -> None:
    states, steps = (
        sheared_table.draw_states(2000, np.random.default_rng(17)),
        1e-3 * np.array([8.0, 1.0, 0.1, 5.0, 5.0]),
    )
    values, gradients = values_and_gradients(*sheared_table.arrays, states)
    for axis in range(5):
        shift = steps[axis] * np.eye(5)[axis]
        ahead = (sheared_table.value(states + shift) - values) / steps[axis]
        behind = (values - sheared_table.value(states - shift)) / steps[axis]
        accuracy = 0.02 * np.abs(gradients[:, axis]) + 0.3
        smooth = np.isfinite(ahead) & np.isfinite(behind)
        smooth[smooth] = (np.abs(ahead - behind) <= accuracy)[smooth]
        assert smooth.mean() > 0.9
        assert (np.abs(gradients[:, axis] - 0.5 * (ahead + behind)) <= accuracy)[smooth].all()


def test_the_shear_changes_where_the_nodes_are_and_not_what_the_game_is(
    small_table: ValueTable, sheared_table: ValueTable
) -> None:
    # Coarse and of first order, so they differ by metres; taken without its shear the grid would be 100 m off.
    states = small_table.draw_states(20_000, np.random.default_rng(18))
    both = small_table.in_grid(states) & sheared_table.in_grid(states)
    plain, sheared = small_table.value(states[both]), sheared_table.value(states[both])
    near = np.abs(plain) < 20.0
    assert np.median(np.abs(plain - sheared)[near]) < 2.0
    assert np.mean(np.sign(plain) == np.sign(sheared)) > 0.97


def test_at_the_nodes_the_look_up_is_the_table(small_table: ValueTable) -> None:
    generator = np.random.default_rng(9)
    index = np.stack([generator.integers(0, nodes, 2000) for nodes in small_table.grid.shape], axis=-1)
    states = np.stack([axis[i] for axis, i in zip(small_table.grid.axes, index.T, strict=True)], axis=-1)
    assert small_table.value(states) == pytest.approx(small_table.values[tuple(index.T)], rel=1e-6, abs=1e-3)


def test_the_gradient_is_the_slope_of_the_look_up_away_from_its_kinks(small_table: ValueTable) -> None:
    states, steps = states_in(small_table, 10), 1e-3 * np.array(small_table.grid.spacing)
    values, gradients = values_and_gradients(*small_table.arrays, states)
    for axis in range(5):
        step = steps[axis]
        shift = step * np.eye(5)[axis]
        ahead = (small_table.value(states + shift) - values) / step
        behind = (values - small_table.value(states - shift)) / step
        # The values are float32, the cubic bends: differences are good to so much.
        accuracy = 0.02 * np.abs(gradients[:, axis]) + 0.2
        smooth = np.isfinite(ahead - behind) & (np.abs(ahead - behind) <= accuracy)
        assert smooth.mean() > 0.95
        assert (np.abs(gradients[:, axis] - 0.5 * (ahead + behind)) <= accuracy)[smooth].all()


def test_look_ups_are_finite_wherever_there_is_a_table(small_table: ValueTable) -> None:
    special = np.array([0.0, -0.0, 1e-300, -1e-300, 7.0, -7.0, 1e9, -1e9])
    states = states_in(small_table, 11, 20_000, stretch=1.2)
    generator = np.random.default_rng(12)
    states = np.where(generator.random(states.shape) < 0.3, generator.choice(special, states.shape), states)
    values, gradients = values_and_gradients(*small_table.arrays, states)
    lower, upper = np.array(small_table.grid.lower), np.array(small_table.grid.upper)
    inside = ((states >= lower) & (states <= upper))[:, 0] & (np.abs(states[:, 1]) <= 1e6)
    assert np.array_equal(np.isfinite(values), inside)
    assert np.isfinite(gradients).all()
    assert (gradients[~inside] == 0.0).all()


def test_beside_the_grid_v_is_what_the_formula_says_and_never_more(small_table: ValueTable) -> None:
    target, edge = small_table.arrays.grid.target, small_table.grid.upper[1]
    draw = np.random.default_rng(13)
    for theta, v_r, v_o in zip(draw.uniform(-0.4, 0.4, 200), *draw.uniform(0.0, 40.0, (2, 200)), strict=True):
        beside = np.array([0.0, edge + 0.01, theta, v_r, v_o])
        value, gradient = values_and_gradients(*small_table.arrays, beside[None])
        found = target_and_gradient_at(target, *beside)
        assert value[0] == found[0]
        assert gradient[0] == pytest.approx(found[1:])
        assert small_table.value(beside - [0.0, 0.02, 0.0, 0.0, 0.0])[0] <= value[0] + 5.0  # no cliff to safety
    # Turned towards the other car and fast, it is far from safe there.
    assert small_table.value(np.array([0.0, edge + 0.01, -0.4, 30.0, 30.0]))[0] < 0.0


def test_a_margin_lowers_what_is_looked_up(highway_small: TableSpecification, small_table: ValueTable) -> None:
    careful = solve_table(highway_small.model_copy(update={"margin": 0.25}))
    states = states_in(small_table, 13)
    assert (careful.value(states) < small_table.value(states)).all()
    node = np.array([axis[len(axis) // 2] for axis in small_table.grid.axes])
    assert careful.value(node) == pytest.approx(small_table.value(node) - 0.25, abs=1e-3)


def test_the_formula_is_the_solvers_target(small_table: ValueTable) -> None:
    rng = np.random.default_rng(14)
    states = states_in(small_table, 15, 5000)
    states = np.where(rng.random(states.shape) < 0.1, 0.0, states).astype(np.float32).astype(np.float64)
    for parameters in (
        {},
        {"brake_min": 5.0, "brake_max": 8.0, "lateral_margin": 0.4, "response_time": 1.0},
        {"turned_length": 4.0},
    ):
        named = highway.PARAMETERS | parameters
        formula = TargetFormula.of_game(named)
        expected = highway.game.target_values(states, highway.game.parameter_values(parameters, "the test"))
        found = [target_at(formula, *state) for state in states]
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-3)
        assert [target_and_gradient_at(formula, *state)[0] for state in states] == pytest.approx(found, abs=1e-12)


def test_a_turned_body_has_its_slope_along_the_heading() -> None:
    formula = TargetFormula.of_game(highway.PARAMETERS | {"turned_length": 5.0})
    draw, step = np.random.default_rng(15), 1e-5
    for theta, v_r in zip(draw.uniform(-0.35, 0.35, 200), draw.uniform(2.0, 38.0, 200), strict=True):
        state = [0.0, draw.choice([-1.0, 1.0]) * draw.uniform(4.0, 7.5), theta, v_r, 20.0]
        ahead, behind = [[*state[:2], theta + side * step, *state[3:]] for side in (1.0, -1.0)]
        slope = (target_at(formula, *ahead) - target_at(formula, *behind)) / (2.0 * step)
        assert target_and_gradient_at(formula, *state).by_theta == pytest.approx(slope, rel=1e-4, abs=1e-2)


def test_so_far_aside_that_no_cube_is_a_number_a_car_is_safe(small_table: ValueTable) -> None:
    for aside in (1e7, -1e154, 1e300):
        values, gradients = values_and_gradients(*small_table.arrays, np.array([[0.0, aside, 0.0, 20.0, 20.0]]))
        assert values[0] == value_at(*small_table.arrays, 0.0, aside, 0.0, 20.0, 20.0) == np.inf
        assert (gradients == 0.0).all()
