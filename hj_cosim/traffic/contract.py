"""What an episode needs of the traffic around the robot, whoever simulates it."""

from collections.abc import Mapping, Sequence
from typing import Protocol, Self, runtime_checkable

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road


class World(Protocol):
    """The traffic and the robot in it, moved from outside, one step at a time.

    Cars come and go. Each has a number, which is its place in `vehicle_names` and in `drivers`, and what
    `Observation.vehicle` calls it by: the first car that is seen has 0, the next one 1, and so on. A car that enters
    later gets the next number; one that leaves is no longer observed, and its number is given to nobody else. So both
    only ever grow, and are complete when the episode is over. The robot is no car and has no number.

    A world is a context manager that closes itself. How long a step is is its own business; the episode's
    `simulation.step` is what it is made with.
    """

    @property
    def road(self) -> Road:
        """The road, in whose frame every observation is."""
        ...

    @property
    def vehicle_names(self) -> Sequence[str]:
        """The names, by number, of all cars that have been observed up to now; no two are the same."""
        ...

    @property
    def drivers(self) -> np.ndarray:
        """The cars' IDM parameters, (len(vehicle_names), 6), named by vehicles.idm.PARAMETER_NAMES.

        A row is NaN where nobody knows them, as of cars that came from elsewhere. They are recorded; no planner and
        no filter sees them.
        """
        ...

    def observe(self) -> Observation:
        """Return the robot and every car on the road at the current instant; later steps change nothing in it."""
        ...

    def settle(self, seconds: float) -> None:
        """Let the traffic run with the robot following its lane as a mean driver, then set the clock to 0.

        Raises:
            DriveEnded: if the robot comes to where it cannot go on.
        """
        ...

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step.

        The other cars move by what they saw at the step's beginning; the robot is put where it is told.

        Args:
            robot_state: (4,) p_x, p_y (m), θ (rad), v (m/s) at the end of the step, in the road frame.
            robot_acceleration: m/s², during the step.

        Raises:
            DriveEnded: if the robot cannot be put there, for example because the road ends before. The step is not
                made then, and none can be after it; `observe` still tells how it was before.
            SimulationError: if the world fails.
        """
        ...

    def close(self) -> None:
        """End the simulation and give its resources back."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@runtime_checkable
class WorldWithRogues(World, Protocol):
    """A world that knows of some cars that their drivers mean harm."""

    @property
    def rogues(self) -> Mapping[str, str]:
        """What each of them does, a behaviour's name by the car's; it is recorded, and no planner or filter sees it."""
        ...


@runtime_checkable
class WorldWithOthers(World, Protocol):
    """A world in which the robot does not see everybody who could be recorded."""

    def everybody(self) -> Observation:
        """Return what `observe` does, with those too that are farther away; cars have the same numbers in both."""
        ...
