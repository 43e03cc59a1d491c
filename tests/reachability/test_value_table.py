import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from test_systems import USER_DYNAMICS

from hj_cosim import locations
from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.table.lookup import values_and_gradients
from hj_cosim.reachability.table.store import load_table, read_specification, read_table, save_table, solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import GridSettings, TableSpecification

SPECIFICATION = """
dynamics = "double_integrator"
horizon = 0.5
scheme = "first_order"

[grid]
lower = [-4.0, -2.0]
upper = [4.0, 2.0]
shape = [21, 11]
"""


@pytest.fixture
def specification_file(tmp_path: Path) -> Path:
    path = tmp_path / "braking.toml"
    path.write_text(SPECIFICATION)
    return path


def test_a_table_comes_back_from_its_file_as_it_was(tmp_path: Path, braking: TableSpecification) -> None:
    table = solve_table(braking)
    save_table(table, tmp_path / "table.npz")
    back = read_table(tmp_path / "table.npz")
    assert np.array_equal(back.values, table.values)
    assert back.specification == table.specification
    assert back.report == table.report


def test_the_file_holds_what_scripts_rely_on(tmp_path: Path, braking: TableSpecification) -> None:
    save_table(solve_table(braking), tmp_path / "table.npz")
    with np.load(tmp_path / "table.npz") as content:
        assert set(content.files) == {"values", "axis0", "axis1", "spec", "report"}
        assert content["values"].dtype == np.float32
        assert content["axis0"].dtype == np.float64
        assert content["values"].shape == (len(content["axis0"]), len(content["axis1"]))
        assert json.loads(str(content["spec"]))["dynamics"] == "double_integrator"
        report = json.loads(str(content["report"]))
    wanted = {
        "shape",
        "scheme",
        "horizon",
        "steps",
        "seconds",
        "cell_updates_per_second",
        "peak_memory_mib",
        "residual",
    }
    assert wanted | {"versions", "checksum", "specification_hash"} <= set(report)


def test_a_table_is_solved_once_and_then_loaded(specification_file: Path) -> None:
    steps: list[int] = []
    first = load_table(str(specification_file), lambda done, _: steps.append(done))
    assert steps
    steps.clear()
    second = load_table(str(specification_file), lambda done, _: steps.append(done))
    assert not steps
    assert np.array_equal(first.values, second.values)


def test_a_changed_specification_is_solved_again(specification_file: Path) -> None:
    before = load_table(str(specification_file))
    specification_file.write_text(SPECIFICATION.replace("horizon = 0.5", "horizon = 1.0"))
    after = load_table(str(specification_file))
    assert after.report.horizon == 1.0
    assert not np.array_equal(before.values, after.values)


def test_a_changed_description_is_not_solved_again(specification_file: Path) -> None:
    load_table(str(specification_file))
    specification_file.write_text('description = "new words"\n' + SPECIFICATION)
    steps: list[int] = []
    load_table(str(specification_file), lambda done, _: steps.append(done))
    assert not steps


def test_an_altered_table_is_refused(specification_file: Path) -> None:
    load_table(str(specification_file))
    kept = specification_file.with_suffix(".npz")
    with np.load(kept) as content:
        arrays = {name: content[name] for name in content.files}
    arrays["values"] = arrays["values"] + np.float32(0.5)
    np.savez(kept, **arrays)
    with pytest.raises(TableError, match="altered"):
        load_table(str(specification_file))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_table_is_refused(specification_file: Path, share: float) -> None:
    load_table(str(specification_file))
    kept = specification_file.with_suffix(".npz")
    kept.write_bytes(kept.read_bytes()[: int(share * kept.stat().st_size)])
    with pytest.raises(TableError, match="not a whole value table"):
        load_table(str(specification_file))


def test_an_interrupted_solve_leaves_no_file(specification_file: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        load_table(str(specification_file), interrupt)
    assert [path.name for path in specification_file.parent.iterdir()] == ["braking.toml"]


def test_a_missing_table_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(TableError, match="there is no table"):
        read_table(tmp_path / "nothing.npz")


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ("shape = [21, 11, 5]", "one entry per axis"),
        ("shape = [21, 2]", "7 or more"),
        ("shape = [21, 11]\nsize = 3", "unknown key"),
    ],
)
def test_a_wrong_grid_is_refused_in_a_sentence(specification_file: Path, wrong: str, complaint: str) -> None:
    specification_file.write_text(SPECIFICATION.replace("shape = [21, 11]", wrong))
    with pytest.raises(ConfigurationError, match=complaint):
        read_specification(specification_file)


