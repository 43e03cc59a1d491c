"""The road frame: arc length s along the road, lateral offset d to the left, heading relative to it.

Everything that plans, controls or measures works in this frame; only traffic/ knows world coordinates.
d = 0 is the centre line of lane 0, the right-most; lane n has its centre at n lane widths.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

# One place, or the places of many cars.
Coordinate = TypeVar("Coordinate", float, np.ndarray)


@dataclass(frozen=True)
class Road:
    """A straight road of parallel lanes of one width; the identity when it starts at (0, 0) and heads along +x."""

    lane_count: int
    lane_width: float = 4.0  # m
    length: float = 10_000.0  # m
    origin_x: float = 0.0  # m, world position of s = 0 on lane 0's centre line
    origin_y: float = 0.0  # m
    heading: float = 0.0  # rad, counter-clockwise from +x

    def lane_centre(self, lane: int) -> float:
        """Return the lateral offset of a lane's centre line, m."""
        return lane * self.lane_width

    def lane_at(self, lateral: float) -> int:
        """Return the lane whose centre line is nearest to a lateral offset (m), within the road."""
        return min(max(math.floor(lateral / self.lane_width + 0.5), 0), self.lane_count - 1)

    def to_world(
        self, along: Coordinate, lateral: Coordinate, heading: Coordinate
    ) -> tuple[Coordinate, Coordinate, Coordinate]:
        """Return world x, y (m) and heading (rad) of road coordinates: three numbers, or three arrays of one shape."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return (
            self.origin_x + along * cos - lateral * sin,
            self.origin_y + along * sin + lateral * cos,
            heading + self.heading,
        )

    def from_world(
        self, x: Coordinate, y: Coordinate, heading: Coordinate
    ) -> tuple[Coordinate, Coordinate, Coordinate]:
        """Return arc length, lateral offset (m) and relative heading (rad) of world coordinates."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        dx, dy = x - self.origin_x, y - self.origin_y
        return dx * cos + dy * sin, dy * cos - dx * sin, heading - self.heading
