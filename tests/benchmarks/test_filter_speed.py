"""What a filter step costs with 100 cars, look-ups and problem included, beside its floor: qpsolvers and daqp alone.

What is wanted holds for a machine where qpsolvers with daqp takes 14 µs; the table gives the floor in the same run, so
that another machine can be judged by it.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import qpsolvers
from bent_roads import circle
from filter_in_loop import FilterInLoop

from hj_cosim.control.problem.enumeration import least_cost_control
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.size_classes import SIZE_CLASSES
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.settings import FilterSettings, robot_and_filter

CARS = 100
# The filter is one thread: its CPU time is the wall time of a machine that does nothing else.
clock = time.process_time
DESIRED = Control(0.01, 1.0)


# Of 100 vehicles, in turn: twelve cars, a rigid truck and an articulated one for every fourteen.
BODIES = [(5.0, 2.0)] * 12 + [(12.0, 2.5), (16.5, 2.5)]


@pytest.fixture(scope="module")
def table() -> ValueTable:
    return load_table("highway")


@pytest.fixture(scope="module")
def tables() -> ValueTable:
    """Return the tables of the three size classes."""
    return load_tables("highway", SIZE_CLASSES, robot=robot_and_filter("best")[0])


def with_trucks(scene: Observation) -> Observation:
    """Return a scene with trucks among its cars."""
    length, width = np.array(BODIES * (CARS // len(BODIES) + 1))[:CARS].T.copy()
    return replace(scene, length=length, width=width)


def observations(count: int, seed: int = 0) -> list[Observation]:
    """Return scenes of 100 cars on four lanes, some 25 within the table."""
    draw = np.random.default_rng(seed)
    scenes = []
    for _ in range(count):
        lane = draw.integers(0, 4, CARS)
        scenes.append(
            Observation(
                time=0.0, robot=np.array([0.0, 4.0, 0.02, 24.0]), robot_acceleration=0.0, vehicle=np.arange(CARS),
                x=np.sort(draw.uniform(-50.0, 1000.0, CARS)), y=4.0 * lane, heading=np.zeros(CARS),
                speed=draw.uniform(20.0, 25.0, CARS), acceleration=np.zeros(CARS), lane=lane, target_lane=lane,
                length=np.full(CARS, 5.0), width=np.full(CARS, 2.0),
            )
        )  # fmt: skip
    return scenes


def durations(action: Callable[[Observation], object], scenes: list[Observation]) -> np.ndarray:
    """Return the µs that an action takes on each scene, the first fifty left out."""
    taken = np.empty(len(scenes))
    for index, scene in enumerate(scenes):
        started = clock()
        action(scene)
        taken[index] = clock() - started
    return 1e6 * taken[50:]


def floor_problem(_: Observation) -> object:
    """Solve a problem of the filter's size with qpsolvers and daqp alone."""
    problem = qpsolvers.Problem(
        np.diag([2.0, 2.0, 0.0]), np.array([-0.1, -0.5, 10.0]), np.array([[3.0, -8.0, -1.0], [-2.0, 5.0, -1.0]]),
        np.array([-4.0, 2.0]), lb=np.array([-1.0, -1.5, 0.0]), ub=np.array([1.0, 1.0, np.inf]),
    )  # fmt: skip
    return qpsolvers.solve_problem(problem, "daqp")


def test_filter_step(benchmark, row, table, tables):
    scenes = observations(2000)
    lines = []
    robot, best = robot_and_filter("best")
    for name, settings in {
        "the preset best": best,
        "SPC MI": FilterSettings(),
        "SPC MI, keeping an escape": FilterSettings(keep_escape=True),
        "SPC SW": FilterSettings(scheme="sw"),
        "RSS MI": FilterSettings(kind="rss"),
        "none": FilterSettings(kind="none"),
    }.items():
        safety_filter = FilterInLoop(settings, table, robot)
        results = []
        taken = durations(lambda scene, f=safety_filter, r=results: r.append(f.filter(scene, DESIRED)), scenes)
        intervening = np.array([result.constrained for result in results[50:]])
        busy = taken[intervening] if intervening.any() else taken
        lines.append((name, np.median(taken), np.quantile(taken, 0.99), np.median(busy), 100 * intervening.mean()))
    four_lanes = {"lane_count": 4, "lane_width": 4.0, "reference_lane": 3, "lanes_there": np.array([4])}
    bend = FilterInLoop(best, table, robot, circle(500.0, 2000.0, **four_lanes))
    sized, among_trucks = FilterInLoop(best, tables, robot), [with_trucks(scene) for scene in scenes]
    for name, chosen, seen in (
        ("best, on a bend of 500 m", bend, scenes),
        ("best, tables of 3 sizes, cars", sized, scenes),
        ("best, 3 sizes, 1 in 7 a truck", sized, among_trucks),
    ):
        results = []
        taken = durations(lambda scene, f=chosen, r=results: r.append(f.filter(scene, DESIRED)), seen)
        intervening = np.array([result.constrained for result in results[50:]])
        lines.append(
            (name, np.median(taken), np.quantile(taken, 0.99), np.median(taken[intervening]), 100 * intervening.mean())
        )
    looked_up_sized = durations(lambda seen: car_values(tables, seen), among_trucks)
    looked_up = durations(lambda seen: car_values(table, seen), scenes)
    p, q, c = np.array([3.0, -8.0]), np.array([-2.0, 5.0]), np.array([-4.0, 2.0])
    weights, box = np.array([11.1, 0.0625, 10.0]), np.array([-0.3, 0.3, -6.0, 4.0])
    enumerated = durations(lambda _: least_cost_control(p, q, c, 0.01, 1.0, weights, False, box), scenes)
    floor = durations(floor_problem, scenes)

    safety_filter = FilterInLoop(FilterSettings(), table)
    busy_scene = next(scene for scene in scenes if safety_filter.filter(scene, DESIRED).constraints == 2)
    benchmark(safety_filter.filter, busy_scene, DESIRED)
    print(
        f"\n{'a step with 100 cars':30s}{'median µs':>12s}{'p99 µs':>10s}{'intervening µs':>16s}{'intervening %':>15s}"
    )
    for name, median, tail in (
        ("filter", *lines[0][1:3]),
        ("filter bend", *lines[-3][1:3]),
        ("filter sizes", *lines[-1][1:3]),
    ):
        row(f"{name} median", median, np.median(floor))
        row(f"{name} tail", tail, np.quantile(floor, 0.99))
    for name, median, tail, busy, share in lines:
        print(f"{name:30s}{median:12.1f}{tail:10.1f}{busy:16.1f}{share:15.1f}")
    print(f"{'  of it look-ups':30s}{np.median(looked_up):12.1f}{np.quantile(looked_up, 0.99):10.1f}")
    print(
        f"{'  look-ups among trucks':30s}{np.median(looked_up_sized):12.1f}{np.quantile(looked_up_sized, 0.99):10.1f}"
    )
    print(f"{'floor: qpsolvers with daqp':30s}{np.median(floor):12.1f}{np.quantile(floor, 0.99):10.1f}")
    print(f"{'enumeration instead':30s}{np.median(enumerated):12.1f}{np.quantile(enumerated, 0.99):10.1f}")
