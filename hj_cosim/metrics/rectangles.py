"""Oriented rectangles, the bodies of cars: how far apart they are, whether they overlap, and when they will."""

import math

from numba import njit


@njit(cache=True)
def rectangles_overlap(
    dx: float,
    dy: float,
    heading_a: float,
    length_a: float,
    width_a: float,
    heading_b: float,
    length_b: float,
    width_b: float,
) -> bool:
    """Return whether two rectangles overlap, by the separating axis theorem; touching is no overlap.

    Args:
        dx, dy: centre of b minus centre of a, m.
        heading_a, heading_b: rad.
        length_a, width_a, length_b, width_b: m.
    """
    cos_a, sin_a = math.cos(heading_a), math.sin(heading_a)
    cos_b, sin_b = math.cos(heading_b), math.sin(heading_b)
    cos_ab = abs(cos_a * cos_b + sin_a * sin_b)
    sin_ab = abs(cos_a * sin_b - sin_a * cos_b)
    return (
        abs(dx * cos_a + dy * sin_a) < 0.5 * (length_a + length_b * cos_ab + width_b * sin_ab)
        and abs(dy * cos_a - dx * sin_a) < 0.5 * (width_a + length_b * sin_ab + width_b * cos_ab)
        and abs(dx * cos_b + dy * sin_b) < 0.5 * (length_b + length_a * cos_ab + width_a * sin_ab)
        and abs(dy * cos_b - dx * sin_b) < 0.5 * (width_b + length_a * sin_ab + width_a * cos_ab)
    )


@njit(cache=True)
def _nearest_corner(
    dx: float, dy: float, heading_a: float, half_length: float, half_width: float, heading_b: float, a: float, b: float
) -> float:
    """Return the smallest distance from rectangle a (half sizes given) to the corners of b (half sizes a, b)."""
    cos_a, sin_a = math.cos(heading_a), math.sin(heading_a)
    cos_b, sin_b = math.cos(heading_b), math.sin(heading_b)
    nearest = math.inf
    for end in (-1.0, 1.0):
        for side in (-1.0, 1.0):
            x = dx + end * a * cos_b - side * b * sin_b
            y = dy + end * a * sin_b + side * b * cos_b
            outside_length = max(abs(x * cos_a + y * sin_a) - half_length, 0.0)
            outside_width = max(abs(y * cos_a - x * sin_a) - half_width, 0.0)
            nearest = min(nearest, math.hypot(outside_length, outside_width))
    return nearest


@njit(cache=True)
def rectangle_distance(
    dx: float,
    dy: float,
    heading_a: float,
    length_a: float,
    width_a: float,
    heading_b: float,
    length_b: float,
    width_b: float,
) -> float:
    """Return the distance between two rectangles that do not overlap, m. Arguments as rectangles_overlap.

    Two convex polygons that do not overlap are nearest at a corner of one of them.
    """
    return min(
        _nearest_corner(dx, dy, heading_a, 0.5 * length_a, 0.5 * width_a, heading_b, 0.5 * length_b, 0.5 * width_b),
        _nearest_corner(-dx, -dy, heading_b, 0.5 * length_b, 0.5 * width_b, heading_a, 0.5 * length_a, 0.5 * width_a),
    )


# Ten parameters: plain numbers of one pair of bodies, which no call has to pack in the loop over pairs.
@njit(cache=True)
def time_to_overlap(
    dx: float,
    dy: float,
    dvx: float,
    dvy: float,
    heading_a: float,
    length_a: float,
    width_a: float,
    heading_b: float,
    length_b: float,
    width_b: float,
) -> float:
    """Return the time until two rectangles that move at constant velocity overlap, s; 0 where they do, inf if never.

    By the separating axis theorem they overlap while their projections do on each of their four axes, and on an axis
    that is an interval of time: the latest of the four beginnings counts, if it is before the earliest end.

    Args:
        dx, dy: centre of b minus centre of a, m.
        dvx, dvy: velocity of b minus velocity of a, m/s; neither turns.
        heading_a, heading_b: rad.
        length_a, width_a, length_b, width_b: m.
    """
    cos_a, sin_a = math.cos(heading_a), math.sin(heading_a)
    cos_b, sin_b = math.cos(heading_b), math.sin(heading_b)
    cos_ab = abs(cos_a * cos_b + sin_a * sin_b)
    sin_ab = abs(cos_a * sin_b - sin_a * cos_b)
    begins, ends = 0.0, math.inf
    for axis in range(4):
        if axis == 0:
            cos, sin, reach = cos_a, sin_a, 0.5 * (length_a + length_b * cos_ab + width_b * sin_ab)
        elif axis == 1:
            cos, sin, reach = -sin_a, cos_a, 0.5 * (width_a + length_b * sin_ab + width_b * cos_ab)
        elif axis == 2:
            cos, sin, reach = cos_b, sin_b, 0.5 * (length_b + length_a * cos_ab + width_a * sin_ab)
        else:
            cos, sin, reach = -sin_b, cos_b, 0.5 * (width_b + length_a * sin_ab + width_a * cos_ab)
        apart = dx * cos + dy * sin
        speed = dvx * cos + dvy * sin
        if speed == 0.0:
            if abs(apart) >= reach:
                return math.inf
            continue
        if speed < 0.0:
            apart, speed = -apart, -speed
        begins = max(begins, (-reach - apart) / speed)
        ends = min(ends, (reach - apart) / speed)
        if begins >= ends:
            return math.inf
    return begins
