"""The road frame: arc length s along the road, lateral offset d to the left, heading relative to it.

Everything that plans, controls or measures works in this frame; only traffic/ and what is drawn on a map know world
coordinates. d = 0 is the centre line of lane 0, the right-most. Where lanes lie is a road's own business: who wants to
know asks it, with the s at which it matters.
"""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

# One place, or the places of many cars.
Coordinate = TypeVar("Coordinate", float, np.ndarray)


class Road(Protocol):
    """A road of lanes of one width, numbered from 0 at the right; `along` is s and `lateral` is d everywhere, m."""

    @property
    def length(self) -> float:
        """How far s goes, m."""
        ...

    @property
    def lane_count(self) -> int:
        """How many lanes have a number; not all of them need to exist at every s."""
        ...

    @property
    def lane_width(self) -> float:
        """How wide each lane is, m."""
        ...

    def lanes_at(self, along: float) -> range:
        """Return the lanes that exist at s."""
        ...

    def lane_centre(self, lane: int, along: float) -> float:
        """Return the lateral offset of a lane's centre line, m."""
        ...

    def lane_centres(self, lane: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lateral offsets (J,), m, of the centre lines of lanes (J,)."""
        ...

    def lane_at(self, lateral: float, along: float) -> int:
        """Return the lane whose centre line is nearest to a lateral offset, of those that exist there."""
        ...

    def nearest_lanes(self, lateral: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lanes (J,) int whose centre lines are nearest to lateral offsets (J,); see lane_at."""
        ...

    def overlap_reach(self, width: float) -> float:
        """Return the distance (m) of a body's centre from a lane's centre line at which it only just touches the lane.

        One whose centre is nearer overlaps the lane, and drivers there notice it.
        """
        ...

    def lanes_overlapped(self, lateral: float, width: float, along: float) -> range:
        """Return the lanes that a body `width` m wide, with its centre at `lateral`, overlaps; none beside the road."""
        ...

    def lane_lines(self, along: float) -> np.ndarray:
        """Return the lateral offsets (lanes + 1,), m, of the lines beside the lanes, the road's right edge first."""
        ...

    def heading_at(self, along: float) -> float:
        """Return the road's heading in the world, rad, counter-clockwise from +x."""
        ...

    def curvature_at(self, along: float) -> float:
        """Return dheading/ds, 1/m, positive where the road bends to the left."""
        ...

    @property
    def lap(self) -> float:
        """After how many m of s a closed road is where it began; 0 of an open one."""
        ...

    @property
    def is_straight(self) -> bool:
        """Whether the road frame is the world's, turned and moved, so that bodies move alike in both."""
        ...

    @property
    def sharpest(self) -> float:
        """The largest curvature of any lane's centre line in the world, 1/m."""
        ...

    def stretch_at(self, along: float, lateral: float) -> float:
        """Return how many metres of the world a metre of s is at d: ds/dt = v cosθ over this. 1 on a straight road."""
        ...

    def bend_rate(self, along: float, lateral: float, forward: float) -> float:
        """Return how fast the road turns under who goes along it at `forward` = v cosθ, rad/s: dθ/dt = ω − this."""
        ...

    def lane_end(self, lane: int, along: float) -> float:
        """Return the s (m) at which a lane ends that exists at s; inf where it does not end on this road."""
        ...

    def leads_off(self, lane: int, along: float) -> bool:
        """Return whether a lane that ends goes on beside this road, as an exit does, rather than being closed."""
        ...

    def lasting_lanes(self, along: np.ndarray, ahead: float) -> np.ndarray:
        """Return the first and the last (J, 2) of the lanes that exist all the way from s (J,) to `ahead` m beyond.

        Where there is none, the first exceeds the last.
        """
        ...

    def speed_limit(self, along: np.ndarray) -> np.ndarray:
        """Return the speed limits (J,), m/s, at s (J,); inf where there is none, or none that drivers mind."""
        ...

    def speed_limits(self, start: float, stop: float) -> np.ndarray:
        """Return the limits between two s (m), (L, 2): where each begins (the first: `start`), m, and itself, m/s."""
        ...

    def to_world(
        self, along: Coordinate, lateral: Coordinate, heading: Coordinate
    ) -> tuple[Coordinate, Coordinate, Coordinate]:
        """Return world x, y (m) and heading (rad) of road coordinates: three numbers, or three arrays of one shape."""
        ...

    def from_world(self, x: float, y: float, heading: float, near: float) -> tuple[float, float, float]:
        """Return s, d (m) and the heading relative to the road (rad) of a place in the world.

        Args:
            x, y: m.
            heading: rad.
            near: an s (m) some metres away at most: a road may come by the same place twice.
        """
        ...


@dataclass(frozen=True)
class StraightRoad:
    """A straight road whose lanes all reach from its beginning to its end; see Road.

    It is the world's own frame when it starts at (0, 0) and heads along +x.
    """

    lane_count: int
    lane_width: float = 4.0  # m
    length: float = 10_000.0  # m
    origin_x: float = 0.0  # m, world position of s = 0 on lane 0's centre line
    origin_y: float = 0.0  # m
    heading: float = 0.0  # rad, counter-clockwise from +x

    def lanes_at(self, along: float) -> range:
        """Return all lanes."""
        return range(self.lane_count)

    def lane_centre(self, lane: int, along: float) -> float:
        """Return the lateral offset of a lane's centre line, m."""
        return lane * self.lane_width

    def lane_centres(self, lane: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lateral offsets (J,), m, of the centre lines of lanes (J,)."""
        return np.asarray(lane * self.lane_width)

    def lane_at(self, lateral: float, along: float) -> int:
        """Return the lane whose centre line is nearest to a lateral offset (m), within the road."""
        return min(max(math.floor(lateral / self.lane_width + 0.5), 0), self.lane_count - 1)

    def nearest_lanes(self, lateral: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lanes (J,) int whose centre lines are nearest to lateral offsets (J,), m, within the road."""
        return np.clip(np.floor(lateral / self.lane_width + 0.5), 0, self.lane_count - 1).astype(np.int64)

    def overlap_reach(self, width: float) -> float:
        """Return how far from a lane's centre line (m) the centre of a body is that only touches the lane; see Road."""
        return 0.5 * (self.lane_width + width)

    def lanes_overlapped(self, lateral: float, width: float, along: float) -> range:
        """Return the lanes that a body `width` m wide, with its centre at `lateral`, overlaps; see Road."""
        reach = self.overlap_reach(width)
        first = max(math.floor((lateral - reach) / self.lane_width) + 1, 0)
        last = min(math.ceil((lateral + reach) / self.lane_width) - 1, self.lane_count - 1)
        return range(first, last + 1)

    def lane_lines(self, along: float) -> np.ndarray:
        """Return the lateral offsets (lane_count + 1,), m, of the lines beside the lanes, from the right."""
        return (np.arange(self.lane_count + 1) - 0.5) * self.lane_width

    @property
    def lap(self) -> float:
        """Return 0."""
        return 0.0

    @property
    def is_straight(self) -> bool:
        """True."""
        return True

    @property
    def sharpest(self) -> float:
        """Return 0."""
        return 0.0

    def stretch_at(self, along: float, lateral: float) -> float:
        """Return 1."""
        return 1.0

    def bend_rate(self, along: float, lateral: float, forward: float) -> float:
        """Return 0."""
        return 0.0

    def lane_end(self, lane: int, along: float) -> float:
        """Return inf: lanes end where the road does."""
        return math.inf

    def leads_off(self, lane: int, along: float) -> bool:
        """Return False."""
        return False

    def lasting_lanes(self, along: np.ndarray, ahead: float) -> np.ndarray:
        """Return the first and the last lane (J, 2), the same everywhere."""
        lanes = np.zeros((len(along), 2), np.int64)
        lanes[:, 1] = self.lane_count - 1
        return lanes

    def speed_limit(self, along: np.ndarray) -> np.ndarray:
        """Return inf (J,): what is the same all along is a matter of the drivers' desired speeds."""
        return np.full(len(along), math.inf)

    def speed_limits(self, start: float, stop: float) -> np.ndarray:
        """Return the one limit that there is, inf, (1, 2)."""
        return np.array([[start, math.inf]])

    def heading_at(self, along: float) -> float:
        """Return the road's heading in the world, rad: the same everywhere."""
        return self.heading

    def curvature_at(self, along: float) -> float:
        """Return 0."""
        return 0.0

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

    def from_world(self, x: float, y: float, heading: float, near: float) -> tuple[float, float, float]:
        """Return s, d (m) and the relative heading (rad) of a place in the world; `near` does not matter."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        right, up = x - self.origin_x, y - self.origin_y
        return right * cos + up * sin, up * cos - right * sin, heading - self.heading
