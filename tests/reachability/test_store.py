"""A table belongs to a robot and to the cars it meets; one that no specification names is kept under its hash."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.reachability.table.size_classes import CAR, SIZE_CLASSES
from hj_cosim.reachability.table.store import (
    for_pair,
    kept_table,
    load_table,
    read_specification,
    require_robot,
    save_table,
    solve_table,
)
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import RobotSettings, TableSpecification, robot_and_filter

HERE = Path(__file__).resolve().parent
VAN, LONG_TRUCK = SIZE_CLASSES[1:]
BRITTLE = RobotSettings(acceleration_min=-2.0, omega_max=0.05)

TINY = """
dynamics = "highway"
horizon = 0.1
scheme = "first_order"
[grid]
lower = [-100.0, -8.0, -0.4, 0.0, 0.0]
upper = [100.0, 8.0, 0.4, 40.0, 40.0]
shape = [21, 9, 7, 9, 7]
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.mark.parametrize(
    ("name", "preset"), [("highway", "best"), ("highway_paper", "paper"), ("highway_worst", "paper")]
)
def test_a_presets_robot_among_cars_has_the_table_that_comes_with_the_package(name: str, preset: str) -> None:
    assert kept_table(name, robot_and_filter(preset)[0], CAR) == kept_table(name)
    assert kept_table(name).path.name == f"{name}.npz"


def test_body_and_limits_come_from_the_robot(highway_small: TableSpecification) -> None:
    robot = RobotSettings(length=9.0, width=2.4, omega_max=0.2, acceleration_min=-4.0, acceleration_max=3.0)
    derived = for_pair(highway_small, robot, VAN)
    assert derived.parameters == {
        "omega_max": 0.2,
        "acceleration_min": -4.0,
        "acceleration_max": 3.0,
        "length": pytest.approx(10.5),
        "width": pytest.approx(2.45),
    }
    # 5.5 m for the bodies, and what braking 2 m/s² weaker costs in 3 s; nodes no farther apart than they were
    assert derived.grid.lower[0] == pytest.approx(-160.0 - 5.5 - 9.0)
    assert derived.grid.upper[1] == pytest.approx(8.0 + 0.45)
    old, new = highway_small.grid, derived.grid
    for axis in range(5):
        spacing = (new.upper[axis] - new.lower[axis]) / (new.shape[axis] - 1)
        assert spacing <= (old.upper[axis] - old.lower[axis]) / (old.shape[axis] - 1) + 1e-9
    assert new.shape[1] % 2 == old.shape[1] % 2 == 1


@pytest.mark.parametrize(("speed_max", "nodes"), [(20.0, 7), (50.0, 11)])
def test_the_grid_ends_at_the_robots_top_speed(highway_small: TableSpecification, speed_max: float, nodes: int) -> None:
    grid = for_pair(highway_small, RobotSettings(speed_max=speed_max)).grid
    assert grid.upper[3] == speed_max
    assert grid.upper[4] == 40.0
    assert grid.shape[3] == nodes


def test_a_specification_made_out_for_a_pair_stays_as_it_is(highway_small: TableSpecification) -> None:
    derived = for_pair(highway_small, BRITTLE, LONG_TRUCK)
    assert derived != highway_small
    assert for_pair(derived, BRITTLE, LONG_TRUCK) == derived
    assert for_pair(derived, RobotSettings(), LONG_TRUCK) != derived


def test_a_game_that_knows_no_robot_is_right_for_any(braking: TableSpecification) -> None:
    assert for_pair(braking, BRITTLE, LONG_TRUCK) == braking


def test_another_robots_table_is_solved_once_beside_the_named_one(tiny: Path) -> None:
    said: list[str] = []
    named = load_table(str(tiny), robot=RobotSettings(), announce=said.append)
    assert len(said) == 1
    other = load_table(str(tiny), robot=BRITTLE, announce=said.append)
    assert len(said) == 2
    assert "for this robot" in said[1]
    assert other.parameters["acceleration_min"] == -2.0
    again = load_table(str(tiny), robot=BRITTLE, announce=said.append)
    assert len(said) == 2
    assert np.array_equal(again.values, other.values)
    assert load_table(str(tiny)).specification == named.specification
    kept = sorted(path.name for path in tiny.parent.glob("*.npz"))
    assert len(kept) == 2
    assert kept[0].startswith("tiny-")
    assert kept[1] == "tiny.npz"


