import dataclasses
from pathlib import Path

import numpy as np
import pytest
from peer_cases import air3d, highway, sampled_nodes
from reference import solve_first_order

from hj_cosim.errors import TableError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.solver.schemes import PITCH, SCHEMES
from hj_cosim.reachability.solver.solver import solve
from hj_cosim.reachability.table.store import solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import GridSettings, TableSpecification

FIXTURES = Path(__file__).resolve().parent / "fixtures"


def changed(specification: TableSpecification, **grid: object) -> TableSpecification:
    settings = GridSettings.model_validate(specification.grid.model_dump() | grid)
    return specification.model_copy(update={"grid": settings})


def braking_tube(position: np.ndarray, velocity: np.ndarray, horizon: float, half_width: float) -> np.ndarray:
    """V of the double integrator with |u| <= 1: the least of |position| − half_width under the best of full throttle
    either way, by dense sampling of the parabola's time."""
    times = np.linspace(0.0, horizon, 2001)
    best = np.full(position.shape, -np.inf)
    for push in (-1.0, 1.0):
        least = np.full(position.shape, np.inf)
        for t in times:
            least = np.minimum(least, np.abs(position + velocity * t + 0.5 * push * t * t) - half_width)
        best = np.maximum(best, least)
    return best


@pytest.mark.parametrize("boundary", ["linear", "away_from_zero"])
def test_the_kernel_computes_what_the_formulas_say(highway_small: TableSpecification, boundary: str) -> None:
    specification = changed(highway_small, shape=(11, 9, 7, 7, 8), boundary=(boundary,) * 5)
    specification = specification.model_copy(update={"horizon": 0.3})
    expected = solve_first_order(specification, find_game("highway"))
    assert solve_table(specification).values == pytest.approx(expected, abs=1e-3)


def test_a_periodic_axis_wraps_as_the_formulas_say() -> None:
    specification = air3d().model_copy(update={"scheme": "first_order", "horizon": 0.5})
    specification = changed(specification, shape=(15, 12, 10))
    expected = solve_first_order(specification, find_game("air3d"))
    assert solve_table(specification).values == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("shape", [(21, 12, 7, 8, 9), (21, 13, 8, 9, 7)])
@pytest.mark.parametrize("scheme", ["first_order", "weno5"])
def test_half_of_a_mirrored_grid_gives_what_the_whole_gives(
    highway_small: TableSpecification, scheme: str, shape: tuple[int, ...]
) -> None:
    specification = changed(highway_small, shape=shape).model_copy(update={"scheme": scheme, "horizon": 0.2})
    game = find_game("highway")
    half, _ = solve(specification, game, "test")
    whole, _ = solve(specification, dataclasses.replace(game, mirrored_axes=()), "test")
    assert np.isfinite(whole).all()
    np.testing.assert_allclose(half, whole, rtol=1e-6, atol=1e-3)  # pytest.approx would take longer than solving
    # Straight ahead both headings are stored, and solved apart.
    np.testing.assert_allclose(half, half[:, ::-1, ::-1], rtol=1e-6, atol=1e-5)


def test_the_solution_does_not_depend_on_how_slabs_are_cut(braking: TableSpecification) -> None:
    game = find_game("double_integrator")
    fine = changed(braking, shape=(301, 41)).model_copy(update={"scheme": "weno5"})
    along_position, _ = solve(fine, game, "test")
    along_velocity, _ = solve(fine, dataclasses.replace(game, slab_axes=(0, 1)), "test")
    assert along_position == pytest.approx(along_velocity, abs=1e-4)


@pytest.mark.parametrize(("scheme", "order"), [("first_order", 0.7), ("eno2", 1.0), ("weno3", 1.0), ("weno5", 1.2)])
def test_the_tube_of_the_double_integrator_converges_to_the_analytic_one(
    braking: TableSpecification, scheme: str, order: float
) -> None:
    errors = []
    for nodes in (41, 81, 161):
        specification = changed(braking, shape=(nodes, nodes)).model_copy(update={"scheme": scheme})
        table = solve_table(specification)
        position, velocity = np.meshgrid(*table.grid.axes, indexing="ij")
        exact = braking_tube(position, velocity, 1.0, 0.5)
        # Away from the faces, from which errors travel inwards, and from the speed limit.
        inside = (np.abs(position) < 2.0) & (np.abs(velocity) < 0.9)
        errors.append(np.abs(table.values - exact)[inside].mean())
    measured = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert measured.mean() > order
    assert errors[-1] < 0.02


def test_the_game_of_two_aircraft_agrees_with_the_peer() -> None:
    ours = solve_table(air3d()).values
    theirs = np.load(FIXTURES / "peer_air3d.npz")["values"]
    assert np.mean((ours <= 0) == (theirs <= 0)) >= 0.999
    assert np.mean(ours <= 0) == pytest.approx(np.mean(theirs <= 0), rel=1e-3)
    assert np.abs(ours - theirs)[np.abs(theirs) < 5].max() < 0.02


@pytest.mark.parametrize(
    ("scheme", "percentile", "tolerance"),
    [("first_order", 100.0, 0.02), ("eno2", 99.9, 0.3), ("weno3", 99.9, 0.3), ("weno5", 99.9, 0.3)],
)
def test_the_highway_game_agrees_with_the_peer(scheme: str, percentile: float, tolerance: float) -> None:
    specification = highway(scheme)  # type: ignore[arg-type]
    ours = solve_table(specification).values.reshape(-1)[sampled_nodes(specification.grid.shape, 20_000)]
    theirs = np.load(FIXTURES / f"peer_highway_{scheme}.npz")["values"]
    near = np.abs(theirs) < 5.0
    assert np.percentile(np.abs(ours - theirs)[near], percentile) < tolerance


