"""Whether the filter kept its promise: V of the cars in K did not fall, wherever the rows could be met together."""

import numpy as np
from numba import njit

from hj_cosim.control.problem.nearest_control import RowsDecision
from hj_cosim.reachability.table.lookup import TableArrays, value_at
from hj_cosim.scene.observation import Observation


@njit(cache=True)
def _values_of(
    table: TableArrays,
    robot: np.ndarray,
    wanted: np.ndarray,
    vehicle: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """Return V of the cars numbered `wanted`, (K,); NaN for one that is not there."""
    values = np.full(len(wanted), np.nan)
    for k in range(len(wanted)):
        for j in range(len(vehicle)):
            if vehicle[j] == wanted[k]:
                values[k] = value_at(table, robot[0] - x[j], robot[1] - y[j], robot[2], robot[3], speed[j])
                break
    return values


def realised_value_rates(
    table: TableArrays, before: Observation, after: Observation, vehicles: np.ndarray
) -> np.ndarray:
    """Return dV/dt between two observations, per car.

    Args:
        table: the value table's arrays.
        before, after: the instants at which a control was chosen and at which it had been applied.
        vehicles: (K,) int, the cars' numbers; those of a decision's rows.

    Returns:
        (K,) m/s; NaN for a car that is not in both, +inf for one that has left the table.
    """
    first, second = (
        _values_of(table, seen.robot, vehicles, seen.vehicle, seen.x, seen.y, seen.speed) for seen in (before, after)
    )
    return (second - first) / (after.time - before.time)


def promise_kept(
    table: TableArrays, decision: RowsDecision, before: Observation, after: Observation, tolerance: float
) -> bool | None:
    """Return whether no V in K fell faster than `tolerance` over the step that a decision was applied for.

    Args:
        table: the value table's arrays.
        decision: SPC's, for the observation `before`.
        before, after: the instants at which the control was chosen and at which it had been applied.
        tolerance: m/s, for the gradient that changes within a step and from cell to cell of the table.

    Returns:
        None where nothing was promised: K is empty, the rows cannot be met together, or no car of K is in both.
    """
    if not decision.constrained or not decision.meetable:
        return None
    rates = realised_value_rates(table, before.as_cars, after.as_cars, decision.rows.vehicle)
    rates = rates[~np.isnan(rates)]
    if len(rates) == 0:
        return None
    return bool(rates.min() >= -tolerance)
