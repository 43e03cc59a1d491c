"""A robot whose heading is within what RoadEdge says stays on the road; one beyond does not."""

import math
from itertools import product

import numpy as np
import pytest
from filter_in_loop import ROBOT, STEP, FilterInLoop

from hj_cosim.control.problem.road_edge import BRAKING, SPARE, RoadEdge
from hj_cosim.locations import scenarios_folder
from hj_cosim.scene.observation import Control
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings, NetworkSettings
from hj_cosim.traffic.route import read_network

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


def test_beside_the_line_the_tail_stays_within_as_it_turns_away():
    for room in (0.1, 0.3, 0.7):
        lowest, highest = EDGE.headings_within((0.0, LEFT_LINE - 0.5 * WIDTH - room, 0.0, 2.0), 0.3)
        assert 0.5 * LENGTH * math.sin(-lowest) == pytest.approx(room)
        assert highest < 0.4
    # Who is beyond the line may turn back, by as much as brings its tail no farther out than SPARE.
    assert 0.5 * LENGTH * math.sin(-EDGE.headings_within((0.0, 14.5, 0.0, 2.0), 0.3)[0]) == pytest.approx(SPARE)


def test_who_turns_back_before_the_line_does_not_gain_speed(table, observe):
    turning_back = observe([0.0, 12.0, 0.25, 15.0], [[9000.0, 4.0, 0.0, 20.0]])
    for keeps, kind in product((True, False), ("spc", "rss")):
        safety_filter = FilterInLoop(FilterSettings(keep_on_road=keeps, kind=kind), table)
        control = safety_filter.filter(turning_back, Control(0.3, 4.0)).control
        assert (control.acceleration <= 0.0) is keeps
        assert (control.omega == -ROBOT.omega_max) is keeps


@pytest.mark.parametrize("kind", ["spc", "rss"])
@pytest.mark.parametrize("speed", [1.0, 8.0, 20.0, 33.0])
def test_a_filter_that_keeps_to_the_road_never_lets_a_corner_out_whatever_is_desired(table, observe, speed, kind):
    draw = np.random.default_rng(4)
    for keeps, side in product((True, False), (-1.0, 1.0)):  # from the lane beside the edge
        safety_filter = FilterInLoop(FilterSettings(keep_on_road=keeps, kind=kind), table)
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


@pytest.fixture(scope="module")
def dropping():
    """Return a road whose right lane ends."""
    network = NetworkSettings(file=str(scenarios_folder() / "lane_drop.net.xml"), from_edge="e0", to_edge="e3")
    road, _ = read_network(scenarios_folder() / "lane_drop.net.xml", network)
    return road


@pytest.fixture(scope="module")
def ending(dropping) -> tuple[RoadEdge, float]:
    """Return the edge of that road, and where the lane ends."""
    return RoadEdge(dropping, LENGTH, WIDTH, STEP), dropping.lane_end(0, 10.0)


@pytest.mark.parametrize("speed", [3.0, 15.0, 33.0])
@pytest.mark.parametrize("lateral", [0.0, 1.3])  # in the middle of the lane, and nearly out of it
def test_who_stays_in_a_lane_that_ends_stops_before_its_end_and_not_long_before(ending, speed, lateral):
    edge, end = ending
    x = end - 200.0
    hardest = 0.0
    for _ in range(6000):
        change = min(1.0, max((edge.speed_within((x, lateral, 0.0, speed)) - speed) / STEP, -6.0))
        hardest = min(hardest, change)
        x += max(speed + 0.5 * change * STEP, 0.0) * STEP
        speed = max(speed + change * STEP, 0.0)
    assert end - 1.2 <= x + 0.5 * LENGTH <= end - 0.9
    assert hardest == pytest.approx(-BRAKING, abs=0.3)


def test_who_is_out_of_it_by_then_may_drive_on(ending):
    edge, end = ending
    assert edge.speed_within((end - 20.0, 1.3, 0.0, 20.0)) < 13.0
    assert edge.speed_within((end - 20.0, 1.3, 0.1, 20.0)) == math.inf  # 2 m farther left where it ends
    assert edge.speed_within((end - 20.0, 1.3, 0.05, 20.0)) < 13.0  # 1 m: half of it is still in the lane then
    assert edge.speed_within((end - 20.0, 1.3, 0.08, 20.0)) < 13.0  # 1.6 m: a corner is, for it is turned
    assert edge.speed_within((end - 20.0, 3.6, 0.0, 20.0)) == math.inf  # in the next lane
    assert edge.speed_within((end - 20.0, 3.6, -0.1, 20.0)) == math.inf  # and on its way into the lane, but not yet
    assert edge.speed_within((end - 100.0, 0.0, 0.0, 20.0)) == math.inf  # there is time


def test_a_filter_stops_a_robot_that_is_not_let_out_of_its_lane(table, observe, dropping):
    end = dropping.lane_end(0, 10.0)
    for keeps in (True, False):
        safety_filter = FilterInLoop(FilterSettings(keep_on_road=keeps), table, road=dropping)
        x, speed = end - 60.0, 15.0
        for _ in range(600):
            seen = observe([x, 0.0, 0.0, speed], [[9000.0, 4.0, 0.0, 20.0]])
            change = safety_filter.filter(seen, Control(0.0, 1.0)).control.acceleration
            x, speed = x + speed * STEP, max(speed + change * STEP, 0.0)
        assert bool(x + 0.5 * LENGTH <= end) is keeps


def test_who_has_left_a_lane_that_ends_does_not_turn_back_into_it(ending):
    edge, end = ending
    lane_centre, line = 3.75, 1.875
    clear = line + 0.5 * WIDTH + 2.0 * SPARE
    for speed in (8.0, 20.0):
        lowest, highest = edge.headings_within((end - 8.0, clear, 0.0, speed), 0.2)
        assert -0.03 < lowest <= 0.0 < highest
        # Far from the end, and who is still in the lane, may turn right as elsewhere.
        assert edge.headings_within((end - 300.0, lane_centre, 0.0, speed), 0.2)[0] < -0.1
        assert edge.headings_within((end - 8.0, clear - 0.3, 0.0, speed), 0.2)[0] < -0.1
