"""What a planner is: one class with one method.

A planner of one's own needs nothing else; `hj-cosim run --planner mine.py:KeepRight` drives it:

    from hj_cosim.planning.contract import RIGHT, Plan
    from hj_cosim.scene.observation import Target

    class KeepRight:
        def plan(self, observation, previous):
            return Plan(action=RIGHT, target=Target(lane=0, speed=previous.speed))

Its constructor is handed what it asks for by the names of its parameters, any of PlannerInputs' fields:

    def __init__(self, road, robot): ...

It may have a method `prepare(observation)`, called once before the drive: what takes long, such as compiling, belongs
there, and must not change what it answers. An attribute `plan_period` of its class, s, is how often it is asked where
no setting says: once a second without it. An answer of `plan` that takes ten seconds ends the episode, and so does
one that raises, writes into the observation's arrays, or whose target no robot can have.
`hj_cosim.testing.check_planner` tests a planner.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings, Settings

if TYPE_CHECKING:
    from hj_cosim.reachability.table.table import ValueTable

# The actions; what a plan says that its target came from.
IDLE, FASTER, SLOWER, LEFT, RIGHT = range(5)
ACTION_COUNT = 5


@dataclass(frozen=True)
class PlannerInputs:
    """What a planner may ask for, by the names of its constructor's parameters."""

    settings: PlannerSettings  # the group `planner`
    options: Settings | None  # its own, where its class has a settings model `Options`
    robot: RobotSettings  # body and limits
    drivers: DriverSettings  # the others' mean parameters; how they scatter is not for planners to know
    road: Road
    table: "ValueTable"  # V


@dataclass(frozen=True)
class PredictedTrajectory:
    """The most promising path of the tree, from now (row 0) over D actions; road frame, SI, body centres."""

    time: np.ndarray  # (D + 1,) s from now
    action: np.ndarray  # (D,) int
    robot: np.ndarray  # (D + 1, 4) p_x, p_y, θ, v
    planned_lane: np.ndarray  # (D + 1,) int, l_p
    planned_speed: np.ndarray  # (D + 1,) v_p, m/s
    vehicle: np.ndarray  # (J,) int, the numbers of the cars that entered the tree, as in the observation
    x: np.ndarray  # (D + 1, J) m
    y: np.ndarray  # (D + 1, J) m
    speed: np.ndarray  # (D + 1, J) m/s


@dataclass(frozen=True)
class PlanStatistics:
    """What a tree search did to find its plan."""

    expansions: int
    nodes: int
    depth: int  # of the deepest node
    best_value: float  # the highest lower bound: discounted rewards in [0, 1], summed
    action_values: np.ndarray  # (5,) the highest after each action; −inf where the action does not exist
    trajectory: PredictedTrajectory  # to the node that has the highest


@dataclass(frozen=True)
class Plan:
    """What the robot is to do until the next plan."""

    action: int  # IDLE, FASTER, SLOWER, LEFT or RIGHT
    target: Target  # a lane of the road, and a speed of 0 m/s or more
    statistics: PlanStatistics | None = None


class Planner(Protocol):
    """Decides once per plan period (1 s) which lane and speed the robot is to track."""

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the plan.

        Args:
            observation: the robot and the cars around it now, all finite; not to be written to.
            previous: what the last plan's target was; at first, the robot's own lane and speed.
        """
        ...


@runtime_checkable
class PreparedPlanner(Planner, Protocol):
    """A planner that has something to do before the drive."""

    def prepare(self, observation: Observation) -> None:
        """Do what takes long, such as compiling; `observation` is the drive's first."""
        ...
