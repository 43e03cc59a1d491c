import dataclasses

import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.highway.manoeuvre_cap import capped
from hj_cosim.reachability.games.highway.manoeuvres import lower_bounds
from hj_cosim.reachability.table.store import load_table, solve_table
from hj_cosim.settings import TableSpecification


@pytest.fixture(scope="module")
def found(small_table):
    """The coarse table's values, capped."""
    return capped(small_table.values, small_table.grid, small_table.parameters)


def test_a_cap_takes_from_a_table_what_no_manoeuvre_guarantees_and_nothing_else(small_table, found):
    parameters, grid = small_table.parameters, small_table.grid
    assert (found <= small_table.values).all()
    points = np.stack(np.meshgrid(*grid.axes, indexing="ij"), axis=-1).reshape(-1, 5)
    chosen = np.random.default_rng(5).choice(len(points), 5000, replace=False)
    states = points[chosen].copy()
    states[:, 0] += parameters["braking_shear"] * (states[:, 4] ** 2 - states[:, 3] ** 2)
    bounds = lower_bounds(small_table.manoeuvres(), states)
    values, caps = small_table.values.reshape(-1)[chosen], found.reshape(-1)[chosen]
    assert (caps <= bounds + 1e-3).all()
    # What is guaranteed stays, but for nodes that give way for what lies beside them.
    sure = bounds >= values
    assert 0.1 < sure.mean() < 0.9
    assert np.mean(caps[sure] == values[sure]) > 0.9


def test_a_capped_table_promises_no_more_than_manoeuvres_guarantee_between_two_speeds_of_the_other_car(
    small_table, found
):
    axes = list(small_table.grid.axes)
    axes[4] = 0.5 * (axes[4][1:] + axes[4][:-1])
    states = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 5)
    states[:, 0] += small_table.parameters["braking_shear"] * (states[:, 4] ** 2 - states[:, 3] ** 2)
    states = states[np.random.default_rng(6).choice(len(states), 5000, replace=False)]
    bounds = lower_bounds(small_table.manoeuvres(), states)
    careful, bare = dataclasses.replace(small_table, values=found).value(states), small_table.value(states)
    near = np.abs(bounds) < 20.0
    assert (careful - bounds)[near].max() < 0.01
    assert (bare - bounds)[near].max() > 5.0


def test_a_capped_specification_gives_a_capped_table(highway_small):
    grid = highway_small.grid.model_copy(update={"shape": (21, 9, 7, 7, 7)})
    bare = solve_table(highway_small.model_copy(update={"grid": grid}))
    specification = bare.specification.model_copy(update={"capped_by_manoeuvres": True, "margin": 0.25})
    expected = capped(bare.values, bare.grid, bare.parameters) - np.float32(0.25)
    assert (expected + np.float32(0.25) < bare.values).mean() > 0.05
    np.testing.assert_array_equal(solve_table(specification).values, expected)


def test_only_the_highway_game_can_be_capped(braking: TableSpecification):
    with pytest.raises(ConfigurationError, match="capped_by_manoeuvres is for games whose manoeuvres"):
        solve_table(braking.model_copy(update={"capped_by_manoeuvres": True}))


def test_a_file_that_caps_another_game_is_named(tmp_path):
    path = tmp_path / "walls.toml"
    path.write_text(
        'dynamics = "double_integrator"\ncapped_by_manoeuvres = true\n'
        "[grid]\nlower = [-2.0, -2.0]\nupper = [2.0, 2.0]\nshape = [21, 21]\n"
    )
    with pytest.raises(ConfigurationError, match=r"walls\.toml: capped_by_manoeuvres"):
        load_table(str(path))
