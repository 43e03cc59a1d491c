"""What a policy sees: the robot and the N nearest cars as rows of one array, in the road frame."""

import numpy as np

from hj_cosim.scene.observation import Observation

COLUMNS = ("present", "p_x", "p_y", "heading", "speed", "length", "width")
FARTHEST_SEEN = 150.0  # m along the road
# Of the robot p_y is measured from the right-most lane's centre line; of the others everything is relative to it.
LOWEST = np.array([0.0, -FARTHEST_SEEN, -100.0, -np.pi, -60.0, 0.0, 0.0], np.float32)
HIGHEST = np.array([1.0, FARTHEST_SEEN, 100.0, np.pi, 60.0, 30.0, 5.0], np.float32)


def scene_array(observation: Observation, length: float, width: float, cars: int) -> np.ndarray:
    """Return (cars + 1, 7) float32 with COLUMNS: the robot, then the cars nearest along the road, then zeros.

    Args:
        observation: the instant.
        length, width: of the robot, m.
        cars: how many rows there are for them.
    """
    rows = np.zeros((cars + 1, len(COLUMNS)))
    x, y, heading, speed = observation.robot
    rows[0] = 1.0, 0.0, y, heading, speed, length, width
    away = np.abs(observation.x - x)
    nearest = np.argsort(away, kind="stable")[:cars]
    nearest = nearest[away[nearest] <= FARTHEST_SEEN]
    rows[1 : len(nearest) + 1] = np.column_stack(
        [
            np.ones(len(nearest)),
            observation.x[nearest] - x,
            observation.y[nearest] - y,
            observation.heading[nearest] - heading,
            observation.speed[nearest] - speed,
            observation.length[nearest],
            observation.width[nearest],
        ]
    )
    return np.clip(rows, LOWEST, HIGHEST).astype(np.float32)
