"""Whether the filter kept its promise: V of the cars in K did not fall, wherever the rows could be met together."""

import numpy as np
from numba import njit

from hj_cosim.control.problem.nearest_control import RowsDecision
from hj_cosim.reachability.table.lookup import value_at
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.stack import TableStack, grid_in
from hj_cosim.scene.observation import Cars, Observation


@njit(cache=True)
def _values_of(stack: TableStack, robot: np.ndarray, wanted: np.ndarray, cars: Cars) -> np.ndarray:
    """Return V of the cars numbered `wanted`, (K,); NaN for one that is not there."""
    values, numbers = np.full(len(wanted), np.nan), stack.numbers
    for k in range(len(wanted)):
        for j in range(len(cars.vehicle)):
            if cars.vehicle[j] == wanted[k]:
                length, width = cars.length[j], cars.width[j]
                kind = class_of(numbers, length, width)
                p_x, p_y = offsets_in_class(numbers, kind, robot[0] - cars.x[j], robot[1] - cars.y[j], length, width)
                grid = grid_in(numbers, kind)
                values[k] = value_at(stack.flat, grid, p_x, p_y, robot[2], robot[3], cars.speed[j])
                break
    return values


def realised_value_rates(
    tables: TableStack, before: Observation, after: Observation, vehicles: np.ndarray
) -> np.ndarray:
    """Return dV/dt between two observations, per car.

    Args:
        tables: V.
        before, after: the instants at which a control was chosen and at which it had been applied.
        vehicles: (K,) int, the cars' numbers; those of a decision's rows.

    Returns:
        (K,) m/s; NaN for a car that is not in both, +inf for one that has left the table.
    """
    first, second = (_values_of(tables, seen.robot, vehicles, seen.cars) for seen in (before, after))
    return (second - first) / (after.time - before.time)


def promise_kept(
    tables: TableStack,
    decision: RowsDecision,
    before: Observation,
    after: Observation,
    *,
    epsilon: float,
    tolerance: float,
) -> bool | None:
    """Return whether no V in K fell faster than `tolerance` over the step that a decision was applied for.

    Cars with V above ε may have rows, too: they hold how fast V approaches ε, and it may fall.

    Args:
        tables: V.
        decision: SPC's, for the observation `before`.
        before, after: the instants at which the control was chosen and at which it had been applied.
        epsilon: ε, m: K are the cars with V at most this.
        tolerance: m/s, for the gradient that changes within a step and from cell to cell of the table.

    Returns:
        None where nothing was promised: K is empty, the rows cannot be met together, or no car of K is in both.
    """
    if not decision.constrained or not decision.meetable:
        return None
    in_k = decision.rows.vehicle[decision.rows.value <= epsilon]
    rates = realised_value_rates(tables, before, after, in_k)
    rates = rates[~np.isnan(rates)]
    if len(rates) == 0:
        return None
    return bool(rates.min() >= -tolerance)