def test_a_user_game_that_does_not_compile_is_refused_in_a_sentence(tmp_path: Path) -> None:
    slope = "c[0] * abs(p[0, i])"
    (tmp_path / "walker.py").write_text(USER_DYNAMICS.replace(slope, f"float(format(c[0], '.3f')) * {slope}"))
    (tmp_path / "walker.toml").write_text(SPECIFICATION.replace('"double_integrator"', '"walker.py"'))
    with pytest.raises(ConfigurationError, match="hamiltonian does not compile"):
        load_table(str(tmp_path / "walker.toml"))


def test_a_line_too_long_for_the_kernel_is_refused(braking: TableSpecification) -> None:
    grid = braking.grid.model_copy(update={"shape": (3000, 11)})
    with pytest.raises(ConfigurationError, match="3000 nodes along position"):
        solve_table(braking.model_copy(update={"grid": grid}))


def test_a_grid_of_another_dimension_than_the_game_is_refused(specification_file: Path) -> None:
    text = SPECIFICATION.replace('"double_integrator"', '"air3d"')
    specification_file.write_text(text)
    with pytest.raises(ConfigurationError, match="air3d has 3 axes"):
        read_specification(specification_file)


def test_the_margin_lowers_every_value(braking: TableSpecification) -> None:
    plain = solve_table(braking).values
    careful = solve_table(braking.model_copy(update={"margin": 0.25})).values
    assert careful == pytest.approx(plain - 0.25)


def test_a_user_game_is_solved_from_its_own_file(tmp_path: Path) -> None:
    (tmp_path / "walker.py").write_text(USER_DYNAMICS)
    text = SPECIFICATION.replace('"double_integrator"', '"walker.py"').replace("horizon = 0.5", "horizon = 5.0")
    (tmp_path / "walker.toml").write_text(text)
    table = load_table(str(tmp_path / "walker.toml"))
    # Nobody chases the walker, who can always stand further away than where it starts: V = V0.
    states = np.array([[0.0, 0.0], [1.0, 1.0], [-3.0, 0.0]])
    assert table.value(states) == pytest.approx(table.target_values(states), abs=1e-4)
    assert table.optimal_control(np.array([[1.0, 0.0], [-1.0, 0.0]]))[:, 0] == pytest.approx([1.0, -1.0])
    (tmp_path / "walker.py").write_text(USER_DYNAMICS.replace('"radius": 0.5', '"radius": 0.75'))
    assert load_table(str(tmp_path / "walker.toml")).value(states)[0] == pytest.approx(-0.75)


def test_a_highway_table_is_looked_up_as_planning_and_filtering_do(small_table: ValueTable) -> None:
    states = np.random.default_rng(0).uniform(-200.0, 200.0, (300, 5)) * [1.0, 1.0, 0.01, 1.0, 1.0]
    values, gradients = values_and_gradients(*small_table.arrays, states)
    assert np.array_equal(small_table.value(states), values)
    assert np.array_equal(small_table.gradient(states), gradients)
    assert not small_table.in_grid(states[np.isinf(values)]).any()


def test_a_game_with_the_same_state_and_another_target_is_interpolated_itself(small_table: ValueTable) -> None:
    def far(x: np.ndarray, c: np.ndarray, out: np.ndarray) -> None:
        out[:] = 1.0

    table = dataclasses.replace(
        small_table, game=dataclasses.replace(small_table.game, target=far, target_formula=None)
    )
    lower, upper = np.array(table.grid.lower), np.array(table.grid.upper)
    states = np.random.default_rng(1).uniform(lower, upper, (300, 5))
    values, gradients = values_and_gradients(*table.arrays, states)
    assert table.value(states) == pytest.approx(values, rel=1e-5, abs=1e-3)
    assert table.gradient(states) == pytest.approx(gradients, rel=1e-3, abs=1e-2)
    assert (values > small_table.value(states)).any()


