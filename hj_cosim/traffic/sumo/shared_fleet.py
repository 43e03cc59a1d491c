"""A fleet that is shared: some of its cars are moved from outside, as the robot is."""

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from hj_cosim.traffic.sumo.fleet import NEVER_ITS_TURN, Fleet
from hj_cosim.traffic.sumo.puppet import Placement


class Moved(NamedTuple):
    """Where a car that is moved from outside will be when a step ends."""

    state: np.ndarray  # (4,) p_x, p_y (m), heading (rad), speed (m/s), in the road frame
    acceleration: float  # m/s², during the step
    placement: Placement


class SharedFleet(Fleet):
    """The background cars, of which some are no longer SUMO's to drive."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Take over cars that SUMO has inserted; see Fleet."""
        super().__init__(*arguments, **options)
        self._moved: dict[str, Moved] = {}

    def is_beside_somebody(self, name: str) -> bool:
        """Return whether a car lies alongside another one, or the robot, in a lane that both are in."""
        return self._rows.is_beside_somebody(self._names.index(name))

    def is_changing(self, name: str) -> bool:
        """Return whether a car was told to change lanes and is not done."""
        return self._names.index(name) in self._changing

    def hand_over(self, name: str) -> None:
        """Ask a car for no lane changes any more: from now on it is moved from outside."""
        self._rows.turn[self._names.index(name)] = NEVER_ITS_TURN

    def move(self, name: str, moved: Moved) -> None:
        """Take over where a car will be when the next step ends; SUMO is told by others."""
        self._moved[name] = moved

    def take_away(self, name: str) -> None:
        """Forget a car that was taken from the road."""
        self._forget({name})

    def _correct_rows(self) -> None:
        """Put those that are moved from outside where they were moved to."""
        rows = self._rows
        for name, moved in self._moved.items():
            car = self._names.index(name)
            rows.x[car], rows.y[car], rows.heading[car], rows.speed[car] = moved.state
            rows.acceleration[car] = moved.acceleration
            rows.lane[car] = rows.target_lane[car] = moved.placement.lane
            rows.second_lane[car] = moved.placement.second_lane

    def _forget(self, arrived: Collection[str]) -> None:
        """Drop the rows of cars that have gone; see Fleet."""
        self._moved = {name: moved for name, moved in self._moved.items() if name not in arrived}
        super()._forget(arrived)
