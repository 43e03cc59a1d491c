"""Driving among rogues in SUMO, in one call."""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from hj_cosim.plugins import given
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import CarStart
from hj_cosim.traffic.rogues.catalogue import BEHAVIOUR

sys.path.insert(0, str(Path(__file__).resolve().parent))
from rogue_scenes import SPEED, STEP, MoveRobot, Tracks, coast, scene


@pytest.fixture
def drive(small_table: ValueTable) -> Callable[..., Tracks]:
    """Drive a scene: `drive(cars, seconds, move=coast, **rogue settings)`."""

    def drive_it(cars: list[CarStart], seconds: float, move: MoveRobot = coast, **settings) -> Tracks:  # type: ignore[no-untyped-def]
        with scene(cars, partial(car_values, small_table), **settings) as world:
            world.settle(0.0)
            observations = [world.observe()]
            for step in range(round(seconds / STEP)):
                before = observations[-1] if step % 5 == 0 else world.observe()
                world.step(move(before.robot, before.time), 0.0)
                if step % 5 == 4:
                    observations.append(world.observe())
        return Tracks(observations)

    return drive_it


@pytest.fixture
def rogue() -> Callable[..., CarStart]:
    """Return a rogue's car: `rogue(behaviour, lane, x, speed)`; the behaviour is a name or a class of a test's own."""

    def start(behaviour: str | type, lane: int, x: float, speed: float = SPEED) -> CarStart:
        reference = behaviour if isinstance(behaviour, str) else given(BEHAVIOUR, behaviour)
        return CarStart(lane=lane, x=x, speed=speed, desired_speed=24.0, rogue=reference)

    return start
