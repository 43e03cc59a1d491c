import math
from itertools import pairwise

import numpy as np
import pytest

from hj_cosim.metrics.rectangles import rectangle_distance, rectangles_overlap, time_to_overlap


def outline(x: float, y: float, heading: float, length: float, width: float, points: int) -> np.ndarray:
    """Return points along the edges of a rectangle, (4 points, 2)."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * [length / 2, width / 2]
    share = np.linspace(0.0, 1.0, points)[:, None]
    edges = np.concatenate([a + share * (b - a) for a, b in pairwise(corners)])
    cos, sin = math.cos(heading), math.sin(heading)
    return edges @ np.array([[cos, sin], [-sin, cos]]) + [x, y]


def inside(points: np.ndarray, x: float, y: float, heading: float, length: float, width: float) -> np.ndarray:
    cos, sin = math.cos(heading), math.sin(heading)
    local = (points - [x, y]) @ np.array([[cos, -sin], [sin, cos]])
    return (np.abs(local[:, 0]) < length / 2) & (np.abs(local[:, 1]) < width / 2)


def test_overlap_and_distance_agree_with_sampled_outlines():
    draw = np.random.default_rng(0)
    overlaps = 0
    for _ in range(150):
        dx, dy = draw.uniform(-8, 8, 2)
        heading_a, heading_b = draw.uniform(-math.pi, math.pi, 2)
        (length_a, length_b), (width_a, width_b) = draw.uniform(3, 8, 2), draw.uniform(1, 3, 2)
        a, b = (0.0, 0.0, heading_a, length_a, width_a), (dx, dy, heading_b, length_b, width_b)
        outline_a, outline_b = outline(*a, 60), outline(*b, 60)
        sampled = bool(np.any(inside(outline_a, *b)) or np.any(inside(outline_b, *a)))
        arguments = (dx, dy, heading_a, length_a, width_a, heading_b, length_b, width_b)
        distance = float(np.min(np.linalg.norm(outline_a[:, None] - outline_b[None], axis=2)))

        overlap = rectangles_overlap(*arguments)

        overlaps += overlap
        if distance > 0.1 or sampled:  # the sampled outlines cannot tell a graze from a miss
            assert overlap == sampled
        if not overlap and not sampled:
            assert rectangle_distance(*arguments) == pytest.approx(distance, abs=0.02 if distance > 0.3 else 0.1)
    assert 30 < overlaps < 120


def test_touching_is_no_overlap():
    assert not rectangles_overlap(5.0, 0.0, 0.0, 5.0, 2.0, 0.0, 5.0, 2.0)
    assert not rectangles_overlap(0.0, 2.0, 0.0, 5.0, 2.0, 0.0, 5.0, 2.0)
    assert rectangles_overlap(4.999, 1.999, 0.0, 5.0, 2.0, 0.0, 5.0, 2.0)


def first_overlap_by_walking(dx, dy, dvx, dvy, *bodies, horizon=12.0, step=0.005):
    """Return the first of closely spaced times at which the bodies overlap; +inf if there is none."""
    for t in np.arange(0.0, horizon, step):
        if rectangles_overlap(dx + dvx * t, dy + dvy * t, *bodies):
            return t
    return np.inf


def test_time_to_overlap_is_what_a_walk_in_small_steps_finds():
    draw = np.random.default_rng(5)
    met = 0
    for _ in range(300):
        dx, dy = draw.uniform(-40, 40), draw.uniform(-8, 8)
        dvx, dvy = -np.sign(dx) * draw.uniform(0, 15), -np.sign(dy) * draw.uniform(-0.5, 2.0)
        bodies = (draw.uniform(-0.5, 0.5), 5.0, 2.0, draw.uniform(-3, 3), draw.uniform(3, 18), draw.uniform(1.5, 2.6))
        walked = first_overlap_by_walking(dx, dy, dvx, dvy, *bodies)
        exact = time_to_overlap(dx, dy, dvx, dvy, *bodies)
        if np.isfinite(walked):
            met += 1
            assert walked - 0.0051 <= exact <= walked + 1e-9
        else:
            later = exact + 0.005  # a corner may be grazed for less than a step
            assert exact > 11.9 or not rectangles_overlap(dx + dvx * later, dy + dvy * later, *bodies)
    assert met > 80


def test_bodies_that_move_alike_overlap_now_or_never():
    bodies = (0.0, 5.0, 2.0, 0.0, 5.0, 2.0)
    assert time_to_overlap(4.0, 1.0, 0.0, 0.0, *bodies) == 0.0
    assert time_to_overlap(6.0, 1.0, 0.0, 0.0, *bodies) == math.inf
    assert time_to_overlap(10.0, 0.0, -2.0, 0.0, *bodies) == 2.5
    assert time_to_overlap(10.0, 2.0, -2.0, 0.0, *bodies) == math.inf  # they pass, side by side
