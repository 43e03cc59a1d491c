import itertools
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reference import hamiltonian_values

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import Game

UNLIMITED = np.array([[-np.inf], [np.inf]], np.float32)

USER_DYNAMICS = """
from hj_cosim.reachability.games.contract import Game, state_function

@state_function
def target(x, c, out):
    for i in range(out.shape[0]):
        out[i] = abs(x[0, i]) - c[1]

@state_function
def flow(x, u, d, c, out):
    for i in range(out.shape[1]):
        out[0, i] = u[0, i]
        out[1, i] = 0.0

@state_function
def hamiltonian(x, p, c, limits, out):
    for i in range(out.shape[0]):
        out[i] = c[0] * abs(p[0, i])

@state_function
def dissipation(x, c, out):
    for i in range(out.shape[1]):
        out[0, i] = c[0]
        out[1, i] = 0.0

@state_function
def optimal_inputs(x, p, c, limits, u, d):
    for i in range(u.shape[1]):
        u[0, i] = c[0] if p[0, i] > 0.0 else -c[0]

game = Game(
    name="walker", state=("x", "y"), controls=("speed",), disturbances=(), parameters={"speed": 1.0, "radius": 0.5},
    target=target, flow=flow, hamiltonian=hamiltonian, dissipation=dissipation, optimal_inputs=optimal_inputs,
    boundary=("linear", "linear"), outside=("safe", "clamp"), limited=(False, False), slab_axes=(0, 1),
)
"""


def parameters_of(game: Game) -> np.ndarray:
    return game.parameter_values({}, "test")


def input_bounds(game: Game) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    c = dict(game.parameters)
    if game.name == "highway":
        return (
            [(-c["omega_max"], c["omega_max"]), (c["acceleration_min"], c["acceleration_max"])],
            [
                (-c["other_heading_max"], c["other_heading_max"]),
                (c["other_acceleration_min"], c["other_acceleration_max"]),
            ],
        )
    if game.name == "air3d":
        return (
            [(-c["evader_turn_rate"], c["evader_turn_rate"])],
            [(-c["pursuer_turn_rate"], c["pursuer_turn_rate"])],
        )
    return [(-c["acceleration"], c["acceleration"])], []


def random_states(game: Game, count: int) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(1)
    scale = {"highway": (50.0, 6.0, 0.3, 15.0, 15.0), "air3d": (10.0, 10.0, 3.0), "double_integrator": (2.0, 2.0)}
    states = generator.uniform(-1.0, 1.0, (count, game.dimension)) * scale[game.name]
    if game.name == "highway":
        states[:, 3:] += 18.0
    gradients = generator.normal(size=(count, game.dimension)) * generator.choice([0.1, 1.0, 10.0], (count, 1))
    return states, gradients


@pytest.mark.parametrize("name", ["highway", "air3d", "double_integrator"])
def test_the_hamiltonian_is_what_trying_all_inputs_finds(name: str) -> None:
    game = find_game(name)
    c, limits = parameters_of(game), np.tile(UNLIMITED, (1, game.dimension))
    states, gradients = random_states(game, 200)
    control_bounds, disturbance_bounds = input_bounds(game)
    found = np.full(len(states), -np.inf)
    for u in itertools.product(*(np.linspace(low, high, 3) for low, high in control_bounds)):
        worst = np.full(len(states), np.inf)
        for d in itertools.product(*(np.linspace(low, high, 201 if name == "highway" and not k else 3)
                                     for k, (low, high) in enumerate(disturbance_bounds))):  # fmt: skip
            rate = game.state_derivative(
                states, np.tile(u, (len(states), 1)), np.tile(d, (len(states), 1)).reshape(len(states), -1), c
            )
            worst = np.minimum(worst, (rate * gradients).sum(axis=1))
        found = np.maximum(found, worst)
    closed = hamiltonian_values(game, states, gradients, c, limits)
    assert closed == pytest.approx(found, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("name", ["highway", "air3d", "double_integrator"])
def test_the_optimal_inputs_attain_the_hamiltonian(name: str) -> None:
    game = find_game(name)
    c, limits = parameters_of(game), np.tile(UNLIMITED, (1, game.dimension))
    states, gradients = random_states(game, 200)
    u, d = game.optimal(states, gradients, c, limits)
    attained = (game.state_derivative(states, u, d, c) * gradients).sum(axis=1)
    assert attained == pytest.approx(hamiltonian_values(game, states, gradients, c, limits), rel=1e-4, abs=1e-3)


def test_a_sheared_grid_has_the_same_hamiltonian_along_its_own_slopes() -> None:
    game, shear = find_game("highway"), 1.0 / 12.0
    limits = np.tile(UNLIMITED, (1, game.dimension))
    states, slopes = random_states(game, 500)
    plain, sheared = (game.parameter_values({"braking_shear": each}, "the test") for each in (0.0, shear))
    # ξ = p_x − k (v_o² − v_r²): what V does along v_r at the same p_x is what it does at the same ξ and what ξ adds.
    gradients = slopes.copy()
    gradients[:, 3] += 2.0 * shear * states[:, 3] * slopes[:, 0]
    gradients[:, 4] -= 2.0 * shear * states[:, 4] * slopes[:, 0]
    points = states.copy()
    points[:, 0] -= shear * (states[:, 4] ** 2 - states[:, 3] ** 2)
    expected = hamiltonian_values(game, states, gradients, plain, limits)
    assert hamiltonian_values(game, points, slopes, sheared, limits) == pytest.approx(expected, rel=1e-4, abs=1e-2)
    assert game.target_values(points, sheared) == pytest.approx(game.target_values(states, plain), rel=1e-4, abs=1e-2)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("highway", {}), ("highway", {"braking_shear": 1.0 / 12.0}), ("air3d", {}), ("double_integrator", {})],
)
def test_the_dissipation_bounds_every_slope_of_the_hamiltonian(name: str, parameters: dict[str, float]) -> None:
    game = find_game(name)
    c, limits = game.parameter_values(parameters, "the test"), np.tile(UNLIMITED, (1, game.dimension))
    states, gradients = random_states(game, 200)
    bound = np.empty((game.dimension, 1), np.float32)
    here = hamiltonian_values(game, states, gradients, c, limits)
    for axis in range(game.dimension):
        moved = gradients.copy()
        moved[:, axis] += 0.5
        slope = np.abs(hamiltonian_values(game, states, moved, c, limits) - here) / 0.5
        for row, state in enumerate(states):
            game.dissipation(state.astype(np.float32)[:, None], c, bound)
            assert slope[row] <= bound[axis, 0] + 0.02


