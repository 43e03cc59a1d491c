"""What the co-simulation costs beside SUMO's own steps, at 100 cars and growing to 2000."""

import time
from collections import defaultdict
from pathlib import Path

import libsumo
import matplotlib
import numpy as np
import pytest

from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import drive
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.settings import NetworkSettings, RobotSettings, Scenario, TrafficSettings
from hj_cosim.traffic.sumo.puppet import ROBOT
from hj_cosim.traffic.sumo.world import SumoWorld

matplotlib.use("Agg")

STEP = 0.02
BLOCK = 25  # steps that are timed at once
COUNTS = (50, 100, 200, 500, 1000, 2000)
GROWTH = Path(".benchmarks") / "traffic_growth"  # .csv, the table, and .png, the plot
GROWTH_COLUMNS = "cars,bare_sumo_us,cosimulation_us,outside_sumos_step_us"

# Everything is one thread: its CPU time is the wall time of a machine that does nothing else.
clock = time.process_time

Request = tuple[str, int, float]


@pytest.fixture(scope="module")
def long_road(tmp_path_factory) -> Path:
    """Return four lanes of 50 km: 2000 cars as dense as the paper's."""
    lanes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" speed="60" length="50000" width="4"'
        f' shape="0,{4 * lane} 50000,{4 * lane}"/>'
        for lane in range(4)
    )
    path = tmp_path_factory.mktemp("networks") / "long.net.xml"
    path.write_text(
        '<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
        f' projParameter="!"/><edge id="highway" from="a" to="b" priority="1">{lanes}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        '<junction id="b" type="dead_end" x="50000" y="0" incLanes="" intLanes="" shape="50000,0 50000,1"/></net>'
    )
    return path


def traffic(count: int, network: Path) -> Scenario:
    behind = count // 3
    return Scenario(
        name="growth",
        network=NetworkSettings(file=str(network)),
        # SUMO's own check compares every car of a lane with every other, and would hide all else at 2000 cars.
        traffic=TrafficSettings(count=count - behind, count_behind=behind, check_collisions=False),
    )


def coast(world: SumoWorld) -> None:
    """Move on one step, the robot at its speed, and observe."""
    x, y, _, speed = world.observe().robot
    world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)


