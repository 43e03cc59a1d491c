"""What passengers and tyres feel: jerk, jumps of the acceleration, and the lateral acceleration of turning."""

import numpy as np

from hj_cosim.recording.record import RunRecord

JUMP = 2.0  # m/s², a change from one sample to the next that counts as a jump
UNCOMFORTABLE = 2.5  # m/s² across
HARD_ON_TYRES = 4.0  # m/s² across


def jerk_and_turning(record: RunRecord) -> dict[str, float]:
    """Return the metrics of the robot's own motion, by their names in `metrics.catalogue`.

    Args:
        record: the run; of one sample alone it has no jerk.
    """
    robot, step = record.robot, step_of(record)
    change = np.abs(np.diff(robot.acceleration))
    jerk = change / step if len(change) else np.zeros(1)
    lateral = np.abs(robot.speed * _yaw_rate(record))
    jumps = int(np.count_nonzero(change > JUMP))
    return {
        "mean_abs_jerk": float(jerk.mean()),
        "max_abs_jerk": float(jerk.max()),
        "jerk_p99": float(np.percentile(jerk, 99, method="higher")),
        "jumps_per_second": jumps / (step * len(change)) if len(change) else 0.0,
        "mean_abs_lateral_acceleration": float(lateral.mean()),
        "max_abs_lateral_acceleration": float(lateral.max()),
        "lateral_acceleration_gt_2_5": float(np.mean(lateral > UNCOMFORTABLE)),
        "lateral_acceleration_gt_4": float(np.mean(lateral > HARD_ON_TYRES)),
    }


def _yaw_rate(record: RunRecord) -> np.ndarray:
    """Return how fast the robot turned in the world, (T,) rad/s: against the road, and with it."""
    robot, road = record.robot, record.road
    if road.is_straight:
        return robot.omega
    forward = robot.speed * np.cos(robot.heading)
    bend = map(road.bend_rate, robot.x.tolist(), robot.y.tolist(), forward.tolist())
    return np.asarray(robot.omega + np.fromiter(bend, float, len(robot.x)))


def step_of(record: RunRecord) -> float:
    """Return the time from one sample to the next, s; 0 where there is one alone."""
    return float(record.time[1] - record.time[0]) if len(record.time) > 1 else 0.0
