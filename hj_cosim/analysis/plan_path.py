"""Where the robot would go if it followed its plan undisturbed."""

import numpy as np

from hj_cosim.recording.record import RunRecord

HORIZON = 3.0  # s
POINTS = 31
# The tracking controller's time constants (paper, closed-loop controller): Δℓ' = −K_1 Δℓ and v' = K_2 (v_p − v).
LATERAL_RATE = 2.0  # 1/s
SPEED_RATE = 1.67  # 1/s


def plan_path(record: RunRecord, sample: int) -> np.ndarray:
    """Return the points (POINTS, 2), m, of the next HORIZON seconds towards the planned lane and speed."""
    robot = record.robot
    time = np.linspace(0.0, HORIZON, POINTS)
    missing = robot.plan_speed[sample] - robot.speed[sample]
    along = robot.plan_speed[sample] * time - missing * (1.0 - np.exp(-SPEED_RATE * time)) / SPEED_RATE
    centre = record.road.lane_centre(int(robot.plan_lane[sample]), robot.x[sample])
    aside = centre + (robot.y[sample] - centre) * np.exp(-LATERAL_RATE * time)
    return np.column_stack([robot.x[sample] + along, aside])
