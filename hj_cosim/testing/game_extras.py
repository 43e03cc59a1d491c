"""What a game has beyond being solved, checked against its functions: symmetries, shear, formula, rows for a filter."""

import math

import numpy as np

from hj_cosim.reachability.games.contract import TWO_CARS, RowsOfCars
from hj_cosim.reachability.games.highway.target import TargetFormula, target_and_gradient_at, target_at
from hj_cosim.scene.observation import Cars
from hj_cosim.testing.expectations import ContractError, require
from hj_cosim.testing.game_samples import ABSOLUTE, NODES, GameSamples, Slab, alike, listed, where


def check_extras(samples: GameSamples, slab: Slab) -> None:
    """Check all that a game has of it.

    Raises:
        ContractError: one sentence on the first thing that is wrong.
    """
    _check_symmetries(samples, slab)
    _check_shear(samples, slab)
    if samples.game.target_formula is not None:
        _check_formula(samples, slab, samples.game.target_formula(samples.parameters))
    if samples.game.state == TWO_CARS:
        _check_affine(samples, slab)
    if samples.game.closed_rows is not None:
        _check_closed_rows(samples, slab, samples.game.closed_rows(samples.parameters))


def _check_symmetries(samples: GameSamples, slab: Slab) -> None:
    """Check that mirrored states, and both ends of a periodic axis, are told apart by nothing."""
    game = samples.game
    here, rises = samples.target(slab.points), samples.hamiltonian(*slab)
    mirrored = np.ones((game.dimension, 1), np.float32)
    mirrored[list(game.mirrored_axes)] = -1.0
    if game.mirrored_axes:
        inside = _within(samples, slab.points * mirrored)
        axes = ", ".join(game.state[axis] for axis in game.mirrored_axes)
        _require_same(samples, slab, inside, (here, samples.target(slab.points * mirrored)), f"mirrored in {axes}")
        there = samples.hamiltonian(slab.points * mirrored, slab.slopes * mirrored)
        _require_same(samples, slab, inside, (rises, there), f"mirrored in {axes}, slopes as well,")
    for axis in (axis for axis in range(game.dimension) if game.boundary[axis] == "periodic"):
        low, high = slab.points.copy(), slab.points.copy()
        low[axis], high[axis] = samples.lower[axis], samples.upper[axis]
        everywhere, end = np.ones(NODES, bool), f"at the other end of the periodic axis {game.state[axis]}"
        _require_same(samples, Slab(low, slab.slopes), everywhere, (samples.target(low), samples.target(high)), end)
        ends = (samples.hamiltonian(low, slab.slopes), samples.hamiltonian(high, slab.slopes))
        _require_same(samples, Slab(low, slab.slopes), everywhere, ends, end)


def _within(samples: GameSamples, points: np.ndarray) -> np.ndarray:
    below, above = points >= samples.lower[:, None], points <= samples.upper[:, None]
    return np.asarray((below & above).all(axis=0))


def _require_same(
    samples: GameSamples, slab: Slab, compared: np.ndarray, pair: tuple[np.ndarray, np.ndarray], other: str
) -> None:
    scale = np.abs(slab.slopes * samples.dissipation(slab.points)).sum(axis=0)
    for node in where(compared & ~alike(*pair, scale)):
        raise ContractError(
            f"{samples.game.name}: target or hamiltonian is {pair[0][node]:g} {samples.at(slab.points, node)} and"
            f" {pair[1][node]:g} {other}; they have to be the same"
        )


def _check_shear(samples: GameSamples, slab: Slab) -> None:
    """Check that a sheared grid's points are the states', and its target theirs."""
    shear = samples.game.shear
    if shear is None:
        return
    back = samples.game.grid_points(samples.game.states_at(slab.points.T, samples.parameters), samples.parameters).T
    require(
        bool(alike(back, slab.points, np.abs(slab.points).max()).all()),
        f"{samples.game.name}: shear: grid_points and states_at are not each other's inverse",
    )
    states = samples.states_at(slab.points)
    plain = samples.game.parameter_values({**samples.parameters, shear.parameter: 0.0}, samples.game.name)
    found, expected = samples.target(slab.points), samples.target(states, plain)
    for node in where(~alike(found, expected, np.abs(states[0]) + np.abs(slab.points[0]))):
        raise ContractError(
            f"{samples.game.name}: target is {found[node]:g} at the sheared grid's point and {expected[node]:g} at its"
            f" state, {samples.at(states, node)}; target takes the grid's coordinates"
        )


