"""Where the robot would go if it followed its plan undisturbed."""

import numpy as np

from hj_cosim.recording.record import RunRecord
from hj_cosim.recording.run_folder import Run
from hj_cosim.settings import TrackingSettings

HORIZON = 3.0  # s
POINTS = 31


def tracking_of(run: Run) -> TrackingSettings:
    """Return the gains that a run was driven with."""
    return TrackingSettings.model_validate(run.config["tracking"])


def plan_path(record: RunRecord, sample: int, tracking: TrackingSettings) -> np.ndarray:
    """Return the points (POINTS, 2), m, of the next HORIZON seconds towards the planned lane and speed.

    The closed loop's offset and speed error decay at the rates K_1 and K_2: Δℓ' = −K_1 Δℓ and v' = K_2 (v_p − v)
    (paper, eq. case study closed-loop controller).
    """
    robot = record.robot
    time = np.linspace(0.0, HORIZON, POINTS)
    missing = robot.plan_speed[sample] - robot.speed[sample]
    along = robot.plan_speed[sample] * time - missing * (1.0 - np.exp(-tracking.k_2 * time)) / tracking.k_2
    centre = record.road.lane_centre(int(robot.plan_lane[sample]), robot.x[sample])
    aside = centre + (robot.y[sample] - centre) * np.exp(-tracking.k_1 * time)
    return np.column_stack([robot.x[sample] + along, aside])
