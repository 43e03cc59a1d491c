"""The suite for games."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import (
    DISSIPATION,
    HAMILTONIAN,
    TARGET,
    TWO_CARS,
    Game,
    pointer,
)
from hj_cosim.reachability.table.store import find_specification, read_specification
from hj_cosim.testing.expectations import ContractError, require
from hj_cosim.testing.game_extras import check_extras
from hj_cosim.testing.game_samples import (
    ABSOLUTE,
    NODES,
    OTHER_SLOPES,
    RELATIVE,
    GameSamples,
    Slab,
    alike,
    listed,
    where,
)

# Where a game is tried unless told otherwise: two cars on a road; else this far around the origin, or half a turn.
_ON_A_ROAD = ((-100.0, -8.0, -0.4, 0.0, 0.0), (100.0, 8.0, 0.4, 40.0, 40.0))
_FAR = 10.0
_ANGLE = math.pi * (1.0 + 1e-6)


def check_game(
    game: Game | str,
    *,
    lower: Sequence[float] | None = None,
    upper: Sequence[float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> None:
    """Check that a game keeps its contract, at some hundred states of a box with slopes of all sizes.

    Its functions stay within their arrays, write all of their output and nothing else, answer finitely and alike each
    time, and compile. The Hamiltonian is p · flow at the optimal inputs, and NaN where a slope is; no control that the
    game gives at the same state for other slopes does better, no disturbance worse. The dissipation bounds its slopes.
    At its limits nothing leads out. Shear, mirror, periodic axes, V(0, ·) by formula and closed rows say the same as
    the functions.

    Args:
        game: a Game; a Python file, "walker.py"; or a specification that says the box and the parameters, too: its name
            in value_tables/ or a path to a TOML file.
        lower: the least coordinates of the box, in those of the game's grid; else the specification's. Without one, of
            two cars as on a road, else −10, and −π of angles.
        upper: the greatest, likewise.
        parameters: over the game's defaults or the specification's.

    Raises:
        ContractError: one sentence on the first thing that is wrong.
        ConfigurationError: if there is no such game, or the box or a parameter is not the game's.
    """
    samples = _samples(game, lower, upper, parameters or {})
    samples.require_indices_within()
    for check in (_check_target, _check_hamiltonian, _check_dissipation, _check_limits, _check_not_a_number):
        for slab in samples.slabs():
            check(samples, slab)
    for slab in samples.slabs():
        check_extras(samples, slab)
    _check_that_it_compiles(samples.game)


def _samples(
    asked: Game | str, lower: Sequence[float] | None, upper: Sequence[float] | None, parameters: Mapping[str, float]
) -> GameSamples:
    if isinstance(asked, str) and not asked.endswith(".py"):
        specification = read_specification(find_specification(asked))
        game = find_game(specification.dynamics)
        parameters = {**specification.parameters, **parameters}
        box = (specification.grid.lower, specification.grid.upper)
        if specification.grid.boundary is not None:
            game = replace(game, boundary=specification.grid.boundary)
    else:
        game = asked if isinstance(asked, Game) else find_game(asked)
        reach = tuple(math.pi if name in game.angles else _FAR for name in game.state)
        box = _ON_A_ROAD if game.state == TWO_CARS else (tuple(-each for each in reach), reach)
    game.parameter_values(parameters, "check_game")
    low, high = np.array(box[0] if lower is None else lower), np.array(box[1] if upper is None else upper)
    if low.shape != (game.dimension,) or high.shape != (game.dimension,) or not (low < high).all():
        raise ConfigurationError(
            f"check_game: lower = {low.tolist()} and upper = {high.tolist()} are no box of {game.name};"
            f" a number for each of {', '.join(game.state)}, the lower one below the upper"
        )
    for axis, name in enumerate(game.state):
        periodic = game.boundary[axis] == "periodic"
        in_degrees = name in game.angles and not periodic and max(-low[axis], high[axis]) > _ANGLE
        require(
            not in_degrees,
            f"{game.name}: {name} is an angle and its box [{low[axis]:g}, {high[axis]:g}] reaches beyond ± π; angles"
            " are in radians",
        )
    return GameSamples(game, {**game.parameters, **parameters}, low, high)


def _column(array: np.ndarray, node: int) -> np.ndarray:
    return np.ascontiguousarray(array[:, node : node + 1])


def _check_target(samples: GameSamples, slab: Slab) -> None:
    """Check V(0, ·), which knows of each state alone."""
    together = samples.target(slab.points)
    alone = np.array([samples.target(_column(slab.points, node))[0] for node in range(NODES)])
    for node in where(~alike(together, alone)):
        raise ContractError(
            f"{samples.game.name}: target is {together[node]:g} {samples.at(slab.points, node)} among other states and"
            f" {alone[node]:g} alone"
        )


def _check_hamiltonian(samples: GameSamples, slab: Slab) -> None:
    """Check that H is the max-min of p · flow, attained by the optimal inputs and by no others bettered."""
    name, found = samples.game.name, samples.hamiltonian(*slab)
    states, gradients = samples.states_at(slab.points), samples.gradients_at(*slab)
    u, d = samples.optimal_inputs(states, gradients)
    terms = gradients * samples.flow(states, u, d)
    attained, scale = terms.sum(axis=0), np.abs(terms).sum(axis=0)
    for node in where(~alike(found, attained, scale)):
        alone = samples.hamiltonian(_column(slab.points, node), _column(slab.slopes, node))[0]
        if alike(alone, attained[node], scale[node]):
            raise ContractError(
                f"{name}: hamiltonian is {found[node]:g} in a slab and {alone:g} alone {samples.at(states, node)};"
                f" only what does not depend on {' and '.join(samples.game.state[a] for a in samples.game.slab_axes)},"
                " its slab_axes, may be computed once"
            )
        raise ContractError(
            f"{name}: hamiltonian is {found[node]:g} and p · flow at the optimal inputs {attained[node]:g}"
            f" {samples.at(states, node)}, p = {listed(gradients[:, node])}"
        )
    draw = np.random.default_rng(1)
    for _ in range(OTHER_SLOPES):
        other_u, other_d = samples.optimal_inputs(states, samples.gradients_at(slab.points, samples.some_slopes(draw)))
        for inputs, sign, whose, way in (
            ((other_u, d), 1.0, "control", "more"),
            ((u, other_d), -1.0, "disturbance", "less"),
        ):
            terms = gradients * samples.flow(states, *inputs)
            tried, margin = terms.sum(axis=0), ABSOLUTE + RELATIVE * np.maximum(scale, np.abs(terms).sum(axis=0))
            for node in where(sign * (tried - found) > margin):
                chosen = inputs[0] if whose == "control" else inputs[1]
                raise ContractError(
                    f"{name}: the {whose} {listed(chosen[:, node])} makes p · flow {tried[node]:g}, {way} than the"
                    f" hamiltonian, {found[node]:g}, {samples.at(states, node)}, p = {listed(gradients[:, node])};"
                    " optimal_inputs gives it there for other slopes"
                )


def _check_dissipation(samples: GameSamples, slab: Slab) -> None:
    """Check that no secant of H along a slope is steeper than the bound on ∂H/∂p."""
    name, bounds, here = samples.game.name, samples.dissipation(slab.points), samples.hamiltonian(*slab)
    alone = np.hstack([samples.dissipation(_column(slab.points, node)) for node in range(NODES)])
    for axis, node in np.argwhere(~alike(bounds, alone)):
        raise ContractError(
            f"{name}: dissipation along {samples.game.state[axis]} is {bounds[axis, node]:g} in a slab and"
            f" {alone[axis, node]:g} alone {samples.at(slab.points, node)}; only what does not depend on its slab_axes"
            " may be computed once"
        )
    for axis in range(samples.game.dimension):
        step = np.maximum(np.abs(slab.slopes).max(axis=0), 1.0)
        for way in (-1.0, 1.0):
            moved = slab.slopes.copy()
            moved[axis] += way * step
            there = samples.hamiltonian(slab.points, moved)
            steepness = np.abs(there - here) / step
            margin = ABSOLUTE + RELATIVE * (np.abs(bounds).sum(axis=0) + np.maximum(np.abs(here), np.abs(there)) / step)
            for node in where(steepness > bounds[axis] + margin):
                raise ContractError(
                    f"{name}: dissipation along {samples.game.state[axis]} is {bounds[axis, node]:g}, and the"
                    f" hamiltonian rises by {steepness[node]:g} a unit of that slope"
                    f" {samples.at(slab.points, node)}; the bound has to be as large"
                )


def _check_limits(samples: GameSamples, slab: Slab) -> None:
    """Check that at a limit no optimal input leads farther out than none does."""
    states = samples.states_at(slab.points)
    u, d = samples.optimal_inputs(states, samples.gradients_at(*slab))
    moving, idle = samples.flow(states, u, d), samples.flow(states, np.zeros_like(u), np.zeros_like(d))
    for axis in np.flatnonzero(samples.game.limited):
        for limit, sign in zip(samples.limits[:, axis], (-1.0, 1.0), strict=True):
            outwards = sign * moving[axis] - np.maximum(sign * idle[axis], 0.0)
            for node in where((slab.points[axis] == limit) & (outwards > ABSOLUTE)):
                raise ContractError(
                    f"{samples.game.name}: {samples.game.state[axis]} is limited, and the optimal inputs lead out of"
                    f" it {samples.at(states, node)}: u = {listed(u[:, node])}, d = {listed(d[:, node])}"
                )


def _check_not_a_number(samples: GameSamples, slab: Slab) -> None:
    """Check that H is NaN where a slope is that matters, and only there."""
    expected = samples.hamiltonian(*slab)
    for axis, name in enumerate(samples.game.state):
        moved, broken = slab.slopes.copy(), slab.slopes.copy()
        moved[axis, 0] += 1.0
        broken[axis, 0] = math.nan
        matters = samples.hamiltonian(slab.points, moved)[0] != expected[0]
        found = samples.hamiltonian(slab.points, broken)
        require(
            bool(np.isnan(found[0]) or not matters),
            f"{samples.game.name}: hamiltonian is {found[0]:g} where the slope along {name} is NaN;"
            " it has to be NaN, or a solve that went wrong looks plausible",
        )
        require(
            bool(alike(found[1:], expected[1:]).all()),
            f"{samples.game.name}: hamiltonian changes at other nodes where a slope at one is NaN",
        )


def _check_that_it_compiles(game: Game) -> None:
    for function, signature in (
        (game.target, TARGET),
        (game.hamiltonian, HAMILTONIAN),
        (game.dissipation, DISSIPATION),
    ):
        try:
            pointer(function, signature)
        except ConfigurationError as error:
            raise ContractError(f"{game.name}: {error}") from error
