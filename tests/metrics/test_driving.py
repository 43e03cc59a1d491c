import math
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.metrics.driving import driving_metrics
from hj_cosim.metrics.jerk_and_turning import jerk_and_turning
from hj_cosim.metrics.threats import threat_track
from hj_cosim.recording.record import RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings, RssParameters

FILTER = FilterSettings(rss=RssParameters())


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
    metrics = driving_metrics(steady_run([(45.0, 0.0, 15.0), (15.0, 4.0, 1.0), (85.0, 0.0, 19.0)]), FILTER)
    assert metrics["headway_min"] == metrics["headway_p10"] == 40.0 / 20.0
    assert metrics["min_gap_ahead"] == 40.0
    assert metrics["drac_max"] == pytest.approx(5.0**2 / (2 * 40.0))


def test_an_empty_road_gives_infinite_headway_and_no_drac():
    metrics = driving_metrics(steady_run([(-30.0, 0.0, 15.0)]), FILTER)
    assert metrics["headway_min"] == math.inf
    assert metrics["drac_max"] == 0.0


def test_jerk_and_lateral_acceleration_of_a_known_manoeuvre():
    record = steady_run([(60.0, 0.0, 20.0)], samples=101)
    record.robot.acceleration[:] = 0.5 * np.sin(record.time)
    record.robot.omega[:] = 0.1
    metrics = jerk_and_turning(record)
    assert metrics["max_abs_jerk"] == pytest.approx(0.5, rel=1e-3)
    assert metrics["mean_abs_lateral_acceleration"] == metrics["max_abs_lateral_acceleration"] == pytest.approx(2.0)


def test_hard_brakes_count_once_each_and_only_behind_the_robot():
    record = steady_run([(-15.0, 0.0, 20.0), (-40.0, 0.0, 20.0), (-15.0, 4.0, 20.0), (30.0, 0.0, 20.0)])
    for first, last in ((5, 10), (20, 30)):
        record.traffic.acceleration[first:last] = -5.0  # all brake, but only the first car follows the robot
    assert driving_metrics(record, FILTER)["hard_brakes_imposed"] == 2
    record.traffic.acceleration[:] = -4.4
    assert driving_metrics(record, FILTER)["hard_brakes_imposed"] == 0


def test_one_hard_braking_counts_once_behind_a_robot_that_wavers():
    record = steady_run([(-15.0, 0.0, 20.0)])
    record.traffic.acceleration[5:20] = -5.0
    for beside in (0, 8, 12, 16):  # it begins before the robot is in the way, which then comes and goes
        record.robot.y[beside : beside + 2] = 4.0
    record.robot.y[:6] = 4.0
    assert driving_metrics(record, FILTER)["hard_brakes_imposed"] == 1


@pytest.mark.parametrize(("is_there", "imposed"), [(True, 0), (False, 1)])
def test_only_a_car_that_is_there_comes_between_the_robot_and_who_brakes_behind_it(is_there, imposed):
    record = steady_run([(-40.0, 0.0, 20.0), (-15.0, 0.0, 20.0)])
    record.traffic.present[:, 1] = is_there
    record.traffic.acceleration[5:10, 0] = -5.0
    assert driving_metrics(record, FILTER)["hard_brakes_imposed"] == imposed


def test_the_time_with_a_negative_value_is_in_seconds():
    record = steady_run([(60.0, 0.0, 20.0)])
    record.robot.value[10:25] = -1.0
    record.robot.value[25] = 0.0
    assert driving_metrics(record, FILTER)["time_value_le_0"] == pytest.approx(16 * 0.02)


def test_rss_is_violated_inside_the_known_distances_only():
    # RSS with these parameters: following at 25 behind 22 m/s, the distance is 28 m between centres.
    def violation(distance: float, aside: float) -> float:
        return driving_metrics(steady_run([(distance, aside, 22.0)], speed=25.0), FILTER)["rss_violation_percent"]

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
        assert driving_metrics(replace(record, robot=towards), FILTER)["rss_violation_percent"] == 100.0
        assert driving_metrics(replace(record, robot=away), FILTER)["rss_violation_percent"] == 0.0


def test_jumps_are_changes_of_more_than_two_from_one_sample_to_the_next():
    record = steady_run([(60.0, 0.0, 20.0)], samples=101)
    record.robot.acceleration[20:30] = 2.5
    record.robot.acceleration[60:] = 1.9
    metrics = jerk_and_turning(record)
    assert metrics["jumps_per_second"] == pytest.approx(2 / (100 * 0.02))
    assert metrics["max_abs_jerk"] == pytest.approx(2.5 / 0.02)
    assert metrics["jerk_p99"] == sorted(np.abs(np.diff(record.robot.acceleration)) / 0.02)[99]


def test_shares_of_lateral_acceleration_are_of_samples():
    record = steady_run([(60.0, 0.0, 20.0)], samples=100)
    record.robot.omega[:30] = -0.15
    record.robot.omega[30:40] = 0.25
    metrics = jerk_and_turning(record)
    assert (metrics["lateral_acceleration_gt_2_5"], metrics["lateral_acceleration_gt_4"]) == (0.4, 0.1)


def test_two_dimensional_ttc_sees_a_car_before_it_overlaps_sideways():
    record = steady_run([(25.0, 4.0, 10.0)])
    assert record.threats.ttc.min() == math.inf
    crossing = replace(record.traffic, heading=np.full_like(record.traffic.heading, -0.2))
    threats = threat_track(record.robot, crossing, 5.0, 2.0)
    assert threats.ttc.min() == math.inf
    # The corner of the other's front comes to the robot's side before its rear comes to the robot's front.
    assert 0.5 < threats.ttc_2d[0] < 2.5
    assert record.threats.ttc_2d.min() == math.inf


def test_the_fall_of_v_is_measured_from_epsilon():
    record = steady_run([(60.0, 0.0, 20.0)])
    assert driving_metrics(record, FILTER)["value_fall"] == 0.0
    record.robot.value[10] = -0.5
    assert driving_metrics(record, FILTER)["value_fall"] == FILTER.epsilon + 0.5


def test_a_corner_beyond_the_outermost_line_is_off_the_road():
    record = steady_run([(60.0, 0.0, 20.0)])
    record.robot.y[:10] = -0.99
    record.robot.y[10:15] = -1.01
    record.robot.y[15:18] = 13.01
    assert driving_metrics(record, FILTER)["off_road_samples"] == 8
    record.robot.heading[:10] = 0.1
    assert driving_metrics(record, FILTER)["off_road_samples"] == 18
