"""What a planner is: one class with one method.

A planner of one's own needs nothing else:

    class KeepRight:
        def plan(self, observation: Observation, previous: Target) -> Plan:
            return Plan(action=RIGHT, target=Target(lane=0, speed=previous.speed))
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hj_cosim.planning.optimistic.tree_search import IDLE
from hj_cosim.scene.observation import Observation, Target


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
    target: Target
    statistics: PlanStatistics | None = None


class Planner(Protocol):
    """Decides once per plan period (1 s) which lane and speed the robot is to track."""

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the plan.

        Args:
            observation: the robot and the cars around it now.
            previous: what the last plan's target was; at first, the robot's own lane and speed.
        """
        ...


class IdlePlanner:
    """Keeps the lane and the speed that it was given first."""

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the previous target; the observation is not looked at."""
        return Plan(action=IDLE, target=previous)