def test_a_robot_that_turns_and_brakes_less_is_never_safer(tiny: Path) -> None:
    able, weak = load_table(str(tiny), robot=RobotSettings()), load_table(str(tiny), robot=BRITTLE)
    states = np.stack(np.meshgrid(*able.grid.axes, indexing="ij"), -1).reshape(-1, 5)
    assert (weak.value(states) <= able.value(states) + 0.5).mean() > 0.99
    assert weak.values.min() < able.values.max()


def test_nothing_drives_against_another_robots_table(tiny: Path) -> None:
    table = load_table(str(tiny))
    require_robot(table, RobotSettings())
    with pytest.raises(TableError, match="another robot's"):
        require_robot(table, BRITTLE)
    require_robot(load_table(str(tiny), robot=BRITTLE, size=LONG_TRUCK), BRITTLE)


def test_a_robot_that_no_grid_can_hold_is_refused_in_a_sentence(highway_small: TableSpecification) -> None:
    wide = highway_small.model_copy(
        update={"grid": highway_small.grid.model_copy(update={"shape": (81, 81, 41, 41, 9)})}
    )
    with pytest.raises(ConfigurationError, match=r"robot\.speed_max = 1000 m/s: .*200 million"):
        for_pair(wide, RobotSettings(speed_max=1000.0))


def test_a_solved_table_serves_as_a_specification(tiny: Path) -> None:
    quick = tiny.with_name("quick.npz")
    table = solve_table(str(tiny))
    save_table(table, quick)
    tiny.unlink()
    assert read_specification(quick) == table.specification
    assert np.array_equal(load_table(str(quick)).values, table.values)
    assert np.array_equal(load_table(str(quick), robot=RobotSettings()).values, table.values)
    assert load_table(str(quick), robot=BRITTLE).parameters["omega_max"] == 0.05
    assert len(list(quick.parent.glob("quick-*.npz"))) == 1


def test_a_solved_table_is_never_solved_over(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_table(solve_table(str(tiny)), tiny.with_suffix(".npz"))
    before = tiny.with_suffix(".npz").read_bytes()
    monkeypatch.setattr("hj_cosim.reachability.table.store._SOLVER_VERSION", -1)
    with pytest.raises(TableError, match="another version"):
        load_table(str(tiny.with_suffix(".npz")))
    assert tiny.with_suffix(".npz").read_bytes() == before


def test_a_table_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nothing\.npz does not exist"):
        load_table(str(tmp_path / "nothing.npz"))


def test_the_commands_take_a_table_by_its_file(
    call: Callable[..., tuple[int, str, str]], tmp_path: Path, tiny: Path
) -> None:
    quick = tmp_path / "quick.npz"
    shutil.copy(tiny, tmp_path / "mine.toml")
    assert call("table", "solve", tmp_path / "mine.toml", "--scheme", "first_order", "--out", quick)[0] == 0
    status, _, said = call("table", "show", quick, "--out", tmp_path / "slice.csv")
    assert status == 0, said
    assert (tmp_path / "slice.csv").read_text().startswith("p_x,p_y,value")


def test_table_show_draws_every_game(call: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    (tmp_path / "planes.toml").write_text(
        'dynamics = "air3d"\nhorizon = 0.1\nscheme = "first_order"\n'
        "[grid]\nlower = [-6.0, -10.0, 0.0]\nupper = [20.0, 10.0, 6.283185307179586]\nshape = [9, 8, 7]\n"
    )
    drawn = tmp_path / "planes.csv"
    arguments = ("--over", "x,psi", "--hold", "y=2", "--out", drawn)
    status, _, said = call("table", "show", tmp_path / "planes.toml", *arguments)
    assert status == 0, said
    data = np.loadtxt(drawn, delimiter=",", skiprows=1)
    table: ValueTable = load_table(str(tmp_path / "planes.toml"))
    rows = data[:: len(data) // 50]
    assert rows[:, 2] == pytest.approx(table.value(np.column_stack([rows[:, 0], np.full(len(rows), 2.0), rows[:, 1]])))


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--over", "p_x,speed"), "'speed' is no state of highway"),
        (("--over", "p_x"), "two different states"),
        (("--hold", "v_o=fast"), "'v_o=fast' is not NAME=NUMBER"),
        (("--hold", "v_o=60"), "v_o = 60 is not in the table; 0 to 40 is"),
    ],
)
def test_a_slice_that_cannot_be_is_refused_in_a_sentence(
    call: Callable[..., tuple[int, str, str]], tiny: Path, arguments: tuple[str, ...], complaint: str
) -> None:
    status, _, said = call("table", "show", tiny, *arguments)
    assert status == 2
    assert complaint in said
