"""Collisions by kind and by whose fault, on staged drives whose answer is plain."""

import dataclasses

import numpy as np
import pytest

from hj_cosim.metrics.collisions import collision_metrics, find_collisions
from hj_cosim.metrics.rectangles import rectangles_overlap
from hj_cosim.metrics.threats import threat_track
from hj_cosim.recording.record import RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RssParameters

RSS = RssParameters()
STEP = 0.02


def staged(*cars, robot=(0.0, 4.0, 20.0, 0.0), seconds=6.0) -> RunRecord:
    """Return a drive of the robot and cars, each (x, y, speed along, speed across), at constant velocities."""
    time = STEP * np.arange(round(seconds / STEP))
    count, body = len(time), np.ones(len(cars))
    own = RobotTrack.empty(count)
    traffic = TrafficTrack.empty(tuple("abcdefgh"[: len(cars)]), 5.0 * body, 2.0 * body, count)
    traffic.present[:] = True
    for track, motion in ((own, np.array(robot)), (traffic, np.array(cars).T[:, None])):
        x, y, along, across = motion
        moving = time if track is own else time[:, None]
        track.x[:], track.y[:] = x + along * moving, y + across * moving
        track.speed[:], track.heading[:] = np.hypot(along, across), np.arctan2(across, along)
    return RunRecord(time, StraightRoad(4), 5.0, 2.0, traffic, own, threat_track(own, traffic, 5.0, 2.0))


@pytest.mark.parametrize(
    ("car", "robot", "kind", "responsible"),
    [
        ((60.0, 4.0, 5.0, 0.0), (0.0, 4.0, 20.0, 0.0), "into_other", True),
        ((-60.0, 4.0, 35.0, 0.0), (0.0, 4.0, 20.0, 0.0), "into_robot", False),
        ((1.0, 8.0, 20.0, -1.0), (0.0, 4.0, 20.0, 0.0), "side", False),
        ((-1.0, 0.0, 20.0, 1.0), (0.0, 4.0, 20.0, 0.0), "side", False),
        ((1.0, 8.0, 20.0, 0.0), (0.0, 4.0, 20.0, 1.0), "side", True),
        ((1.0, 0.0, 20.0, 0.0), (0.0, 4.0, 20.0, -1.0), "side", True),
        # The robot moves over in front of a faster car that hits it from behind: the lateral distance was lost last.
        ((-22.0, 12.0, 24.0, 0.0), (0.0, 4.0, 20.0, 2.0), "into_robot", True),
        # A slower car moves over in front of the robot, which hits it.
        ((22.0, 12.0, 16.0, -2.0), (0.0, 4.0, 20.0, 0.0), "into_other", False),
    ],
)
def test_kind_and_responsibility_of_a_staged_collision(car, robot, kind, responsible):
    record = staged(car, robot=robot)
    (first, *_) = find_collisions(record, RSS)
    assert (first.kind, first.robot_is_responsible) == (kind, responsible)
    assert record.threats.collision[first.sample]
    assert not record.threats.collision[first.sample - 1]


def test_who_stands_or_keeps_its_place_is_not_responsible_for_a_side_that_is_run_into():
    standing = staged((-9.0, 6.03, 20.0, 0.0), robot=(0.0, 4.0, 0.0, 0.0), seconds=1.5)
    standing.traffic.heading[:] = 0.1  # its tail sticks out towards the robot, while it moves away
    turned = threat_track(standing.robot, standing.traffic, 5.0, 2.0)
    (collision, *_) = find_collisions(dataclasses.replace(standing, threats=turned), RSS)
    assert (collision.kind, collision.robot_is_responsible) == ("side", False)
    for across, responsible in ((0.04, False), (0.2, True)):
        record = staged((-1.0, 6.3, 20.0, 0.0), robot=(0.0, 4.0, 20.0, across), seconds=9.0)
        (collision, *_) = find_collisions(record, RSS)
        assert (collision.kind, collision.robot_is_responsible) == ("side", responsible)


def test_kinds_add_up_to_the_collisions_that_there_were():
    record = staged((60.0, 4.0, 5.0, 0.0), seconds=8.0)
    assert collision_metrics(record, RSS) == {
        "collisions": 1,
        "collisions_into_other": 1,
        "collisions_into_robot": 0,
        "collisions_side": 0,
        "collisions_responsible": 1,
    }


def test_no_collision_is_of_no_kind():
    assert set(collision_metrics(staged((60.0, 8.0, 5.0, 0.0)), RSS).values()) == {0}


def test_a_drive_that_begins_in_a_collision_has_one():
    record = staged((1.0, 5.5, 20.0, 0.0), seconds=0.2)
    (only,) = find_collisions(record, RSS)
    assert (only.sample, only.kind) == (0, "side")


def test_a_second_car_that_is_hit_while_the_first_still_is_counts_too():
    """A standing car is passed through from 3.67 to 4.33 s; another one comes from the side meanwhile, at 4 s."""
    standing, crossing = (60.0, 4.0, 0.0, 0.0), (0.0, 10.01, 15.0, -1.0)
    both = staged(standing, crossing, robot=(0.0, 4.0, 15.0, 0.0), seconds=8.0)
    found = find_collisions(both, RSS)
    assert [(each.car, each.kind) for each in found] == [(0, "into_other"), (1, "side")]
    for each, car in zip(found, (standing, crossing), strict=True):
        (alone,) = find_collisions(staged(car, robot=(0.0, 4.0, 15.0, 0.0), seconds=8.0), RSS)
        assert each.sample == alone.sample
    assert both.threats.collision[found[0].sample : found[1].sample].all()
    assert collision_metrics(both, RSS)["collisions"] == 2


@pytest.mark.parametrize("seed", range(4))
def test_collisions_begin_where_a_cars_rectangle_begins_to_overlap(seed):
    random = np.random.default_rng(seed)
    count = 6
    low, high = (-20.0, 2.0, 15.0, -0.2), (20.0, 6.0, 25.0, 0.2)
    record = staged(*random.uniform(low, high, (count, 4)), seconds=8.0)
    record.traffic.present[:] = random.random((len(record.time), count)) < 0.99  # they come and go
    threats = threat_track(record.robot, record.traffic, 5.0, 2.0)
    record = dataclasses.replace(record, threats=threats)
    meet = np.zeros((len(record.time) + 1, count), bool)
    for sample in range(len(record.time)):
        robot, cars = record.robot, record.traffic
        for car in np.flatnonzero(cars.present[sample]):
            apart = (cars.x[sample, car] - robot.x[sample], cars.y[sample, car] - robot.y[sample])
            bodies = (robot.heading[sample], 5.0, 2.0, cars.heading[sample, car], 5.0, 2.0)
            meet[sample + 1, car] = rectangles_overlap(*apart, *bodies)
    begins = np.argwhere(meet[1:] & ~meet[:-1]).tolist()
    assert len(begins) > 3
    assert [[each.sample, each.car] for each in find_collisions(record, RSS)] == begins