def test_a_periodic_look_up_wraps() -> None:
    specification = TableSpecification.model_validate(
        {
            "dynamics": "air3d",
            "grid": {"lower": (-6, -10, 0), "upper": (20, 10, 2 * np.pi), "shape": (14, 11, 12)},
            "horizon": 0.2,
            "scheme": "first_order",
        }
    )
    table = solve_table(specification)
    turns = np.array([[3.0, 2.0, 0.1 + turn * 2 * np.pi] for turn in (-1, 0, 1)])
    assert table.value(turns) == pytest.approx(np.full(3, table.value(turns)[1]), abs=1e-5)


def test_only_the_highway_game_serves_planner_and_filter(braking: TableSpecification) -> None:
    with pytest.raises(TableError, match="planning and filtering need"):
        _ = solve_table(braking).arrays


def test_the_optimal_control_turns_away_and_the_disturbance_closes_in(small_table: ValueTable) -> None:
    alongside = np.array([[0.0, 3.5, 0.0, 20.0, 20.0]])
    omega, _ = small_table.optimal_control(alongside)[0]
    theta_o, _ = small_table.optimal_disturbance(alongside)[0]
    assert omega == pytest.approx(0.3)
    assert theta_o > 0.0


def test_every_specification_that_comes_with_the_package_is_valid() -> None:
    folder = locations.specifications_folder()
    for path in folder.glob("*.toml"):
        assert read_specification(path).grid.shape


def a_table_of(name: str) -> ValueTable:
    """Return a table of any values; what is outside, periodic and unknown does not depend on them."""
    game = find_game(name)
    grids = {
        "air3d": GridSettings(lower=(-6.0, -10.0, 0.0), upper=(20.0, 10.0, 2.0 * np.pi), shape=(9, 8, 7)),
        "highway": GridSettings(
            lower=(-60.0, -8.0, -0.4, 0.0, 0.0), upper=(60.0, 8.0, 0.4, 40.0, 40.0), shape=(9, 9, 7, 7, 7)
        ),
    }
    specification = TableSpecification(dynamics=name, grid=grids[name])
    values = np.random.default_rng(1).normal(size=grids[name].shape).astype(np.float32)
    return ValueTable(specification, game, values, report=None)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["air3d", "highway"])
def test_of_a_state_that_is_not_finite_nothing_is_known(name: str) -> None:
    table = a_table_of(name)
    for axis in range(table.grid.dimension):
        for bad in (np.nan, np.inf, -np.inf):
            states = np.zeros((3, table.grid.dimension))
            states[1, axis] = bad
            values, gradients = table.value_and_gradient(states)
            assert np.isnan(values[1])
            assert np.isnan(gradients[1]).all()
            known = table.value_and_gradient(states[:1])
            assert values[[0, 2]] == pytest.approx(np.repeat(known[0], 2))
            np.testing.assert_allclose(gradients[[0, 2]], np.repeat(known[1], 2, axis=0))


def test_a_state_many_turns_away_is_looked_up_within_the_table() -> None:
    table = a_table_of("air3d")
    turns = np.array([0.0, 1e9, 1e17, -1e17, 1e300, -1e300])
    values, gradients = table.value_and_gradient(np.column_stack([np.ones_like(turns), np.ones_like(turns), turns]))
    assert np.abs(values).max() <= np.abs(table.values).max()
    assert np.isfinite(gradients).all()


def test_the_extent_along_a_variable_ends_where_the_grid_does(sheared_table: ValueTable) -> None:
    held = np.array([0.0, 1.0, 0.1, 10.0, 20.0])
    first, last = sheared_table.extent(0, held)
    assert (first, last) == pytest.approx((-160.0 + 25.0, 160.0 + 25.0))  # (20² − 10²) / 12 = 25 m ahead
    for place, inside in ((first - 0.1, False), (first + 0.1, True), (last - 0.1, True), (last + 0.1, False)):
        state = np.array([[place, *held[1:]]])
        assert sheared_table.in_grid(state)[0] == inside
        assert np.isfinite(sheared_table.value(state)[0]) == inside
    assert sheared_table.extent(1, held) == pytest.approx((-8.0, 8.0))
