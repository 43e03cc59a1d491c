"""Load: whether a worker's memory grows over 1000 episodes, and what ten minutes among 500 cars cost.

The memory is what a process has to itself: what is not (files that it has mapped), the system drops when it needs room.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest

from hj_cosim.analysis.run_figures import draw_run
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import run_in_sumo, write_episode
from hj_cosim.study.study import run_study

EPISODES = 1000  # a hundred seeds of the paper's ten stacks
SEEDS = EPISODES // 10
REPORTED_EVERY = 50
ALLOWED_GROWTH = 0.05

CARS, MINUTES = 500, 10
ROAD_LENGTH = 25_000  # m: the traffic ahead fills 7.5 km, and ten minutes at 22 m/s are 13.2 km
SCENARIO = """
description = "500 cars for ten minutes"

[network]
file = "long.net.xml"

[traffic]
count = 400
count_behind = 100
density = 13.5
check_collisions = false
"""


def own_memory(process: psutil.Process) -> float:
    """Return what a process has in memory to itself, in MB."""
    memory = process.memory_info()
    return (memory.rss - memory.shared) / 1e6


def test_a_workers_memory_does_not_grow_over_1000_episodes(small_specification, small_table, tmp_path):
    """Episodes of 2 s in the paper's traffic, all ten stacks in turn, driven by one worker."""
    measured: dict[int, float] = {}
    own = psutil.Process()
    before = set(own.children())  # of other benchmarks
    workers: set[int] = set()

    def measure(done: int, total: int) -> None:
        if done and done % REPORTED_EVERY == 0:
            (worker,) = set(own.children()) - before
            workers.add(worker.pid)
            measured[done] = own_memory(worker)
            print(f"  {done:5d} episodes: worker {measured[done]:6.1f} MB, the study {own_memory(own):6.1f} MB")

    print()
    started = time.monotonic()
    # Seed by seed, so that every fifty episodes have driven all stacks.
    study = run_study(
        "paper",
        episodes=SEEDS,
        workers=1,
        settings=("simulation.duration=2", f"table={small_specification}"),
        out=tmp_path / "study",
        progress=measure,
    )
    print(f"  {EPISODES} episodes and their tables in {time.monotonic() - started:.0f} s")
    assert study.failures == ()
    assert len(workers) == 1
    after_fifty = measured[REPORTED_EVERY]
    growth = max(measured.values()) / after_fifty - 1.0
    print(f"  the worker grew by {100.0 * growth:.1f} % after the first {REPORTED_EVERY}")
    assert growth < ALLOWED_GROWTH


@contextmanager
def most_memory_of(what: str) -> Iterator[None]:
    """Print the time that the block takes, and the most memory that this process has to itself in it."""
    process, peak, ended = psutil.Process(), [0.0], threading.Event()

    def watch() -> None:
        while not ended.wait(0.05):
            peak[0] = max(peak[0], own_memory(process))

    watcher = threading.Thread(target=watch)
    started = time.monotonic()
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()
        print(f"  {what}: {time.monotonic() - started:6.1f} s, at most {peak[0]:6.1f} MB")


def write_long_road(path: Path) -> None:
    """Write a network of four straight lanes, as sumo_net/four_lanes.net.xml but longer."""
    width_and_length = f'speed="60.00" length="{ROAD_LENGTH}.00" width="4.00"'
    lanes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" {width_and_length}'
        f' shape="0.00,{4 * lane}.00 {ROAD_LENGTH}.00,{4 * lane}.00"/>'
        for lane in range(4)
    )
    corners = f"0.00,-2.00,{ROAD_LENGTH}.00,14.00"
    incoming = " ".join(f"highway_{lane}" for lane in range(4))
    path.write_text(
        '<net version="1.20" limitTurnSpeed="-1">'
        f'<location netOffset="0.00,0.00" convBoundary="{corners}" origBoundary="{corners}" projParameter="!"/>'
        f'<edge id="highway" from="west" to="east" priority="1">{lanes}</edge>'
        '<junction id="west" type="dead_end" x="0.00" y="14.00" incLanes="" intLanes="" shape="0.00,14.00 0.00,-2.00"/>'
        f'<junction id="east" type="dead_end" x="{ROAD_LENGTH}.00" y="14.00" incLanes="{incoming}" intLanes=""'
        f' shape="{ROAD_LENGTH}.00,-2.00 {ROAD_LENGTH}.00,14.00"/></net>'
    )


@pytest.mark.parametrize("minutes", [1, MINUTES])
def test_ten_minutes_among_500_cars(small_specification, small_table, tmp_path, minutes):
    """Ten times as long takes ten times the disk, not ten times the memory."""
    write_long_road(tmp_path / "long.net.xml")
    (tmp_path / "long.toml").write_text(SCENARIO)
    knobs = ("simulation.on_collision=continue", f"simulation.duration={60 * minutes}", f"table={small_specification}")
    config = resolve_config(str(tmp_path / "long.toml"), assignments=knobs)
    folder = tmp_path / "run"
    print(f"\n{minutes} min among {CARS} cars")
    before = own_memory(psutil.Process())
    with most_memory_of("driving"):
        episode = run_in_sumo(config, small_table)
    with most_memory_of("writing"):
        write_episode(episode, folder)
    with most_memory_of("drawing"):
        draw_run(folder)
    grown = own_memory(psutil.Process()) - before
    record = episode.record
    car_seconds = (np.count_nonzero(record.traffic.present) + len(record.time)) * config.simulation.step
    print(f"  {car_seconds:.0f} car-seconds; {grown:.0f} MB more than before")
    for path in sorted(folder.glob("*.*")):
        size = path.stat().st_size
        print(f"  {path.name:22s} {size / 1e6:8.2f} MB, {size / car_seconds:7.1f} bytes a car-second")
    assert len(record.time) == 3000 * minutes
    assert len(record.traffic.names) == CARS
    assert grown < 300.0
