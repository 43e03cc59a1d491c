"""Games played out in the model's own dynamics: does a trajectory keep what the table promised at its start?"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hj_cosim.reachability.table.table import ValueTable

# States (N, n) to controls (N, controls).
Policy = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Rollouts:
    """N games from N states."""

    starts: np.ndarray  # (N, n)
    promised: np.ndarray  # (N,) V at the start
    realised: np.ndarray  # (N,) least V(0, ·) along the trajectory

    @property
    def shortfall(self) -> np.ndarray:
        """How far the realised minimum fell below the promise, (N,); 0 or less where it was kept."""
        return self.promised - self.realised


def states_near_zero(table: ValueTable, count: int, band: float, generator: np.random.Generator) -> np.ndarray:
    """Return random states of the grid with |V| <= band, (count, n), or fewer where there are hardly any."""
    found: list[np.ndarray] = []
    for _ in range(1000):
        states = table.draw_states(max(10_000, count), generator)
        found.append(states[np.abs(table.value(states)) <= band])
        if sum(map(len, found)) >= count:
            break
    return np.concatenate(found)[:count]


def play(
    table: ValueTable, starts: np.ndarray, *, duration: float, step: float = 0.02, control: Policy | None = None
) -> Rollouts:
    """Play the game from `starts` against the disturbance that lowers the table's value most.

    Both sides hold their inputs for a step, as a digital controller does; the dynamics are integrated by the
    midpoint rule.

    Args:
        table: whose gradients decide.
        starts: (N, n).
        duration: s.
        step: s.
        control: who plays against the disturbance; the table's optimal control unless given.
    """
    policy = control or table.optimal_control
    parameters = table.parameter_array()
    states = np.array(starts, np.float64)
    realised = table.target_values(states).astype(np.float64)
    for _ in range(round(duration / step)):
        u, d = policy(states), table.optimal_disturbance(states)
        rate = table.game.state_derivative(states, u, d, parameters)
        rate = table.game.state_derivative(states + 0.5 * step * rate, u, d, parameters)
        states = _within_limits(table, states + step * rate)
        realised = np.minimum(realised, table.target_values(states))
    return Rollouts(starts, table.value(starts), realised)


def _within_limits(table: ValueTable, states: np.ndarray) -> np.ndarray:
    """Stop at the state's limits, which a step of finite length may overrun."""
    limits = table.state_limits().astype(np.float64)
    return np.clip(states, limits[0], limits[1])
