"""How a stretch of road is laid onto a picture: as it is in the world, turned so that the road goes to the right.

On a straight road that is the road frame itself. On a bend the picture has the bend: the place (s, d = 0) at which it
is looked at stays where the road frame has it, the road goes to the right there, and bends away before and behind.
"""

from dataclasses import dataclass

import numpy as np

from hj_cosim.scene.road import Road

_EVERY = 4.0  # m of s between the corners of a drawn line


@dataclass(frozen=True)
class View:
    """The picture's frame, m: `x` to the right, `y` upwards."""

    road: Road
    along: float  # s at which the road is looked at

    def place(
        self, along: np.ndarray, lateral: np.ndarray, heading: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y (m) and heading (rad) in the picture of road coordinates, arrays of one shape."""
        road = self.road
        if road.is_straight:
            return along, lateral, heading
        x, y, direction = road.to_world(along, lateral, heading)
        origin_x, origin_y, ahead = road.to_world(self.along, 0.0, 0.0)
        cos, sin = np.cos(ahead), np.sin(ahead)
        right, up = x - origin_x, y - origin_y
        return self.along + right * cos + up * sin, up * cos - right * sin, direction - ahead

    def points(self, places: np.ndarray) -> np.ndarray:
        """Return points (..., 2) in the picture of road coordinates (..., 2), m."""
        if self.road.is_straight:
            return places
        x, y, _ = self.place(places[..., 0], places[..., 1], np.zeros(places.shape[:-1]))
        return np.stack([x, y], axis=-1)


def stretches(road: Road, start: float, stop: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the parts of a road between two s (m) that have the same lanes all along.

    Returns:
        For each, the s (N,) of its corners, m, and the lateral offsets (lanes + 1,), m, of its lines from the right.
    """
    if road.is_straight:
        return [(np.array([start, stop]), road.lane_lines(start))]
    start, stop = max(start, 0.0), min(stop, road.length)
    along = np.linspace(start, stop, max(int((stop - start) / _EVERY), 1) + 1)
    lines = [road.lane_lines(at) for at in along.tolist()]
    found, first = [], 0
    for i in range(1, len(along) + 1):
        if i == len(along) or len(lines[i]) != len(lines[first]) or lines[i][0] != lines[first][0]:
            found.append((along[first : min(i + 1, len(along))], lines[first]))
            first = i
    return [(each, line) for each, line in found if len(each) > 1]


def height_of(road: Road, along: np.ndarray, behind: float, ahead: float) -> tuple[float, float]:
    """Return the lowest and the highest y (m) of the road's lines in pictures that look at it from s (N,), m."""
    if road.is_straight:
        lines = road.lane_lines(0.0)
        return float(lines[0]), float(lines[-1])
    low, high = np.inf, -np.inf
    for at in along.tolist():
        view = View(road, at)
        for s, lines in stretches(road, at - behind, at + ahead):
            for line in lines[[0, -1]]:
                y = view.points(np.column_stack([s, np.full(len(s), line)]))[:, 1]
                low, high = min(low, float(y.min())), max(high, float(y.max()))
    return low, high
