import sys
from pathlib import Path

import pytest

from hj_cosim.reachability.table.store import read_specification, solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import GridSettings, TableSpecification

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

FIXTURES = HERE / "fixtures"


@pytest.fixture(scope="session")
def highway_small() -> TableSpecification:
    return read_specification(FIXTURES / "highway_small.toml")


@pytest.fixture(scope="session")
def small_table(highway_small: TableSpecification) -> ValueTable:
    return solve_table(highway_small)


@pytest.fixture(scope="session")
def capped_table(small_table: ValueTable) -> ValueTable:
    """The same, capped by what manoeuvres guarantee."""
    return solve_table(small_table.specification.model_copy(update={"capped_by_manoeuvres": True}))


@pytest.fixture(scope="session")
def sheared_table(highway_small: TableSpecification) -> ValueTable:
    """The same game on a grid along p_x − (v_o² − v_r²)/12."""
    return solve_table(highway_small.model_copy(update={"parameters": {"braking_shear": 1.0 / 12.0}}))


@pytest.fixture
def braking() -> TableSpecification:
    """The double integrator on a small grid."""
    return TableSpecification(
        dynamics="double_integrator",
        grid=GridSettings(lower=(-4.0, -2.0), upper=(4.0, 2.0), shape=(61, 41)),
        horizon=1.0,
        scheme="first_order",
    )
