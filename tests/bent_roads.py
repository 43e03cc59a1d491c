"""Roads round circles and through knots of one's own, for tests that need one without a network."""

import numpy as np

from hj_cosim.scene.route_road import RouteRoad

WIDTH = 3.5  # m


def road_through(knots: np.ndarray, length: float, **changed: object) -> RouteRoad:
    """Return a road of three lanes whose left one runs through these knots."""
    parts = {
        "lane_count": 3,
        "lane_width": WIDTH,
        "length": length,
        "knots": knots,
        "reference_lane": 2,
        "section_start": np.array([0.0]),
        "first_lane": np.array([0]),
        "lanes_there": np.array([3]),
        "leading_off": np.array([0]),
    }
    return RouteRoad(**(parts | changed))


def circle(radius: float, length: float = 1000.0, **changed: object) -> RouteRoad:
    """Return a road whose left lane is part of a circle about (0, radius), to the left, or to the right if negative."""
    angle = np.arange(0.0, length + 1.0, 10.0) / radius
    return road_through(radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]), length, **changed)
