"""Episode functions without SUMO, importable by worker processes: seeded synthetic drives, and ways to fail."""

import os
import signal
import sys
import time
from typing import Any

import numpy as np

from hj_cosim.cosim.configuration import config_toml
from hj_cosim.errors import SimulationError
from hj_cosim.recording.record import RobotTrack, RunRecord, ThreatTrack, TrafficTrack
from hj_cosim.recording.run_folder import write_run
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import EpisodeConfig
from hj_cosim.study.jobs import EpisodeJob

UNLUCKY_SEED = 1
SAMPLES, STEP = 1000, 0.02


def synthetic_record(config: EpisodeConfig, samples: int = SAMPLES) -> RunRecord:
    """Return a drive behind one car whose speed is drawn from the seed; OP drives faster than HJOP."""
    draw = np.random.default_rng(config.seed)
    time_of = np.arange(samples) * STEP
    traffic = TrafficTrack.empty(("leader",), np.full(1, 5.0), np.full(1, 2.0), samples)
    traffic.present[:] = True
    traffic.speed[:, 0] = draw.uniform(18.0, 22.0) + np.sin(time_of)
    traffic.x[:, 0] = 150.0 + np.cumsum(traffic.speed[:, 0]) * STEP
    robot = RobotTrack.empty(samples)
    robot.speed[:] = (26.0 if config.planner.kind == "op" else 23.0) + draw.normal(0.0, 0.2, samples)
    robot.x[:] = np.cumsum(robot.speed) * STEP
    robot.acceleration[:] = draw.normal(0.0, 1.0, samples)
    robot.intervening[:] = (config.filter.kind != "none") & (draw.uniform(size=samples) < 0.3)
    gap = np.maximum(traffic.x[:, 0] - robot.x - 5.0, 0.0)
    closing = robot.speed - traffic.speed[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ttc = np.where(gap <= 0.0, 0.0, np.where(closing > 0.0, gap / closing, np.inf))
    threats = ThreatTrack(ttc, 1.0 / np.maximum(ttc, 0.1), 0.5 / np.maximum(ttc, 0.1), gap, gap <= 0.0, ttc)
    return RunRecord(time_of, StraightRoad(lane_count=4), 5.0, 2.0, traffic, robot, threats)


def summary_of(record: RunRecord, config: EpisodeConfig) -> dict[str, Any]:
    """Return what matters to a study of metrics.summary, which workers of tests cannot wait to be compiled."""
    robot, threats = record.robot, record.threats
    return {
        "planner": config.planner.kind,
        "filter": config.filter.kind,
        "scheme": config.filter.scheme,
        "seed": config.seed,
        "scenario": config.scenario.name,
        "duration": len(record.time) * STEP,
        "samples": len(record.time),
        "ttc_ge_3": float(np.mean(threats.ttc >= 3.0)),
        "ttc_p10": float(np.percentile(threats.ttc, 10, method="lower")),
        "ttc_p1": float(np.percentile(threats.ttc, 1, method="lower")),
        "btn_le_1": float(np.mean(threats.btn <= 1.0)),
        "stn_le_1": float(np.mean(threats.stn <= 1.0)),
        "ttc_2d_p1": float(np.percentile(threats.ttc_2d, 1, method="lower")),
        "mean_speed": float(np.mean(robot.speed)),
        "mean_abs_acceleration": float(np.mean(np.abs(robot.acceleration))),
        "intervention_percent": 100.0 * float(np.mean(robot.intervening)),
        "collisions": int(threats.collision.any()),
        "min_gap": float(threats.min_gap.min()),
        "distance": float(robot.x[-1] - robot.x[0]),
    }


def drive(job: EpisodeJob) -> None:
    record = synthetic_record(job.config)
    timing = {"wall_seconds": os.getpid() / 1000.0, "real_time_factor": time.time()}
    summary = summary_of(record, job.config)
    write_run(job.folder, record, config_toml(job.config), summary, keep=job.keep, timing=timing)


STALLING_SEED = 2  # from which on nothing is finished any more


def drive_until_it_stalls(job: EpisodeJob) -> None:
    if job.config.seed >= STALLING_SEED:
        never_finish(job)
    drive(job)


def drive_slowly(job: EpisodeJob) -> None:
    time.sleep(0.2)
    drive(job)


def _is_unlucky(job: EpisodeJob) -> bool:
    return job.config.seed == UNLUCKY_SEED and job.config.planner.kind == "op"


def drive_or_be_killed(job: EpisodeJob) -> None:
    if _is_unlucky(job):
        os.write(2, b"SUMO said something last\n")
        os.kill(os.getpid(), signal.SIGKILL)
    drive(job)


def drive_or_fail(job: EpisodeJob) -> None:
    if _is_unlucky(job):
        raise SimulationError("the traffic could not be settled")
    drive(job)


def drive_or_be_wrong(job: EpisodeJob) -> None:
    if _is_unlucky(job):
        raise ZeroDivisionError("a programming error")
    drive(job)


def drive_while_printing(job: EpisodeJob) -> None:
    print("Warning: what SUMO writes to standard output")
    sys.stdout.flush()
    os.write(1, b"and past Python\n")
    drive(job)


def never_finish(job: EpisodeJob) -> None:
    time.sleep(3600.0)
