"""Where the bodies of the robot and of another car overlap in a game (jitted)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Bodies(NamedTuple):
    """How large the robot and the other cars are, m."""

    length: float  # the robot's
    width: float
    other_length: float
    other_width: float


@njit(cache=True)
def bodies_overlap(p_x: float, p_y: float, theta: float, bodies: Bodies) -> bool:
    """Return whether the robot's rectangle, turned by θ, overlaps the other car's, which lies along the road.

    By the separating axis theorem.

    Args:
        p_x, p_y: m, between the centres, robot − other.
        theta: rad, |θ| <= π/2.
        bodies: of both.
    """
    length, width, other_length, other_width = bodies
    cos, sin = math.cos(theta), math.sin(theta)
    return (
        abs(p_x) < 0.5 * (other_length + length * cos + width * abs(sin))
        and abs(p_y) < 0.5 * (other_width + length * abs(sin) + width * cos)
        and abs(p_x * cos + p_y * sin) < 0.5 * (length + other_length * cos + other_width * abs(sin))
        and abs(p_y * cos - p_x * sin) < 0.5 * (width + other_length * abs(sin) + other_width * cos)
    )


@njit(cache=True)
def where_bodies_overlap(states: np.ndarray, bodies: Bodies) -> np.ndarray:
    """Return at which relative states (n, 5) they do, (n,) bool."""
    found = np.empty(len(states), np.bool_)
    for i in range(len(states)):
        found[i] = bodies_overlap(states[i, 0], states[i, 1], states[i, 2], bodies)
    return found
