"""Scenes with SUMO: the robot and a few cars at given places on the four-lane road."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from hj_cosim.settings import (
    CarStart,
    DriverSettings,
    NormalDistribution,
    RobotSettings,
    RobotStart,
    Scenario,
    TrafficSettings,
)
from hj_cosim.traffic.sumo.world import SumoWorld

STEP = 0.02

OpenScene = Callable[..., SumoWorld]


@pytest.fixture
def open_scene() -> Iterator[OpenScene]:
    """Open a hand-made scene: `open_scene(cars, lane=…, speed=…, mobil=…)`; closed when the test ends."""
    with ExitStack() as worlds:

        def open_it(cars: list[CarStart], lane: int = 1, speed: float = 20.0, mobil: bool = False) -> SumoWorld:
            certain = {
                name: NormalDistribution(mean=mean, deviation=0.0)
                for name, mean in (
                    ("max_acceleration", 3.0),
                    ("comfortable_deceleration", 5.0),
                    ("time_headway", 1.5),
                    ("minimum_gap", 5.0),
                )
            }
            scenario = Scenario(
                name="scene",
                traffic=TrafficSettings(count=0),
                drivers=DriverSettings(**certain, gain_threshold=0.2 if mobil else 1e6),
                robot=RobotStart(lane=lane, speed=speed),
                cars=tuple(cars),
            )
            return worlds.enter_context(SumoWorld(scenario, RobotSettings(), seed=0, step=STEP))

        yield open_it


@pytest.fixture
def coast() -> Callable[[SumoWorld], None]:
    """Move a world one step on with the robot at its speed and heading."""

    def one_step(world: SumoWorld) -> None:
        x, y, heading, speed = world.observe().robot
        moved = np.array([x + speed * np.cos(heading) * STEP, y + speed * np.sin(heading) * STEP, heading, speed])
        world.step(moved, 0.0)

    return one_step