def _check_formula(samples: GameSamples, slab: Slab, formula: TargetFormula) -> None:
    """Check V(0, ·) by formula against the function, and its slopes against differences where it has no kink."""
    name, states = samples.game.name, samples.game.states_at(slab.points.T.astype(np.float64), samples.parameters)
    expected = samples.target(slab.points)
    for node, state in enumerate(states):
        value, *slopes = target_and_gradient_at(formula, *state)
        reach = np.abs(state[0]) + np.abs(slab.points[0, node])
        place = samples.at(states.T, node)
        for found in (value, target_at(formula, *state)):
            same = bool(alike(np.float64(found), expected[node], reach))
            require(same, f"{name}: target_formula is {found:g} and target {expected[node]:g} {place}")
        for axis, unit in enumerate(np.eye(samples.game.dimension)):
            ahead, behind = (
                way * (target_at(formula, *(state + way * 1e-5 * unit)) - value) / 1e-5 for way in (1.0, -1.0)
            )
            if abs(ahead - behind) <= 1e-3 * (1.0 + abs(ahead)):
                same = abs(slopes[axis] - ahead) <= 2e-3 * (1.0 + abs(ahead))
                along = f"along {samples.game.state[axis]}"
                require(same, f"{name}: target_formula's slope {along} is {slopes[axis]:g} and not {ahead:g} {place}")


def _check_affine(samples: GameSamples, slab: Slab) -> None:
    """Check that a filter's half-planes say what the flow does: it is affine in the controls."""
    states, gradients = samples.states_at(slab.points), samples.gradients_at(*slab)
    u, d = samples.optimal_inputs(states, gradients)
    ends = samples.flow(states, u, d), samples.flow(states, np.zeros_like(u), d)
    middle, between = samples.flow(states, 0.5 * u, d), 0.5 * (ends[0] + ends[1])
    for axis, node in np.argwhere(~alike(middle, between, np.maximum(np.abs(ends[0]), np.abs(ends[1])))):
        raise ContractError(
            f"{samples.game.name}: d{samples.game.state[axis]}/dt is {middle[axis, node]:g} at half the control"
            f" {listed(u[:, node])} and {between[axis, node]:g} between all of it and none, {samples.at(states, node)};"
            " the flow of two cars has to be affine in the controls, or no filter can use it"
        )


def _check_closed_rows(samples: GameSamples, slab: Slab, closed: RowsOfCars) -> None:
    """Check closed rows against those that follow from the flow."""
    states = samples.states_at(slab.points).T.astype(np.float64)
    states[:, 2:4] = states[0, 2:4]  # one robot
    gradients = samples.gradients_at(*slab).T.astype(np.float64)
    robot, zeros = np.array([0.0, 0.0, *states[0, 2:4]]), np.zeros(NODES)
    sizes = zeros + samples.parameters.get("length", 5.0), zeros + samples.parameters.get("width", 2.0)
    cars = Cars(np.arange(NODES), -states[:, 0], -states[:, 1], zeros, states[:, 4], *sizes)
    values = np.linspace(-1.0, 1.0, NODES)
    chosen, rows = closed(robot, cars, values, gradients, 0.5)
    near = np.flatnonzero(values <= 0.5)
    require(
        np.array_equal(chosen, near) and np.array_equal(rows[0], values[near]),
        f"{samples.game.name}: closed_rows of a bound of 0.5 are not those of the cars with V up to it",
    )
    unlimited = np.array([[-math.inf], [math.inf]], np.float32).repeat(5, axis=1)
    unlimited[0, 3:] = 0.0  # cars do not drive backwards
    planes = samples.game.half_planes(samples.parameters, unlimited)(states[near], gradients[near])
    speeds = np.abs(gradients[near]).sum(axis=1) * max(1.0, np.abs(states[:, 3:]).max())
    require(len(rows) in (4, 8), f"{samples.game.name}: closed_rows has {len(rows)} rows a car; 4 or 8 are right")
    for row, node in np.argwhere(~alike(rows[1:4], planes, speeds)):
        raise ContractError(
            f"{samples.game.name}: closed_rows has {rows[1 + row, node]:g} in row {1 + row} and the flow gives"
            f" {planes[row, node]:g} {samples.at(states[near].T, node)}, ∇V = {listed(gradients[near][node])}"
        )
    for node in where(rows[4] > rows[0] + ABSOLUTE) if len(rows) == 8 else ():
        raise ContractError(
            f"{samples.game.name}: closed_rows has {rows[4, node]:g} to be kept instead of V = {rows[0, node]:g}"
            f" {samples.at(states[near].T, node)}; it has to be nowhere above V"
        )
