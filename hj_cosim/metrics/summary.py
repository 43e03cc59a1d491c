"""summary.json: one number per question about a run (SPEC sections 2 and 3)."""

from typing import Any

import numpy as np

from hj_cosim.metrics.driving import driving_metrics
from hj_cosim.plugins import plugin_name
from hj_cosim.recording.record import RunRecord
from hj_cosim.scene.road import Road
from hj_cosim.settings import EpisodeConfig

SAFE_TTC = 3.0  # s, the paper's boundary between safe and unsafe
SETTLED_IN_LANE = 0.25  # of the lane's width: this near its centre line, the robot counts as being in the lane


def summarize(record: RunRecord, config: EpisodeConfig, wall_seconds: float) -> dict[str, Any]:
    """Return summary.json's content.

    Percentiles of samples are samples themselves (no interpolation: a TTC may be infinite), the more dangerous of
    the two neighbours. Values that are not finite stay so here and are written as null.

    Args:
        record: the run, with at least one sample.
        config: what it was run with.
        wall_seconds: what the episode took, s.
    """
    robot, threats = record.robot, record.threats
    duration = round(len(record.time) * config.simulation.step, 9)
    return {
        "planner": plugin_name(config.planner.kind),
        "filter": plugin_name(config.filter.kind),
        "scheme": config.filter.scheme,
        "seed": config.seed,
        "scenario": config.scenario.name,
        "duration": duration,
        "ended": record.ended,
        "samples": len(record.time),
        "ttc_ge_3": float(np.mean(threats.ttc >= SAFE_TTC)),
        "ttc_p10": _percentile(threats.ttc, 10, "lower"),
        "ttc_p1": _percentile(threats.ttc, 1, "lower"),
        "btn_le_1": float(np.mean(threats.btn <= 1.0)),
        "btn_p90": _percentile(threats.btn, 90, "higher"),
        "stn_le_1": float(np.mean(threats.stn <= 1.0)),
        "stn_p90": _percentile(threats.stn, 90, "higher"),
        "mean_speed": float(np.mean(robot.speed)),
        "mean_abs_acceleration": float(np.mean(np.abs(robot.acceleration))),
        "intervention_percent": 100.0 * float(np.mean(robot.intervening)),
        "collisions": count_onsets(threats.collision),
        "min_gap": float(np.min(threats.min_gap)),
        "distance": float(np.sum(np.hypot(np.diff(robot.x), np.diff(robot.y)))),
        "lane_changes": count_lane_changes(robot.x, robot.y, record.road),
        "wall_seconds": wall_seconds,
        "real_time_factor": duration / wall_seconds,
        **driving_metrics(record, config.filter.rss),
    }


def _percentile(samples: np.ndarray, percent: float, method: Any) -> float:
    return float(np.percentile(samples, percent, method=method))


def count_onsets(flag: np.ndarray) -> int:
    """Return how many separate stretches of samples of a boolean (T,) there are."""
    return int(flag[0]) + int(np.count_nonzero(flag[1:] & ~flag[:-1]))


def count_lane_changes(along: np.ndarray, lateral: np.ndarray, road: Road) -> int:
    """Return how many lane changes a drive completed.

    A lane counts as reached a quarter of its width from its centre line, so that wavering at a line counts for
    nothing; two lanes at once are two changes.

    Args:
        along: (T,) arc length along the road, m.
        lateral: (T,) offset to the left of the centre line of lane 0, m.
        road: the lanes.
    """
    lane = road.nearest_lanes(lateral, along)
    reached = lane[np.abs(lateral - road.lane_centres(lane, along)) <= SETTLED_IN_LANE * road.lane_width]
    return int(np.sum(np.abs(np.diff(reached))))
