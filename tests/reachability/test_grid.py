"""Regular grids."""

import pytest

from hj_cosim.reachability.grid import Grid


@pytest.mark.parametrize("factor", [1.25, 1.5, 1.7, 2.0])
def test_a_finer_grid_has_a_node_in_the_middle_where_the_coarse_one_has(factor):
    """|p_x| has a kink there."""
    grid = Grid((-3.0, -1.0, 0.0), (3.0, 1.0, 6.0), (7, 9, 8), ("linear", "linear", "periodic")).refined(factor)
    for axis in grid.axes[:2]:
        assert axis[len(axis) // 2] == pytest.approx(0.0, abs=1e-12)
        assert len(axis) % 2 == 1
    assert grid.shape[0] >= round(6 * factor) + 1
    assert grid.shape[2] == round(8 * factor)
