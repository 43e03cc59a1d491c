"""What an episode needs of the traffic around the robot, whoever simulates it."""

from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road


class World(Protocol):
    """The traffic and the robot in it, moved from outside, one step at a time.

    Attributes:
        road: the road frame that every observation is in.
        vehicle_names: a background car's name by its number in `Observation.vehicle`.
        drivers: (len(vehicle_names), 6) IDM parameters by the same number, named by
            vehicles.idm.PARAMETER_NAMES; what the planner does not know.
    """

    road: Road
    vehicle_names: Sequence[str]
    drivers: np.ndarray

    def observe(self) -> Observation:
        """Return the robot and every background car on the road at the current instant."""
        ...

    def settle(self, seconds: float) -> None:
        """Let the traffic run with the robot following its lane as a mean driver, then set the clock to 0."""
        ...

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step.

        The other cars move by what they saw at the step's beginning; the robot is put where it is told.

        Args:
            robot_state: (4,) p_x, p_y (m), θ (rad), v (m/s) at the end of the step, in the road frame.
            robot_acceleration: m/s², during the step.
        """
        ...

    def close(self) -> None:
        """End the simulation and give its resources back."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...