def cosimulated(scenario: Scenario, steps: int, monkeypatch) -> tuple[np.ndarray, np.ndarray, dict[int, list[Request]]]:
    """Return seconds a step by block, those outside SUMO's own step, and the lane changes asked for in each step."""
    requests: dict[int, list[Request]] = defaultdict(list)
    inside = 0.0
    step_now = 0
    sumos_step, sumos_change = libsumo.simulationStep, libsumo.vehicle.changeLane

    def timed_step() -> None:
        nonlocal inside
        started = clock()
        sumos_step()
        inside += clock() - started

    def noted_change(name: str, lane: int, seconds: float) -> None:
        requests[step_now].append((name, lane, seconds))
        sumos_change(name, lane, seconds)

    with SumoWorld(scenario, RobotSettings(), seed=0) as world, monkeypatch.context() as patch:
        patch.setattr(libsumo, "simulationStep", timed_step)
        patch.setattr(libsumo.vehicle, "changeLane", noted_change)
        total, outside = [], []
        for _ in range(steps // BLOCK):
            inside, started = 0.0, clock()
            for _ in range(BLOCK):
                coast(world)
                step_now += 1
            seconds = clock() - started
            total.append(seconds / BLOCK)
            outside.append((seconds - inside) / BLOCK)
    return np.array(total), np.array(outside), requests


def bare(scenario: Scenario, steps: int, requests: dict[int, list[Request]]) -> np.ndarray:
    """Return seconds a step by block of SUMO alone: the same cars, the same lane changes, nothing read."""
    with SumoWorld(scenario, RobotSettings(), seed=0) as world:
        libsumo.vehicle.setSpeed(ROBOT, float(world.observe().robot[3]))
        blocks = []
        for block in range(steps // BLOCK):
            started = clock()
            for step in range(block * BLOCK, (block + 1) * BLOCK):
                for name, lane, seconds in requests.get(step, ()):
                    libsumo.vehicle.changeLane(name, lane, seconds)
                libsumo.simulationStep()
            blocks.append((clock() - started) / BLOCK)
    return np.array(blocks)


def test_growth_from_50_to_2000_cars(long_road, monkeypatch, row):
    rows = []
    for count in COUNTS:
        scenario = traffic(count, long_road)
        steps = 500 if count <= 200 else 100
        total, outside, requests = cosimulated(scenario, steps, monkeypatch)
        alone = bare(scenario, steps, requests)
        rows.append([count, *(1e6 * np.median(part) for part in (alone, total, outside))])
    table = np.array(rows)
    outside_at = dict(zip(COUNTS, table[:, 3], strict=True))
    print(
        "\n  cars | bare SUMO µs/step | co-simulation µs/step | ratio | outside SUMO's step µs | per car | to 100 cars"
    )
    for count, alone, total, outside in rows:
        print(
            f"{count:6.0f} | {alone:17.0f} | {total:21.0f} | {total / alone:5.2f} | {outside:22.0f} |"
            f" {outside / count:7.2f} | {outside / outside_at[100]:10.1f}x"
        )
    GROWTH.parent.mkdir(exist_ok=True)
    np.savetxt(GROWTH.with_suffix(".csv"), table, fmt="%.0f", delimiter=",", header=GROWTH_COLUMNS, comments="")
    _plot(table)
    row("share of 1000", outside_at[1000] / dict(zip(COUNTS, table[:, 1], strict=True))[1000])
    assert outside_at[1000] <= 12.0 * outside_at[100]


def _plot(table: np.ndarray) -> None:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    for column, label in ((1, "bare SUMO"), (2, "co-simulation"), (3, "outside SUMO's own step")):
        axes.loglog(table[:, 0], table[:, column], marker="o", label=label)
    axes.set(xlabel="cars", ylabel="µs per step of 0.02 s", title="Cost of a step of the co-simulation")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    figure.savefig(GROWTH.with_suffix(".png"), dpi=150)
    pyplot.close(figure)


def test_what_idle_cosimulation_costs_beside_bare_sumo(small_table, monkeypatch, row):
    """The whole loop of an episode, with planner idle and filter none, against SUMO's steps of 0.02 s alone."""
    steps = 500
    config = resolve_config("paper", assignments=["planner.kind=idle", "filter.kind=none", "simulation.duration=10"])
    clocks = {"one clock": STEP, "two clocks": config.simulation.traffic_step}
    whole, alone = {name: [] for name in clocks}, []
    for _ in range(3):
        _, _, requests = cosimulated(config.scenario, steps, monkeypatch)
        alone.append(bare(config.scenario, steps, requests).sum() * BLOCK)
        for name, traffic_step in clocks.items():
            with SumoWorld(config.scenario, config.robot, seed=0, traffic_step=traffic_step) as world:
                planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, small_table)
                safety_filter = make_filter(config.filter, config.robot, world.road, small_table, STEP)
                started = clock()
                drive(world, planner, safety_filter, small_table, config)
                whole[name].append(clock() - started)
    bare_seconds = np.median(alone)
    print(
        f"\n100 cars, 10 s: bare SUMO {1e6 * bare_seconds / steps:.0f} µs a step of {STEP} s; episode with planner idle"
    )
    for name, seconds in whole.items():
        ratio = np.median(seconds) / bare_seconds
        print(f"and filter none, {name}: {1e6 * np.median(seconds) / steps:.0f} µs, {ratio:.2f}x")
    row("idle", np.median(whole["two clocks"]) / bare_seconds)


def test_a_step_of_the_world_with_100_cars(benchmark, long_road):
    with SumoWorld(traffic(100, long_road), RobotSettings(), seed=0) as world:
        world.settle(1.0)
        benchmark.pedantic(coast, args=(world,), rounds=20, iterations=BLOCK, warmup_rounds=1)
