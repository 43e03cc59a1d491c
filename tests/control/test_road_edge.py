"""A robot whose heading is within what RoadEdge says stays on the road; one beyond does not."""

import math
from itertools import product

import numpy as np
import pytest
from filter_in_loop import ROBOT, STEP, FilterInLoop

from hj_cosim.control.spc.road_edge import SPARE, RoadEdge
from hj_cosim.scene.observation import Control
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings

LENGTH, WIDTH, LEFT_LINE = 5.0, 2.0, 14.0
EDGE = RoadEdge(StraightRoad(4), LENGTH, WIDTH, 0.0)


def farthest_left(lateral: float, heading: float, speed: float, omega: float) -> float:
    """Return how far out the left front corner comes while the robot turns back, in steps of a millisecond, m."""
    farthest, step = -math.inf, 1e-3
    while True:
        farthest = max(farthest, lateral + 0.5 * LENGTH * math.sin(heading) + 0.5 * WIDTH)
        if heading <= 0.0:
            return farthest
        lateral += speed * math.sin(heading) * step
        heading -= omega * step


@pytest.mark.parametrize(
    ("lateral", "speed", "omega"), list(product((8.0, 11.0, 12.5), (0.5, 5.0, 15.0, 30.0), (0.1, 0.3)))
)
def test_from_the_greatest_heading_the_body_just_comes_to_the_line(lateral, speed, omega):
    _, highest = EDGE.headings_within((0.0, lateral, 0.0, speed), omega)
    assert farthest_left(lateral, highest, speed, omega) == pytest.approx(LEFT_LINE - SPARE, abs=0.02) or (
        highest == pytest.approx(math.pi / 2) and farthest_left(lateral, highest, speed, omega) < LEFT_LINE
    )


def test_right_is_left_in_a_mirror():
    for lateral, speed in ((1.0, 20.0), (5.0, 3.0), (11.3, 33.0)):
        lowest, highest = EDGE.headings_within((0.0, lateral, 0.0, speed), 0.2)
        mirrored = EDGE.headings_within((0.0, 12.0 - lateral, 0.0, speed), 0.2)
        assert mirrored == pytest.approx((-highest, -lowest))


def test_beyond_the_line_straight_on_is_all_that_is_left():
    assert EDGE.headings_within((0.0, 14.5, 0.05, 20.0), 0.2)[1] == 0.0


@pytest.mark.parametrize("speed", [1.0, 8.0, 20.0, 33.0])
def test_a_filter_that_keeps_to_the_road_never_lets_a_corner_out_whatever_is_desired(table, observe, speed):
    draw = np.random.default_rng(4)
    for keeps, side in product((True, False), (-1.0, 1.0)):  # from the lane beside the edge
        safety_filter = FilterInLoop(FilterSettings(keep_on_road=keeps), table)
        x, y, heading, omega, out = 0.0, 6.0 + 5.0 * side, 0.0, 0.0, -math.inf
        for step in range(600):
            if step % 25 == 0:
                omega = side * draw.uniform(-0.1, 0.3)
            seen = observe([x, y, heading, speed], [[9000.0, 4.0, 0.0, 20.0]])
            omega_now = safety_filter.filter(seen, Control(omega, 0.0)).control.omega
            heading += omega_now * STEP
            x, y = x + speed * math.cos(heading) * STEP, y + speed * math.sin(heading) * STEP
            reach = 0.5 * (ROBOT.length * abs(math.sin(heading)) + ROBOT.width * math.cos(heading))
            out = max(out, y + reach - 14.0, -2.0 - (y - reach))
        assert (out <= 0.0) is keeps
