import math
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.metrics.driving import driving_metrics
from hj_cosim.metrics.threats import threat_track
from hj_cosim.recording.record import RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RssParameters

RSS = RssParameters()


def steady_run(cars: list[tuple[float, float, float]], speed: float = 20.0, samples: int = 50) -> RunRecord:
    """Return a run of a robot at x = 0 in lane 0 and cars (x, y, speed) that keep their places in its view."""
    robot = RobotTrack.empty(samples)
    robot.speed[:] = speed
    robot.value[:] = 10.0
    count = len(cars)
    traffic = TrafficTrack.empty(tuple(map(str, range(count))), np.full(count, 5.0), np.full(count, 2.0), samples)
    traffic.present[:] = True
    traffic.x[:], traffic.y[:], traffic.speed[:] = (np.array([car[k] for car in cars]) for k in range(3))
    time = 0.02 * np.arange(samples)
    return RunRecord(time, StraightRoad(4), 5.0, 2.0, traffic, robot, threat_track(robot, traffic, 5.0, 2.0))


def test_headway_and_drac_are_to_the_leader_in_the_robot_s_way():
    metrics = driving_metrics(steady_run([(45.0, 0.0, 15.0), (15.0, 4.0, 1.0), (85.0, 0.0, 19.0)]), RSS)
    assert metrics["headway_min"] == metrics["headway_p10"] == 40.0 / 20.0
    assert metrics["min_gap_ahead"] == 40.0
    assert metrics["drac_max"] == pytest.approx(5.0**2 / (2 * 40.0))


def test_an_empty_road_gives_infinite_headway_and_no_drac():
    metrics = driving_metrics(steady_run([(-30.0, 0.0, 15.0)]), RSS)
    assert metrics["headway_min"] == math.inf
    assert metrics["drac_max"] == 0.0


def test_jerk_and_lateral_acceleration_of_a_known_manoeuvre():
    record = steady_run([(60.0, 0.0, 20.0)], samples=101)
    record.robot.acceleration[:] = 0.5 * np.sin(record.time)
    record.robot.omega[:] = 0.1
    metrics = driving_metrics(record, RSS)
    assert metrics["max_abs_jerk"] == pytest.approx(0.5, rel=1e-3)
    assert metrics["mean_abs_lateral_acceleration"] == metrics["max_abs_lateral_acceleration"] == pytest.approx(2.0)


def test_hard_brakes_count_once_each_and_only_behind_the_robot():
    record = steady_run([(-15.0, 0.0, 20.0), (-40.0, 0.0, 20.0), (-15.0, 4.0, 20.0), (30.0, 0.0, 20.0)])
    for first, last in ((5, 10), (20, 30)):
        record.traffic.acceleration[first:last] = -5.0  # all brake, but only the first car follows the robot
    assert driving_metrics(record, RSS)["hard_brakes_imposed"] == 2
    record.traffic.acceleration[:] = -3.9
    assert driving_metrics(record, RSS)["hard_brakes_imposed"] == 0


def test_the_time_with_a_negative_value_is_in_seconds():
    record = steady_run([(60.0, 0.0, 20.0)])
    record.robot.value[10:25] = -1.0
    record.robot.value[25] = 0.0
    assert driving_metrics(record, RSS)["time_value_le_0"] == pytest.approx(16 * 0.02)


def test_rss_is_violated_inside_the_known_distances_only():
    # SPEC section 4: following at 25 behind 22 m/s, the distance is 28 m between centres.
    def violation(distance: float, aside: float) -> float:
        return driving_metrics(steady_run([(distance, aside, 22.0)], speed=25.0), RSS)["rss_violation_percent"]

    boundary = 25 * 0.3 + 0.5 * 3 * 0.3**2 + (25 + 0.9) ** 2 / 12 - 22**2 / 12 + 5.0
    assert boundary == pytest.approx(28.0, abs=0.5)
    assert violation(boundary - 0.01, 0.0) == 100.0
    assert violation(boundary + 0.01, 0.0) == 0.0
    assert violation(10.0, 4.0) == 0.0


def test_driving_towards_a_car_alongside_violates_rss_on_either_side():
    for side in (1.0, -1.0):
        record = steady_run([(0.0, 2.6 * side, 20.0)])
        towards = replace(record.robot, heading=np.full(50, 0.05 * side))
        away = replace(record.robot, heading=np.full(50, -0.05 * side))
        assert driving_metrics(replace(record, robot=towards), RSS)["rss_violation_percent"] == 100.0
        assert driving_metrics(replace(record, robot=away), RSS)["rss_violation_percent"] == 0.0