def test_values_stay_between_the_least_target_value_and_the_target(small_table: ValueTable) -> None:
    states = np.stack(np.meshgrid(*small_table.grid.axes, indexing="ij"), -1).reshape(-1, 5)
    target = small_table.target_values(states).reshape(small_table.values.shape)
    assert (small_table.values <= target + 1e-3).all()
    assert small_table.values.min() >= target.min() - 1e-3


def test_looking_further_ahead_never_raises_a_value(highway_small: TableSpecification, small_table: ValueTable) -> None:
    sooner = solve_table(highway_small.model_copy(update={"horizon": 1.0}))
    assert (small_table.values <= sooner.values + 1e-3).all()


def test_behind_in_the_same_lane_the_game_adds_nothing(small_table: ValueTable) -> None:
    # RSS is control-invariant where the robot brakes as hard as RSS assumes.
    behind = np.array([[-60.0, 0.0, 0.0, 30.0, 20.0], [-30.0, 0.0, 0.0, 20.0, 15.0]])
    assert small_table.value(behind) == pytest.approx(small_table.target_values(behind), abs=2.0)


def test_progress_counts_every_step(braking: TableSpecification) -> None:
    seen: list[tuple[int, int]] = []
    report = solve_table(braking, lambda done, total: seen.append((done, total))).report
    assert seen == [(number + 1, report.steps) for number in range(report.steps)]


def test_a_solve_that_is_not_finite_is_refused(braking: TableSpecification) -> None:
    specification = braking.model_copy(update={"parameters": {"half_width": float("nan")}})
    with pytest.raises(TableError, match="not finite"):
        solve_table(specification)


@pytest.mark.parametrize("bound", ["robot", "other car"])
def test_limits_of_the_state_are_a_loss_to_the_player_whose_inputs_they_take(
    highway_small: TableSpecification, bound: str
) -> None:
    idle = (
        {"other_acceleration_min": 0.0, "other_acceleration_max": 0.0}
        if bound == "robot"
        else {"omega_max": 0.0, "acceleration_min": 0.0, "acceleration_max": 0.0}
    )
    specification = changed(highway_small, shape=(21, 9, 7, 7, 7))
    specification = specification.model_copy(update={"horizon": 0.5, "parameters": idle})
    limited = solve_table(specification).values
    free = solve_table(specification.model_copy(update={"state_limits": False})).values
    loss = free - limited if bound == "robot" else limited - free
    assert loss.min() >= -1e-3
    assert loss.max() > 0.1


def jiang_peng(d: np.ndarray) -> float:
    """The left-biased WENO5 derivative of five first differences by the textbook (Osher & Fedkiw, 3.25-3.37)."""
    v1, v2, v3, v4, v5 = d.astype(float)
    stencils = np.array(
        [v1 / 3 - 7 * v2 / 6 + 11 * v3 / 6, -v2 / 6 + 5 * v3 / 6 + v4 / 3, v3 / 3 + 5 * v4 / 6 - v5 / 6]
    )
    smoothness = np.array(
        [
            13 / 12 * (v1 - 2 * v2 + v3) ** 2 + (v1 - 4 * v2 + 3 * v3) ** 2 / 4,
            13 / 12 * (v2 - 2 * v3 + v4) ** 2 + (v2 - v4) ** 2 / 4,
            13 / 12 * (v3 - 2 * v4 + v5) ** 2 + (3 * v3 - 4 * v4 + v5) ** 2 / 4,
        ]
    )
    weights = np.array([0.1, 0.6, 0.3]) / (smoothness + 1e-6) ** 2
    return float((weights * stencils).sum() / weights.sum())


def both_sides(scheme: str, differences: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the left- and the right-biased derivatives that a scheme makes of first differences (2 r, n)."""
    count = differences.shape[1]
    rows = np.zeros(len(differences) * PITCH, np.float32)
    for row, line in enumerate(differences):
        rows[row * PITCH : row * PITCH + count] = line
    centre, dissipated = np.zeros(count, np.float32), np.zeros(count, np.float32)
    SCHEMES[scheme].derivatives(rows, np.ones(count, np.float32), centre, dissipated)  # type: ignore[index]
    return centre - dissipated, centre + dissipated


def test_weno5_weighs_its_stencils_as_the_textbook_does() -> None:
    differences = np.random.default_rng(11).normal(size=(6, 500)).astype(np.float32)
    left, right = both_sides("weno5", differences)
    assert left == pytest.approx([jiang_peng(line[:5]) for line in differences.T], abs=2e-5)
    assert right == pytest.approx([jiang_peng(line[:0:-1]) for line in differences.T], abs=2e-5)


@pytest.mark.parametrize(("scheme", "degree"), [("first_order", 1), ("eno2", 2), ("weno3", 2), ("weno5", 3)])
def test_a_scheme_is_exact_for_polynomials_of_its_stencils_degree(scheme: str, degree: int) -> None:
    radius = SCHEMES[scheme].radius  # type: ignore[index]
    places = np.arange(-radius, radius + 1.0)
    for coefficients in np.random.default_rng(12).normal(size=(20, degree + 1)):
        values = np.polyval(coefficients, places)
        left, right = both_sides(scheme, np.diff(values)[:, None].astype(np.float32))
        assert [left[0], right[0]] == pytest.approx([coefficients[-2]] * 2, abs=1e-5)
