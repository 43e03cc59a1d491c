"""A game is one object: what it gives to filters, look-ups and pictures, ours and users' own alike."""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.analysis.figures.value_slice import value_slice as draw_slice
from hj_cosim.control.catalogue import make_filter
from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.reachability.games.catalogue import find_game, registered_games
from hj_cosim.reachability.table.cars import car_values, rows_of_cars
from hj_cosim.reachability.table.lookup import values_and_gradients
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, FilterSettings, PlannerSettings, RobotSettings

# Two cars, the robot's slowed by the air and steered by a turn rate that fades with speed, the other one straight on.
WINDY = """
import math
from hj_cosim.reachability.games.contract import TWO_CARS, Game, state_function

@state_function
def target(x, c, out):
    for i in range(out.shape[0]):
        out[i] = max(abs(x[0, i]) - 8.0, 4.0 * (abs(x[1, i]) - 2.5))

@state_function
def flow(x, u, d, c, out):
    for i in range(out.shape[1]):
        out[0, i] = x[3, i] * math.cos(x[2, i]) - x[4, i]
        out[1, i] = x[3, i] * math.sin(x[2, i])
        out[2, i] = u[0, i] / (1.0 + 0.05 * x[3, i])
        out[3, i] = u[1, i] - c[0] * x[3, i] * x[3, i]
        out[4, i] = d[0, i]

@state_function
def hamiltonian(x, p, c, limits, out):
    for i in range(out.shape[0]):
        along = x[3, i] * math.cos(x[2, i]) - x[4, i]
        drift = p[0, i] * along + p[1, i] * x[3, i] * math.sin(x[2, i]) - p[3, i] * c[0] * x[3, i] * x[3, i]
        turning = 0.3 * abs(p[2, i]) / (1.0 + 0.05 * x[3, i])
        out[i] = drift + turning + (4.0 * p[3, i] if p[3, i] > 0.0 else -6.0 * p[3, i]) - 5.0 * abs(p[4, i])

@state_function
def dissipation(x, c, out):
    for i in range(out.shape[1]):
        out[0, i] = abs(x[3, i] * math.cos(x[2, i]) - x[4, i])
        out[1, i] = abs(x[3, i] * math.sin(x[2, i]))
        out[2, i] = 0.3
        out[3, i] = 6.0 + c[0] * x[3, i] * x[3, i]
        out[4, i] = 5.0

@state_function
def optimal_inputs(x, p, c, limits, u, d):
    for i in range(u.shape[1]):
        u[0, i] = 0.3 if p[2, i] > 0.0 else -0.3
        u[1, i] = 4.0 if p[3, i] > 0.0 else -6.0
        d[0, i] = -5.0 if p[4, i] > 0.0 else 5.0

game = Game(
    name="windy", state=TWO_CARS, controls=("omega_r", "a_r"), disturbances=("a_o",), parameters={"drag": 0.002},
    target=target, flow=flow, hamiltonian=hamiltonian, dissipation=dissipation, optimal_inputs=optimal_inputs,
    boundary=("linear",) * 5, outside=("safe", "safe", "clamp", "clamp", "clamp"), limited=(False,) * 5,
    slab_axes=(4, 0), angles=("theta",),
)
"""
WINDY_TABLE = """
dynamics = "windy.py"
horizon = 0.5
scheme = "first_order"
[grid]
lower = [-80.0, -8.0, -0.4, 0.0, 0.0]
upper = [80.0, 8.0, 0.4, 40.0, 40.0]
shape = [21, 9, 7, 9, 9]
"""


@pytest.fixture(scope="module")
def windy(tmp_path_factory: pytest.TempPathFactory) -> ValueTable:
    folder = tmp_path_factory.mktemp("windy")
    (folder / "windy.py").write_text(WINDY)
    (folder / "windy.toml").write_text(WINDY_TABLE)
    return load_table(str(folder / "windy.toml"))


def scene(*cars: tuple[float, float, float]) -> Observation:
    """Return a robot at 25 m/s in lane 1 and cars at (x, y, speed)."""
    x, y, speed = np.array(cars, float).reshape(-1, 3).T
    count = len(cars)
    return Observation(
        time=0.0, robot=np.array([0.0, 4.0, 0.0, 25.0]), robot_acceleration=0.0, vehicle=np.arange(count), x=x, y=y,
        heading=np.zeros(count), speed=speed, acceleration=np.zeros(count), lane=np.round(y / 4.0).astype(int),
        length=np.full(count, 5.0), width=np.full(count, 2.0), target_lane=np.round(y / 4.0).astype(int),
    )  # fmt: skip


def test_the_highways_closed_rows_are_those_that_its_flow_gives(sheared_table: ValueTable) -> None:
    from_flow = dataclasses.replace(sheared_table, game=dataclasses.replace(sheared_table.game, closed_rows=None))
    generator = np.random.default_rng(3)
    places = [generator.uniform(low, high, 300) for low, high in ((-150.0, 150.0), (-3.0, 11.0), (0.0, 39.0))]
    places[2][:20] = 0.0  # who stands does not brake
    seen = scene(*zip(*places, strict=True))
    values = car_values(sheared_table, seen)
    cars, closed = rows_of_cars(sheared_table, seen, values.value, values.gradient, 5.0)
    others, rows = rows_of_cars(from_flow, seen, values.value, values.gradient, 5.0)
    assert 20 < len(cars) < 300
    assert cars.tolist() == others.tolist() == np.flatnonzero(values.value <= 5.0).tolist()
    assert closed[:4] == pytest.approx(rows, rel=1e-3, abs=1e-2)


