"""Which rows give way where they cannot be met together: by who answers for the car, then by how bad it is.

The paper misses all alike, by one slack. Then a car that follows too closely keeps the robot from braking as hard as
the one ahead asks, for which the robot answers. By RSS whoever is behind answers for the distance, and of two beside
each other who moves towards the other. So rows about cars for which the robot answers are missed as little as can be,
and of the controls that do that the others' are missed least; among its like a row counts the more the less V is left.
"""

import numpy as np

from hj_cosim.scene.observation import Observation

MOVING = 0.2  # m/s across the road, from which on the robot moves towards somebody, as in the game's duties
WORST = 10.0  # m below ε, beyond which nothing counts more


def robot_answers(observation: Observation, cars: np.ndarray, length: float, width: float) -> np.ndarray:
    """Return for which of some cars the robot answers by RSS, (K,) bool.

    Args:
        observation: robot and cars.
        cars: (K,) int, their places in the observation.
        length, width: of the robot's body, m.
    """
    x, y, heading, speed = observation.robot
    ahead, aside = observation.x[cars] - x, observation.y[cars] - y
    apart = 0.5 * (length + observation.length[cars])
    moves_towards = speed * np.sin(heading) * np.sign(aside) > MOVING
    in_its_lane = np.abs(aside) < 0.5 * (width + observation.width[cars])
    return np.where(ahead > apart, True, moves_towards & ~(in_its_lane & (ahead < -apart)))


def severity(value: np.ndarray, epsilon: float) -> np.ndarray:
    """Return how much missing each row counts among its like, (K,), for V, (K,), and ε, m."""
    return np.asarray(1.0 + np.clip(epsilon - value, 0.0, WORST))
