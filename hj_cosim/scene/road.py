"""The road frame: arc length s along the road, lateral offset d to the left, heading relative to it.

Everything that plans, controls or measures works in this frame; only traffic/ and what is drawn on a map know world
coordinates. d = 0 is the centre line of lane 0, the right-most. Where lanes lie is a road's own business: who wants to
know asks it, with the s at which it matters.
"""

import json
import math
from dataclasses import asdict, dataclass
from typing import Protocol, TypeVar

import numpy as np
from pydantic import TypeAdapter, ValidationError

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

    def to_world(
        self, along: Coordinate, lateral: Coordinate, heading: Coordinate
    ) -> tuple[Coordinate, Coordinate, Coordinate]:
        """Return world x, y (m) and heading (rad) of road coordinates: three numbers, or three arrays of one shape."""
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


def road_to_json(road: Road) -> str:
    """Return a road as the text that `road_from_json` reads.

    Raises:
        TypeError: if it is a kind of road that has no such text.
    """
    if not isinstance(road, StraightRoad):
        raise TypeError(f"only straight roads can be written, not a {type(road).__name__}")
    return json.dumps(asdict(road))


def road_from_json(text: str | bytes) -> StraightRoad:
    """Return the road that a text of `road_to_json` describes.

    Raises:
        ValueError: if it describes none.
    """
    try:
        return TypeAdapter(StraightRoad).validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        reason = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"it does not describe a road: {f'{key}: ' if key else ''}{reason}") from error
