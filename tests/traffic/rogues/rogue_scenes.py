"""Rogues among a few cars at given places in SUMO, and a robot that coasts, or does what a test tells it to."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.settings import (
    CarStart,
    DriverSettings,
    RobotSettings,
    RobotStart,
    RogueSettings,
    Scenario,
    TrafficSettings,
)
from hj_cosim.traffic.sumo.world import SumoWorld

STEP, TRAFFIC_STEP = 0.02, 0.1
LENGTH, WIDTH = 5.0, 2.0
ROBOT_LANE, SPEED = 1, 20.0

MoveRobot = Callable[[np.ndarray, float], np.ndarray]  # state and time to the state a step later


def coast(state: np.ndarray, time: float) -> np.ndarray:
    """Return the robot's state a step later at its speed and heading."""
    x, y, heading, speed = state
    return np.array([x + speed * np.cos(heading) * STEP, y + speed * np.sin(heading) * STEP, heading, speed])


@dataclass(frozen=True)
class Tracks:
    """Everybody at every step of SUMO's; T of them."""

    observations: list[Observation]

    def of(self, car: int) -> dict[str, np.ndarray]:
        """Return a car's columns, (T,) each; `ahead` and `aside` are relative to the robot."""
        seen = self.observations
        columns = {name: np.array([getattr(each, name)[car] for each in seen]) for name in COLUMNS}
        robot = np.array([each.robot for each in seen])
        return columns | {"ahead": columns["x"] - robot[:, 0], "aside": columns["y"] - robot[:, 1]}


COLUMNS = ("x", "y", "heading", "speed", "acceleration", "lane")


def touches(track: dict[str, np.ndarray], other: dict[str, np.ndarray] | None = None) -> bool:
    """Return whether a car's body overlaps the robot's, or another car's, headings left aside."""
    along = track["ahead"] if other is None else track["x"] - other["x"]
    across = track["aside"] if other is None else track["y"] - other["y"]
    return bool(((np.abs(along) < LENGTH) & (np.abs(across) < WIDTH)).any())


def seen(cars: Sequence[tuple[float, ...]], robot: tuple[float, float, float] = (-500.0, 0.0, SPEED)) -> Observation:
    """Return cars given as (x, y, speed, length), the rogue first, and a robot given as (x, y, speed), all straight."""
    x, y, speed, length = np.array(cars, float).T
    none, lane = np.zeros(len(x)), np.zeros(len(x), np.int64)
    state = np.array([robot[0], robot[1], 0.0, robot[2]])
    return Observation(
        0.0, state, 0.0, np.arange(len(x)), x, y, none, speed, none, lane, lane, length, none + WIDTH
    )  # fmt: skip


@contextmanager
def scene(cars: list[CarStart], values=None, **settings) -> Iterator[SumoWorld]:  # type: ignore[no-untyped-def]
    """Open a hand-made scene; `settings` are those of RogueSettings."""
    scenario = Scenario(
        name="scene",
        traffic=TrafficSettings(count=0),
        drivers=DriverSettings(gain_threshold=1e6),  # nobody changes lanes of its own accord
        robot=RobotStart(lane=ROBOT_LANE, speed=SPEED),
        cars=tuple(cars),
        rogues=RogueSettings(**settings),
    )
    with SumoWorld(scenario, RobotSettings(), 0, STEP, traffic_step=TRAFFIC_STEP, values=values) as world:
        yield world
