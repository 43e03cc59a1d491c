"""What a rogue's behaviour is: one class with one method.

A behaviour of one's own needs nothing else; `hj-cosim run --set scenario.rogues.share=0.1 --set
scenario.rogues.behaviour=mine.py:Weave` drives this one:

    import math

    from hj_cosim.traffic.rogues.contract import CarInput

    class Weave:
        def act(self, view):
            return CarInput(heading=0.05 * math.sin(view.observation.time), acceleration=0.0)

One object drives one rogue, from when it begins on. Its constructor is handed what it asks for by the names of its
parameters, any of BehaviourInputs' fields. Whatever it answers is kept within the road and within what its car can, and
it does not run into others than the robot: see `restraint`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from hj_cosim.scene.observation import CarValues, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings, RogueLimits, Settings

ValuesOfCars = Callable[[Observation], CarValues]  # of all cars of an observation


class CarInput(NamedTuple):
    """What a driver wants of its car: the inputs (θ_o, a_o) of the game's other car (paper)."""

    heading: float  # rad, against the road
    acceleration: float  # m/s²


@dataclass(frozen=True)
class RogueView:
    """What a rogue sees at one instant: everything."""

    observation: Observation  # the robot, and all cars, its own among them
    own: int  # the index of its own car
    accomplices: tuple[int, ...]  # the indices of all that do the same, its own too, in one order for all of them
    road: Road
    robot_length: float  # m
    desired_speed: float  # m/s, IDM's, of when it drives as others do
    ordinary: CarInput  # what an ordinary driver would do in its place

    @cached_property
    def x(self) -> float:
        """Its own p_x, m."""
        return float(self.observation.x[self.own])

    @cached_property
    def y(self) -> float:
        """Its own p_y, m."""
        return float(self.observation.y[self.own])

    @cached_property
    def speed(self) -> float:
        """Its own, m/s."""
        return float(self.observation.speed[self.own])

    @cached_property
    def lane(self) -> int:
        """The lane whose centre line it is nearest to."""
        return self.road.lane_at(self.y, self.x)

    @cached_property
    def robot_lane(self) -> int:
        """The lane whose centre line the robot is nearest to."""
        return self.road.lane_at(float(self.observation.robot[1]), float(self.observation.robot[0]))

    @cached_property
    def ahead(self) -> float:
        """How far its centre is ahead of the robot's, m; negative behind it."""
        return self.x - float(self.observation.robot[0])

    @cached_property
    def contact(self) -> float:
        """The distance of the two centres along the road, m, at which the bumpers touch."""
        return 0.5 * (self.robot_length + float(self.observation.length[self.own]))

    @cached_property
    def robot_speed(self) -> float:
        """The robot's, m/s."""
        return float(self.observation.robot[3])


@dataclass(frozen=True)
class BehaviourInputs:
    """What a behaviour may ask for, by the names of its constructor's parameters."""

    options: Settings | None  # its own, where its class has a settings model `Options`
    limits: RogueLimits  # of its car
    robot: RobotSettings  # the robot's body and limits
    road: Road
    random: np.random.Generator  # its own, seeded
    values: ValuesOfCars | None  # V of the robot's table, and its gradient; None where nobody drives with a table


class Behaviour(Protocol):
    """Drives one rogue."""

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants until it is asked again, a step of the traffic later; None to drive as others do."""
        ...
