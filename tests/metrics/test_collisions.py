"""Collisions by kind and by whose fault, on staged drives whose answer is plain."""

import dataclasses

import numpy as np
import pytest

from hj_cosim.metrics.collisions import collision_metrics, find_collisions
from hj_cosim.metrics.threats import threat_track
from hj_cosim.recording.record import RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RssParameters

RSS = RssParameters()
STEP = 0.02


def staged(car, robot=(0.0, 4.0, 20.0, 0.0), seconds=6.0) -> RunRecord:
    """Return a drive of the robot and one car, each (x, y, speed along, speed across), at constant velocities."""
    time = STEP * np.arange(round(seconds / STEP))
    count = len(time)
    own, traffic = RobotTrack.empty(count), TrafficTrack.empty(("a",), np.full(1, 5.0), np.full(1, 2.0), count)
    traffic.present[:] = True
    for (x, y, along, across), track in ((robot, own), (car, traffic)):
        shape = track.x.shape
        track.x[:] = (x + along * time).reshape(count, *[1] * (len(shape) - 1))
        track.y[:] = (y + across * time).reshape(count, *[1] * (len(shape) - 1))
        track.speed[:] = np.hypot(along, across)
        track.heading[:] = np.arctan2(across, along)
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
    record = staged(car, robot)
    (first, *_) = find_collisions(record, RSS)
    assert (first.kind, first.robot_is_responsible) == (kind, responsible)
    assert record.threats.collision[first.sample]
    assert not record.threats.collision[first.sample - 1]


def test_who_stands_or_keeps_its_place_is_not_responsible_for_a_side_that_is_run_into():
    standing = staged((-9.0, 6.03, 20.0, 0.0), (0.0, 4.0, 0.0, 0.0), seconds=1.5)
    standing.traffic.heading[:] = 0.1  # its tail sticks out towards the robot, while it moves away
    turned = threat_track(standing.robot, standing.traffic, 5.0, 2.0)
    (collision, *_) = find_collisions(dataclasses.replace(standing, threats=turned), RSS)
    assert (collision.kind, collision.robot_is_responsible) == ("side", False)
    for across, responsible in ((0.04, False), (0.2, True)):
        (collision, *_) = find_collisions(staged((-1.0, 6.3, 20.0, 0.0), (0.0, 4.0, 20.0, across), seconds=9.0), RSS)
        assert (collision.kind, collision.robot_is_responsible) == ("side", responsible)


def test_kinds_add_up_to_the_collisions_that_there_were():
    record = staged((60.0, 4.0, 5.0, 0.0), seconds=8.0)
    assert collision_metrics(record, RSS) == {
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
