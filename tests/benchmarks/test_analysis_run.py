"""What measuring, writing, exporting and animating a run costs, beside what pandas and plain NumPy need for it."""

import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hj_cosim.analysis.replay import write_replay
from hj_cosim.analysis.report import write_report
from hj_cosim.cosim.configuration import config_toml
from hj_cosim.metrics.summary import summarize
from hj_cosim.metrics.threats import threat_track
from hj_cosim.reachability.table.store import load_table
from hj_cosim.recording.record import RobotTrack, RunRecord, ThreatTrack, TrafficTrack
from hj_cosim.recording.run_folder import read_run, write_run
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import EpisodeConfig, Scenario

CONFIG = EpisodeConfig(scenario=Scenario(name="benchmark"))
REPEATS = 5
# VmHWM: ru_maxrss would be at least what the process that started this one had at its peak.
EXPORT = """
import sys
from pathlib import Path
from hj_cosim.analysis.export import export_run
export_run(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
status = Path("/proc/self/status").read_text()
print(float(status.split("VmHWM:")[1].split()[0]) / 1024)
"""


def crowded_record(samples: int, cars: int) -> RunRecord:
    """Return a drive past cars that go straight on at slightly uneven speeds."""
    draw = np.random.default_rng(0)
    time_axis = 0.02 * np.arange(samples)
    names = tuple(f"car_{number}" for number in range(cars))
    traffic = TrafficTrack.empty(names, np.full(cars, 5.0), np.full(cars, 2.0), samples)
    traffic.present[:] = True
    traffic.speed[:] = draw.normal(23.0, 0.5, (samples, cars))
    traffic.x[:] = 10.0 * np.arange(cars) + 0.02 * np.cumsum(traffic.speed, axis=0)
    traffic.lane[:] = draw.integers(0, 4, cars)
    traffic.y[:] = 4.0 * traffic.lane
    traffic.acceleration[:] = draw.normal(0.0, 1.0, (samples, cars))
    robot = RobotTrack.empty(samples)
    robot.x[:], robot.y[:], robot.speed[:] = 5.0 + 25.0 * time_axis, 4.0, 25.0
    robot.plan_lane[:], robot.plan_speed[:] = 1, 25.0
    nothing = np.zeros(samples)
    threats = ThreatTrack(nothing, nothing, nothing, nothing, np.zeros(samples, bool), nothing)
    return RunRecord(time_axis, StraightRoad(4), 5.0, 2.0, traffic, robot, threats)


@pytest.fixture(scope="module")
def record() -> RunRecord:
    return crowded_record(1500, 100)


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median CPU time of several calls after one that compiles and imports."""
    work()
    seconds = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds)


def numpy_ttc(record: RunRecord) -> np.ndarray:
    """Return TTC alone, as array expressions over (T, J): the floor that the loops are compared with."""
    traffic, robot = record.traffic, record.robot
    ahead = traffic.x - robot.x[:, None]
    in_way = (ahead > 0.0) & (np.abs(traffic.y - robot.y[:, None]) < 2.0)
    closing = robot.speed[:, None] - traffic.speed
    with np.errstate(divide="ignore", invalid="ignore"):
        ttc = np.where(in_way & (closing > 0.0), np.maximum(ahead - 5.0, 0.0) / closing, np.inf)
    return ttc.min(axis=1)


def show(title: str, rows: list[tuple[str, str]]) -> None:
    print(f"\n{title}")
    for name, figure in rows:
        print(f"  {name:<58}{figure:>14}")


def test_measuring_and_writing_thirty_seconds_with_100_cars(record, tmp_path):
    folders = iter(range(1000))
    threats = median_seconds(lambda: threat_track(record.robot, record.traffic, 5.0, 2.0))
    floor = median_seconds(lambda: numpy_ttc(record))
    summary = summarize(record, CONFIG)
    summarising = median_seconds(lambda: summarize(record, CONFIG))
    writing = median_seconds(lambda: write_run(tmp_path / str(next(folders)), record, "", summary))
    frame = pd.read_parquet(tmp_path / "0" / "trajectories.parquet")
    peer = median_seconds(lambda: frame.to_parquet(tmp_path / "peer.parquet", compression="zstd"))
    show(
        "1500 samples, 100 cars (CPU, median)",
        [
            ("threat metrics, distances and collisions", f"{1e3 * threats:.1f} ms"),
            ("TTC alone in NumPy", f"{1e3 * floor:.1f} ms"),
            ("summary, with the metrics beyond the paper", f"{1e3 * summarising:.1f} ms"),
            ("write the run's folder", f"{1e3 * writing:.1f} ms"),
            ("pandas writes the same rows, from a ready frame", f"{1e3 * peer:.1f} ms"),
            ("measure + summarise + write, of 150 ms allowed", f"{1e3 * (threats + summarising + writing):.1f} ms"),
        ],
    )


@pytest.mark.parametrize("samples", [1500, 6000])
def test_exports_need_no_more_memory_for_longer_drives(samples, tmp_path):
    write_run(tmp_path / "run", crowded_record(samples, 500), config_toml(CONFIG), {})
    rows = []
    for format in ("csv", "parquet", "fcd"):
        target = tmp_path / f"export.{format}"
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        command = [sys.executable, "-c", EXPORT, str(tmp_path / "run"), format, str(target)]
        memory = float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        size = target.stat().st_size / 1e6
        rows.append((f"{format}: {size:.0f} MB, {seconds:.1f} s CPU, peak memory", f"{memory:.0f} MiB"))
    show(f"{samples} samples, 500 cars, {samples * 501 / 1e6:.2f} M rows", rows)


def test_a_replay_and_a_report_of_thirty_seconds(record, tmp_path):
    folder = tmp_path / "run"
    write_run(folder, record, config_toml(CONFIG), summarize(record, CONFIG))
    table = load_table("highway")
    start = time.process_time()
    gif = write_replay(read_run(folder), table, Path(tmp_path / "replay.gif"))
    animated = time.process_time() - start
    start = time.process_time()
    page = write_report(folder, table=table)
    reported = time.process_time() - start
    show(
        "30 s, 100 cars (CPU)",
        [
            ("replay.gif, of 20 s allowed", f"{animated:.1f} s"),
            ("its size", f"{gif.stat().st_size / 1e6:.1f} MB"),
            ("report.html", f"{reported:.1f} s"),
            ("its size, of 8 MB allowed", f"{page.stat().st_size / 1e6:.1f} MB"),
        ],
    )