def test_rows_of_a_game_of_ones_own_are_the_least_rise_of_v_that_trying_finds(windy: ValueTable) -> None:
    states = windy.draw_states(100, np.random.default_rng(6))
    gradients = windy.gradient(states)
    *coefficients, least = windy.half_planes(states, gradients)
    for omega, acceleration in itertools.product((-0.3, 0.1), (-6.0, 2.0)):
        control = np.tile([omega, acceleration], (100, 1))
        rises = [
            (
                gradients * windy.game.state_derivative(states, control, np.full((100, 1), a), windy.parameter_array())
            ).sum(1)
            for a in np.linspace(-5.0, 5.0, 11)
        ]
        promised = coefficients[0] * omega + coefficients[1] * acceleration + least
        assert promised == pytest.approx(np.min(rises, axis=0), rel=1e-3, abs=2e-3)


def test_a_game_of_ones_own_is_looked_up_filtered_and_planned_with(windy: ValueTable) -> None:
    assert windy.game.name == "windy"
    states = windy.draw_states(50, np.random.default_rng(7))
    assert values_and_gradients(*windy.arrays, states)[0] == pytest.approx(windy.value(states))
    robot, road = RobotSettings(), StraightRoad(4)
    spc = make_filter(FilterSettings(kind="spc", keep_escape=False), robot, road, windy, 0.02)
    close = scene((12.0, 4.0, 15.0))
    values = car_values(windy, close)
    result = spc.filter(close, values, Control(0.0, 3.0))
    assert result.constraints == 1
    assert result.control.acceleration < 0.0
    assert values.least == pytest.approx(windy.value(np.array([-12.0, 0.0, 0.0, 25.0, 15.0]))[0])
    planner = make_planner(PlannerSettings(expansions=100), robot, DriverSettings(), road, windy)
    assert planner.plan(close, Target(1, 25.0)).target.speed <= 25.0


def test_a_game_without_manoeuvres_says_so_where_an_escape_is_to_be_kept(windy: ValueTable) -> None:
    with pytest.raises(TableError, match=r"windy.*keep_escape=false"):
        make_filter(FilterSettings(kind="spc", keep_escape=True), RobotSettings(), StraightRoad(4), windy, 0.02)
    with pytest.raises(TableError, match="no manoeuvres are known for the game windy"):
        windy.guaranteed(np.zeros((1, 5)))


def test_a_slice_of_a_game_of_ones_own_is_drawn(windy: ValueTable) -> None:
    data = draw_slice(windy, {"p_y": 1.0}, over=("p_x", "v_r")).data.sample(20, random_state=0)
    states = np.column_stack([data.p_x, np.ones(20), np.zeros(20), data.v_r, np.full(20, 20.0)])  # mid-grid
    assert data.value.to_numpy() == pytest.approx(windy.value(states))


@pytest.mark.parametrize("name", ["highway", "air3d", "double_integrator"])
def test_states_and_points_of_the_grid_are_each_others_inverse(name: str) -> None:
    game = find_game(name)
    parameters = {**game.parameters, "braking_shear": 0.1}
    states = np.random.default_rng(8).uniform(0.0, 30.0, (50, game.dimension))
    points = game.grid_points(states, parameters)
    assert game.states_at(points, parameters) == pytest.approx(states)
    moved = 0.1 * (states[:, 3] ** 2 - states[:, 4] ** 2) if name == "highway" else 0.0
    assert points[:, 0] - states[:, 0] == pytest.approx(moved)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"boundary": ("linear",)}, "boundary has 1 entries; the state has 3"),
        ({"angles": ("theta",)}, "'theta' is no state variable"),
        ({"slab_axes": (1, 1)}, "two state variables or more"),
        ({"shear": find_game("highway").shear}, "shear needs the state p_x"),
    ],
)
def test_a_game_with_a_wrong_fact_is_refused_in_a_sentence(wrong: dict[str, object], complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=complaint):
        dataclasses.replace(find_game("air3d"), **wrong)  # type: ignore[arg-type]


def test_a_wrong_fact_in_a_file_of_ones_own_is_named_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "windy.py").write_text(WINDY.replace('angles=("theta",)', 'angles=("psi",)'))
    with pytest.raises(ConfigurationError, match=r"windy\.py.*'psi' is no state variable"):
        find_game("windy.py", tmp_path)


def test_the_name_that_earlier_files_give_their_game_still_serves(tmp_path: Path) -> None:
    earlier = WINDY.replace("TWO_CARS, Game,", "TWO_CARS, Dynamics,").replace("game = Game(", "dynamics = Dynamics(")
    (tmp_path / "windy.py").write_text(earlier)
    assert find_game("windy.py", tmp_path).name == "windy"


def test_every_game_that_comes_with_the_package_says_which_variables_are_angles() -> None:
    angles = {name: game.angles for name, game in registered_games().items()}
    assert angles == {"highway": ("theta",), "highway_ttc": ("theta",), "air3d": ("psi",), "double_integrator": ()}
