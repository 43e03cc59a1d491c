"""summary.json: one number per question about a run, each of them declared in `metrics.catalogue`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hj_cosim.metrics.catalogue import METRICS, SUMMARY_KEYS, require_declared
from hj_cosim.metrics.collisions import collision_metrics
from hj_cosim.metrics.declaration import PercentileOfSamples
from hj_cosim.metrics.declared_paper import SAFE_TTC
from hj_cosim.metrics.driving import driving_metrics
from hj_cosim.metrics.jerk_and_turning import jerk_and_turning
from hj_cosim.plugins import plugin_name
from hj_cosim.recording.record import RunRecord
from hj_cosim.scene.road import Road
from hj_cosim.settings import EpisodeConfig

SETTLED_IN_LANE = 0.25  # of the lane's width: this near its centre line, the robot counts as being in the lane


def summarize(record: RunRecord, config: EpisodeConfig, counted: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return summary.json's content, in the order of the declarations.

    Percentiles of samples are samples themselves (no interpolation: a TTC may be infinite), the more dangerous of
    the two neighbours. Values that are not finite stay so here and are written as null.

    Args:
        record: the run, with at least one sample.
        config: what it was run with.
        counted: further metrics, which were counted during the drive.

    Raises:
        MetricError: if `counted` has a metric that is not declared.
    """
    robot, threats = record.robot, record.threats
    found = {
        "planner": plugin_name(config.planner.kind),
        "filter": plugin_name(config.filter.kind),
        "scheme": config.filter.scheme,
        "seed": config.seed,
        "scenario": config.scenario.name,
        "duration": round(len(record.time) * config.simulation.step, 9),
        "ended": record.ended,
        "samples": len(record.time),
        "ttc_ge_3": float(np.mean(threats.ttc >= SAFE_TTC)),
        "btn_le_1": float(np.mean(threats.btn <= 1.0)),
        "stn_le_1": float(np.mean(threats.stn <= 1.0)),
        "mean_speed": float(np.mean(robot.speed)),
        "mean_abs_acceleration": float(np.mean(np.abs(robot.acceleration))),
        "intervention_percent": 100.0 * float(np.mean(robot.intervening)),
        "constrained_percent": 100.0 * float(np.mean(robot.constraints > 0)),
        "min_gap": float(np.min(threats.min_gap)),
        "distance": float(np.sum(np.hypot(np.diff(robot.x), np.diff(robot.y)))),
        "lane_changes": count_lane_changes(robot.x, robot.y, record.road),
        **_percentiles(record),
        **driving_metrics(record, config.filter),
        **jerk_and_turning(record),
        **collision_metrics(record, config.filter.rss),
        **(counted or {}),
    }
    require_declared(found)
    return {key: found[key] for key in SUMMARY_KEYS if key in found}


def timing(summary: Mapping[str, Any], wall_seconds: float) -> dict[str, float]:
    """Return timing.json's content: what depends on the machine.

    Args:
        summary: of the run.
        wall_seconds: what the drive took, s.
    """
    return {"wall_seconds": wall_seconds, "real_time_factor": summary["duration"] / wall_seconds}


def _percentiles(record: RunRecord) -> dict[str, float]:
    """Return the metrics that are declared as percentiles of a track."""
    found = {}
    for metric in METRICS.values():
        pooling = metric.pooling
        if isinstance(pooling, PercentileOfSamples):
            samples = getattr(record.threats, pooling.column)
            found[metric.name] = float(np.percentile(samples, pooling.percent, method=pooling.method))
    return found


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