def test_no_input_leads_out_of_the_state_limits() -> None:
    game = find_game("highway")
    limits = np.array([[-np.inf, -np.inf, -0.4, 0.0, 0.0], [np.inf, np.inf, 0.4, 40.0, 40.0]], np.float32)
    states = np.array([[0.0, 3.0, 0.4, 0.0, 40.0], [0.0, 3.0, -0.4, 40.0, 0.0]])
    gradients = np.array([[0.0, 0.0, 1.0, -1.0, -1.0], [0.0, 0.0, -1.0, 1.0, 1.0]])
    u, d = game.optimal(states, gradients, parameters_of(game), limits)
    assert (u == 0.0).all()
    assert (d[:, 1] == 0.0).all()
    assert hamiltonian_values(game, states, gradients, parameters_of(game), limits) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("state", "value", "tolerance"),
    [
        ((-28.0, 0.0, 0.0, 25.0, 22.0), 0.0, 0.3),  # following at 25 behind 22 m/s
        ((28.2, 0.0, 0.0, 22.0, 25.0), 0.0, 0.1),  # the same pair, the robot in front
        ((0.0, 4.0, 0.0, 25.0, 25.0), 4.0 * (4.0 - 2.0 - 0.1225) ** 3, 0.05),
    ],
)
def test_the_target_is_rss_between_bumpers(state: tuple[float, ...], value: float, tolerance: float) -> None:
    game = find_game("highway")
    assert game.target_values(np.array([state]), parameters_of(game))[0] == pytest.approx(value, abs=tolerance)


def test_heading_towards_the_other_car_is_less_safe_than_away_from_it() -> None:
    game = find_game("highway")
    states = np.array([[0.0, 4.0, heading, 25.0, 25.0] for heading in (-0.05, 0.0, 0.05)])
    towards, straight, away = game.target_values(states, parameters_of(game))
    assert towards < straight < away
    mirrored = states * np.array([1.0, -1.0, -1.0, 1.0, 1.0])
    assert game.target_values(mirrored, parameters_of(game)) == pytest.approx([towards, straight, away])


def test_the_target_mirrors_itself_right_ahead_too() -> None:
    game = find_game("highway")
    ahead = game.target_values(np.array([[2.0, 0.0, s * 0.2, 20.0, 20.0] for s in (-1.0, 1.0)]), parameters_of(game))
    assert ahead[0] == ahead[1]
    assert not math.isnan(ahead[0])


def test_a_user_game_in_a_file_of_its_own_is_found(tmp_path: Path) -> None:
    (tmp_path / "walker.py").write_text(USER_DYNAMICS)
    game = find_game("walker.py", tmp_path)
    assert game.name == "walker"
    assert game.fingerprint


def test_a_file_of_ones_own_is_solved_again_in_another_process(tmp_path: Path) -> None:
    (tmp_path / "walker.py").write_text(USER_DYNAMICS)
    (tmp_path / "mine.toml").write_text(
        'dynamics = "walker.py"\nhorizon = 0.3\nscheme = "first_order"\n'
        "[grid]\nlower = [-2.0, -1.0]\nupper = [2.0, 1.0]\nshape = [41, 11]\n"
    )
    solve = f"from hj_cosim import solve_table; print(solve_table({str(tmp_path / 'mine.toml')!r}).values.min())"
    printed = [
        subprocess.run([sys.executable, "-c", solve], capture_output=True, text=True, check=True).stdout
        for _ in range(2)  # the second one loads what the first one compiled
    ]
    assert printed == ["-0.5\n", "-0.5\n"]


@pytest.mark.parametrize(
    ("source", "complaint"),
    [("import nonsense_module", "fails on import"), ("x = 1", "must define"), ("def broken(:", "fails on import")],
)
def test_a_file_that_is_no_game_is_refused_in_a_sentence(tmp_path: Path, source: str, complaint: str) -> None:
    (tmp_path / "broken.py").write_text(source)
    with pytest.raises(ConfigurationError, match=complaint):
        find_game("broken.py", tmp_path)


def test_an_unknown_game_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match="highway, highway_ttc, air3d, double_integrator"):
        find_game("hyghway")


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="omega_maximum"):
        find_game("highway").parameter_values({"omega_maximum": 1.0}, "spec.toml")
