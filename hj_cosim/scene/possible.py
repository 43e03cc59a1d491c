"""Whether what is observed can be: checked every step, so compiled, and apart from what only holds it."""

import numpy as np
from numba import njit

from hj_cosim.scene.observation import FARTHEST


@njit(cache=True)
def is_possible(
    robot: np.ndarray, x: np.ndarray, y: np.ndarray, heading: np.ndarray, speed: np.ndarray, acceleration: np.ndarray
) -> bool:
    """Return whether an observation's robot (4,) and other cars' motions (J,) are all within ± FARTHEST, none NaN."""
    for i in range(4):
        if not abs(robot[i]) <= FARTHEST:
            return False
    for j in range(len(x)):
        if not (
            abs(x[j]) <= FARTHEST
            and abs(y[j]) <= FARTHEST
            and abs(heading[j]) <= FARTHEST
            and abs(speed[j]) <= FARTHEST
            and abs(acceleration[j]) <= FARTHEST
        ):
            return False
    return True
