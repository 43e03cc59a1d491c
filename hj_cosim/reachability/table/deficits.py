"""What a look-up interpolates instead of V, worked out once when a table is loaded (jitted); see `lookup`."""

import numpy as np
from numba import njit

from hj_cosim.reachability.games.highway.target import TargetFormula, target_at
from hj_cosim.reachability.table.value_scale import scaled


@njit(cache=True)
def deficits(
    values: np.ndarray, lower: np.ndarray, spacing: np.ndarray, braking_shear: float, target: TargetFormula
) -> np.ndarray:
    """Return W = s(V0) − s(V) at the nodes, float32 of the shape of `values`, V's; nowhere negative."""
    found = np.empty_like(values)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            for k in range(values.shape[2]):
                for m in range(values.shape[3]):
                    v_r = lower[3] + m * spacing[3]
                    for n in range(values.shape[4]):
                        v_o = lower[4] + n * spacing[4]
                        above = target_at(
                            target,
                            lower[0] + i * spacing[0] + braking_shear * (v_o * v_o - v_r * v_r),
                            lower[1] + j * spacing[1],
                            lower[2] + k * spacing[2],
                            v_r,
                            v_o,
                        )
                        found[i, j, k, m, n] = max(scaled(above) - scaled(values[i, j, k, m, n]), 0.0)
    return found
