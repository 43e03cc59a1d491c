"""A slow solver written straight from the formulas, in NumPy and float64, to test the fast one against."""

import numpy as np

from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.solver import state_limits
from hj_cosim.settings import TableSpecification


def hamiltonian_values(
    game: Game, states: np.ndarray, gradients: np.ndarray, parameters: np.ndarray, limits: np.ndarray
) -> np.ndarray:
    """Return a game's H, (n,), at any states (n, dimension) with gradients (n, dimension), each a slab of its own."""
    out = np.empty(len(states), np.float32)
    for row, (state, gradient) in enumerate(zip(states, gradients, strict=True)):
        x, p = state.astype(np.float32)[:, None], gradient.astype(np.float32)[:, None]
        game.hamiltonian(x, p, parameters, limits, out[row : row + 1])
    return out


def pad(values: np.ndarray, axis: int, width: int, boundary: str) -> np.ndarray:
    """Return `values` with `width` ghost nodes at either end of `axis`."""
    moved = np.moveaxis(values, axis, 0)
    if boundary == "periodic":
        return np.moveaxis(np.concatenate([moved[-width:], moved, moved[:width]]), 0, axis)
    low, high = moved[0] - moved[1], moved[-1] - moved[-2]  # slopes outwards
    if boundary == "away_from_zero":
        low, high = np.sign(moved[0]) * abs(low), np.sign(moved[-1]) * abs(high)
    before = [moved[0] + k * low for k in range(width, 0, -1)]
    after = [moved[-1] + k * high for k in range(1, width + 1)]
    return np.moveaxis(np.concatenate([before, moved, after]), 0, axis)


def one_sided(values: np.ndarray, axis: int, spacing: float, boundary: str) -> tuple[np.ndarray, np.ndarray]:
    """Return first-order left and right differences."""
    padded = np.moveaxis(pad(values, axis, 1, boundary), axis, 0)
    differences = np.diff(padded, axis=0) / spacing
    return np.moveaxis(differences[:-1], 0, axis), np.moveaxis(differences[1:], 0, axis)


def solve_first_order(specification: TableSpecification, dynamics: Game) -> np.ndarray:
    """Return V(−horizon, ·) by first-order Lax-Friedrichs and Euler steps."""
    grid = Grid.from_settings(specification.grid, dynamics.boundary)
    states = np.stack(np.meshgrid(*grid.axes, indexing="ij"), -1)
    rows = states.reshape(-1, grid.dimension)
    parameters = dynamics.parameter_values(specification.parameters, "test")
    limits = state_limits(dynamics, grid, specification.state_limits)
    values = dynamics.target_values(rows, parameters).astype(np.float64).reshape(grid.shape)
    floor = values.min() if specification.clamp else -np.inf
    bounds = np.empty((len(rows), grid.dimension))
    out = np.empty((grid.dimension, 1), np.float32)
    for number, state in enumerate(rows):
        dynamics.dissipation(state.astype(np.float32)[:, None], parameters, out)
        bounds[number] = out[:, 0]
    largest = specification.cfl / (bounds / grid.spacing).sum(axis=1).max()
    time = 0.0
    while specification.horizon - time > 1e-9:
        step = min(largest, specification.horizon - time)
        sides = [one_sided(values, axis, grid.spacing[axis], grid.boundary[axis]) for axis in range(grid.dimension)]
        left = np.stack([side[0] for side in sides], -1).reshape(-1, grid.dimension)
        right = np.stack([side[1] for side in sides], -1).reshape(-1, grid.dimension)
        game = hamiltonian_values(dynamics, rows, 0.5 * (left + right), parameters, limits)
        rate = game + 0.5 * (bounds * (right - left)).sum(axis=1)
        values = np.maximum(values + step * np.minimum(rate, 0.0).reshape(grid.shape), floor)
        time += step
    return values
