import json
import math
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.metrics.rectangles import time_to_overlap
from hj_cosim.metrics.threats import threat_track, touching
from hj_cosim.recording.record import RobotTrack, TrafficTrack

CASES = json.loads((Path(__file__).parent / "fixtures" / "threat_metrics.json").read_text())["cases"]


def tracks(ego: dict, others: list[dict]) -> tuple[RobotTrack, TrafficTrack]:
    """Return one sample of the robot and the other cars from the oracle's dictionaries."""
    robot = RobotTrack.empty(1)
    robot.x[0], robot.y[0], robot.speed[0] = ego["x"], ego["y"], ego["v"]
    robot.heading[0] = math.asin(ego["vy"] / ego["v"])
    lengths, widths = (np.array([float(other[key]) for other in others]) for key in "lw")
    traffic = TrafficTrack.empty(tuple(str(j) for j in range(len(others))), lengths, widths, 1)
    traffic.present[:] = True
    for j, other in enumerate(others):
        traffic.x[0, j], traffic.y[0, j], traffic.speed[0, j] = other["x"], other["y"], other["v"]
        traffic.acceleration[0, j] = other["a"]
        traffic.heading[0, j] = math.asin(other["vy"] / other["v"])
    return robot, traffic


@pytest.mark.parametrize("case", CASES, ids=[case["id"] for case in CASES])
def test_threats_equal_the_checked_cases(case: dict):
    ego, lead = case["ego"], dict(case["lead"])
    if not case["use_lead_acceleration"]:
        lead["a"] = 0.0
    robot, traffic = tracks(ego, [lead])

    threats = threat_track(robot, traffic, ego["l"], ego["w"], case["a_brake_max"], case["a_lat_max"])

    expected = {key: float(value) for key, value in case["expected"].items()}
    assert threats.ttc[0] == pytest.approx(expected["TTC"], rel=1e-12)
    assert threats.btn[0] == pytest.approx(expected["BTN"], rel=1e-12)
    assert threats.stn[0] == pytest.approx(expected["STN"], rel=1e-9)


def test_the_worst_car_ahead_counts_for_each_metric():
    far = {"x": 60.0, "y": 1.5, "v": 10.0, "vy": 0.0, "a": 0.0, "l": 5.0, "w": 2.0}
    near = {"x": 30.0, "y": 0.0, "v": 24.0, "vy": 0.0, "a": 0.0, "l": 5.0, "w": 2.0}
    ego = {"x": 0.0, "y": 0.0, "v": 25.0, "vy": 0.0, "l": 5.0, "w": 2.0}

    both = threat_track(*tracks(ego, [far, near]), 5.0, 2.0)
    alone = [threat_track(*tracks(ego, [car]), 5.0, 2.0) for car in (far, near)]

    assert both.ttc[0] == min(threat.ttc[0] for threat in alone)
    assert both.btn[0] == max(threat.btn[0] for threat in alone)
    assert both.stn[0] == max(threat.stn[0] for threat in alone)


def test_an_absent_car_threatens_nobody():
    lead = {"x": 10.0, "y": 0.0, "v": 1.0, "vy": 0.0, "a": 0.0, "l": 5.0, "w": 2.0}
    robot, traffic = tracks({"x": 0.0, "y": 0.0, "v": 25.0, "vy": 0.0}, [lead])
    traffic.present[:] = False

    threats = threat_track(robot, traffic, 5.0, 2.0)

    assert (threats.ttc[0], threats.btn[0], threats.stn[0]) == (math.inf, 0.0, 0.0)
    assert threats.min_gap[0] == math.inf
    assert not threats.collision[0]


def test_required_braking_avoids_the_crash_and_one_percent_less_does_not():
    draw = np.random.default_rng(3)
    for _ in range(60):
        gap, speed, lead_speed = draw.uniform(3, 60), draw.uniform(5, 35), draw.uniform(1, 30)
        lead_acceleration = draw.choice([0.0, -1.0, -3.0, -6.0])
        lead = {"x": gap + 5.0, "y": 0.0, "v": lead_speed, "vy": 0.0, "a": lead_acceleration, "l": 5.0, "w": 2.0}
        ego = {"x": 0.0, "y": 0.0, "v": speed, "vy": 0.0}
        braking = 5.0 * threat_track(*tracks(ego, [lead]), 5.0, 2.0).btn[0]
        if braking == 0.0:
            continue
        time = np.linspace(0.0, 100.0, 20_001)
        free = gap + path(lead_speed, lead_acceleration, time)
        assert np.min(free - path(speed, -1.001 * braking, time)) > 0.0
        assert np.min(free - path(speed, -0.99 * braking, time)) < 0.0


def path(speed: float, acceleration: float, time: np.ndarray) -> np.ndarray:
    """Return the way driven at a constant acceleration until the car stands, m."""
    if acceleration < 0.0:
        time = np.minimum(time, speed / -acceleration)
    return speed * time + 0.5 * acceleration * time**2


def test_collision_at_an_instant_equals_the_track(make_record):
    record = make_record(samples=150, cars=150, seed=5)
    traffic, robot = record.traffic, record.robot
    for t in range(len(record.time)):
        here = traffic.present[t]
        state = np.array([robot.x[t], robot.y[t], robot.heading[t], robot.speed[t]])
        cars = (array[t][here] for array in (traffic.x, traffic.y, traffic.heading))
        overlap = touching(state, 5.0, 2.0, *cars, traffic.length[here], traffic.width[here])
        assert record.threats.collision[t] == overlap.any()
    assert 0 < np.count_nonzero(record.threats.collision) < len(record.time)
    assert np.all(record.threats.min_gap[record.threats.collision] == 0.0)


def test_the_time_to_overlap_is_the_least_of_all_cars_in_any_order():
    draw = np.random.default_rng(7)
    samples, cars = 60, 12
    sizes = np.full(cars, 5.0), np.full(cars, 2.0)
    robot, traffic = RobotTrack.empty(samples), TrafficTrack.empty(tuple(map(str, range(cars))), *sizes, samples)
    robot.y[:], robot.speed[:] = 4.0, 25.0
    traffic.x[:] = draw.uniform(-150.0, 150.0, (samples, cars))
    traffic.y[:], traffic.speed[:] = draw.uniform(2.5, 5.5, (samples, cars)), draw.uniform(5.0, 45.0, (samples, cars))
    traffic.heading[:] = draw.normal(0.0, 0.02, (samples, cars))
    traffic.present[:] = draw.random((samples, cars)) < 0.8
    found = threat_track(robot, traffic, 5.0, 2.0)
    for t in range(samples):
        each = [
            time_to_overlap(
                traffic.x[t, j], traffic.y[t, j] - 4.0,
                traffic.speed[t, j] * np.cos(traffic.heading[t, j]) - 25.0,
                traffic.speed[t, j] * np.sin(traffic.heading[t, j]),
                0.0, 5.0, 2.0, traffic.heading[t, j], 5.0, 2.0,
            )
            for j in np.flatnonzero(traffic.present[t])
        ]  # fmt: skip
        assert found.ttc_2d[t] == min(each, default=np.inf)
    assert np.isfinite(found.ttc_2d).sum() > 30
