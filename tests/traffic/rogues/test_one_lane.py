"""Rogues where the robot's lane is the only one: nobody leaves the road, and nobody goes through the robot."""

from dataclasses import replace

import numpy as np
import pytest
from rogue_scenes import LENGTH, SPEED, seen

from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, RogueLimits
from hj_cosim.traffic.rogues.block import Block
from hj_cosim.traffic.rogues.brake_check import BrakeCheck
from hj_cosim.traffic.rogues.contract import RogueView
from hj_cosim.traffic.rogues.cut_in import CutIn
from hj_cosim.traffic.rogues.restraint import OwnCar, moved, ordinary_input, restrained
from hj_cosim.traffic.rogues.steering import lane_beside_robot
from hj_cosim.traffic.rogues.tailgate import Tailgate
from hj_cosim.vehicles.idm import mean_driver

ONE, LIMITS, STEP = StraightRoad(1), RogueLimits(), 0.1
DRIVER = mean_driver(DriverSettings())
MAKES = {
    "block": lambda: Block(Block.Options()),
    "brake_check": lambda: BrakeCheck(BrakeCheck.Options(), LIMITS),
    "cut_in": lambda: CutIn(CutIn.Options()),
    "tailgate": lambda: Tailgate(Tailgate.Options()),
}


def views(observation, road):
    everybody = tuple(range(len(observation.x)))
    for own in everybody:
        ordinary = ordinary_input(observation, OwnCar(own, DRIVER), road, LENGTH)
        yield RogueView(observation, own, everybody, road, LENGTH, 24.0, ordinary)


def coasts(_: np.ndarray) -> float:
    return SPEED


def follows(ahead: np.ndarray) -> float:
    """Return the speed of a robot that keeps half a second to the nearest of those `ahead` of it by some m."""
    return float(np.clip(2.0 * (ahead[ahead > 0.0].min() - LENGTH - 1.0), 0.0, SPEED))


def driven(behaviour, starts, robot_speed):
    """Return how far ahead of the robot, and across the road, rogues are at each of 200 steps, (T, 2, K) m.

    Args:
        behaviour: its name.
        starts: (K,) m ahead of the robot, where each rogue begins.
        robot_speed: the robot's speed, m/s, of the rogues' distances ahead of it, m.
    """
    rogues, states = [MAKES[behaviour]() for _ in starts], [np.array([each, 0.0, 0.0, SPEED]) for each in starts]
    robot, tracks = 0.0, []
    for instant in range(200):
        columns = np.array(states).T
        tracks.append([columns[0] - robot, columns[1]])
        speed = robot_speed(columns[0] - robot)
        now = seen([(x, y, moving, LENGTH) for x, y, _, moving in states], (robot, 0.0, speed))
        now = replace(now, time=instant * STEP, heading=columns[2])
        for own, (rogue, view) in enumerate(zip(rogues, views(now, ONE), strict=True)):
            wanted = restrained(rogue.act(view) or view.ordinary, now, OwnCar(own, DRIVER), ONE, LIMITS)
            states[own], _ = moved(states[own], wanted, LIMITS, STEP)
        robot += speed * STEP
    return np.array(tracks)


@pytest.mark.parametrize("behaviour", MAKES)
def test_a_rogue_behind_follows_at_its_own_gap(behaviour):
    ahead, across = driven(behaviour, [-25.0], coasts)[:, :, 0].T
    gap = {"block": 6.0, "brake_check": 7.5, "cut_in": 3.0, "tailgate": 2.0}[behaviour]
    assert -ahead[-1] - LENGTH == pytest.approx(gap, abs=0.2)
    assert ahead.max() < -LENGTH
    assert not across.any()


@pytest.mark.parametrize("behaviour", MAKES)
def test_a_rogue_ahead_comes_back_to_the_robot_and_stays_ahead(behaviour):
    ahead, across = driven(behaviour, [40.0], follows)[:, :, 0].T
    assert LENGTH < ahead.min() < LENGTH + 10.5
    assert not across.any()


def test_block_takes_the_places_ahead_and_behind():
    ahead = driven("block", [-20.0, 40.0], follows)[:, 0]
    assert (ahead[:, 0] < -LENGTH).all()
    assert (ahead[:, 1] > LENGTH).all()
    assert -ahead[-1, 0] - LENGTH == pytest.approx(6.0, abs=2.5)


def test_the_lane_beside_the_robot_is_on_the_rogues_side_or_the_other_or_its_own():
    found = {}
    for lanes, robot, rogue in [(3, 1, 1), (3, 1, 0), (3, 2, 2), (3, 0, 0), (2, 0, 1), (1, 0, 0)]:
        now = seen([(10.0, 4.0 * rogue, SPEED, LENGTH)], (0.0, 4.0 * robot, SPEED))
        view = next(views(now, StraightRoad(lanes)))
        found[lanes, robot, rogue] = lane_beside_robot(view)
    assert found == {(3, 1, 1): 2, (3, 1, 0): 0, (3, 2, 2): 1, (3, 0, 0): 1, (2, 0, 1): 1, (1, 0, 0): 0}
