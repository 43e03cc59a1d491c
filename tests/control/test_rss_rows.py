"""The proper response against the ad-rss library's (fixtures/rss_proper_response.json), and the rows' derivation."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from filter_in_loop import FilterInLoop
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.control.rss.rss_rows import NEVER_SEEN, RssDistances, rss_rows
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RssParameters

CASES = json.loads((Path(__file__).parent / "fixtures" / "rss_proper_response.json").read_text(encoding="utf-8"))
# The library's defaults, the ego's for both cars; the cases' outcome is the same with ρ = 2 s for the other.
AD_RSS = RssParameters(response_time=1.0, acceleration=3.5, brake_min=4.0, brake_max=8.0)
SIZE = np.array([5.0, 2.0])


def state_of(x, y, along, across):
    return [x, y, math.atan2(across, along), math.hypot(along, across)]


def respond(observe, frames, parameters=AD_RSS, memory=None):
    """Return the rows (p, q, c), and how many cars are dangerous, at the last of some frames [robot, car, ...]."""
    memory = np.full(8, NEVER_SEEN) if memory is None else memory
    for robot, *cars in frames:
        seen = observe(state_of(*robot), [state_of(*car) for car in cars])
        _, rows, dangerous = rss_rows(seen.robot, SIZE, seen.cars, RssDistances.of(parameters), memory)
    return rows.T, dangerous


def bounds_of(rows, along, across):
    """Return the bounds that rows put on v̇_x and v̇_y: (least and largest v̇_x, least and largest v̇_y)."""
    bounds = [-math.inf, math.inf, -math.inf, math.inf]
    speed, heading = math.hypot(along, across), math.atan2(across, along)
    # (v̇_x, v̇_y) = J (ω, a)
    jacobian = np.array(
        [[-speed * math.sin(heading), math.cos(heading)], [speed * math.cos(heading), math.sin(heading)]]
    )
    for p, q, c in rows:
        normal = np.linalg.solve(jacobian.T, [p, q])
        axis = int(np.argmax(np.abs(normal)))
        assert normal == pytest.approx(np.sign(normal[axis]) * np.eye(2)[axis], abs=1e-9)
        if normal[axis] > 0:
            bounds[2 * axis] = max(bounds[2 * axis], -c)
        else:
            bounds[2 * axis + 1] = min(bounds[2 * axis + 1], c)
    return bounds


@pytest.mark.parametrize("case", CASES, ids=[case["case"] for case in CASES])
def test_response_is_the_ad_rss_library_s(observe, case):
    rows, dangerous = respond(observe, case["frames"])
    expected = case["result"]
    assert (dangerous == 0) == expected["is_safe"]
    robot = case["frames"][-1][0]
    _, along_max, across_min, across_max = bounds_of(rows, robot[2], robot[3])
    # The library also lists the limits that always hold (3.5, 0.2); rows are demands only. Left is y > 0 here.
    assert along_max == (expected["lon_max"] if expected["lon"] == "BrakeMin" else math.inf)
    assert across_max == (expected["left_max"] if expected["lat_left"] == "BrakeMin" else math.inf)
    assert -across_min == (expected["right_max"] if expected["lat_right"] == "BrakeMin" else math.inf)


def test_left_and_right_are_mirror_images(observe):
    beside_left, _ = respond(observe, [[[200, 0, 22, 1.0], [200, 4, 22, 0]]])
    beside_right, _ = respond(observe, [[[200, 0, 22, -1.0], [200, -4, 22, 0]]])
    np.testing.assert_allclose(beside_left * [-1, 1, 1], beside_right, atol=1e-12)


def test_a_robot_ahead_may_brake_no_harder_than_b_max(observe):
    rows, dangerous = respond(observe, [[[300, 4, 22, 0], [200, 4, 22, 0]], [[230, 4, 22, 0], [200, 4, 25, 0]]])
    assert dangerous == 1
    assert bounds_of(rows, 22, 0)[:2] == [-8.0, math.inf]


def test_memory_is_kept_for_each_pair(observe):
    before = [[200, 4, 22, 0], [300, 4, 22, 0], [200, 8, 22, 0]]
    now = [[200, 4, 22, 1.0], [230, 4, 22, 0], [200, 8, 22, 0]]
    rows, dangerous = respond(observe, [before, now])
    assert dangerous == 2
    # The car ahead was safe along the road, the one beside was safe across it: one row each.
    assert len(rows) == 2
    assert bounds_of(rows, 22, 1.0)[1::2] == [-4.0, -0.8]


def test_after_a_cut_in_the_robot_brakes_though_it_was_laterally_safe_before(observe):
    beside, cut_in = [[200, 4, 22, 0], [215, 8, 20, 0]], [[200, 4, 22, 0], [215, 5, 20, 0]]
    rows, _ = respond(observe, [beside, cut_in])
    bounds = bounds_of(rows, 22, 0)
    assert bounds[1] == -4.0
    assert bounds[3] == -0.8
    # Not yet overlapping: memory alone, the lateral response.
    rows, _ = respond(observe, [beside, [[200, 4, 22, 0], [215, 6.1, 20, 0]]])
    assert bounds_of(rows, 22, 0)[1] == math.inf


def test_without_danger_there_is_no_row_and_the_memory_follows(observe):
    memory = np.full(8, NEVER_SEEN)
    rows, dangerous = respond(observe, [[[200, 4, 22, 0], [600, 4, 22, 0], [200, 12, 22, 0]]], memory=memory)
    assert (len(rows), dangerous) == (0, 0)
    assert memory[:2].tolist() == [1, 2]


@given(p=st.floats(-0.3, 0.3), v=st.floats(1, 40), omega=st.floats(-0.3, 0.3), a=st.floats(-6, 4))
def test_rows_are_the_derivatives_of_the_robot_s_speeds_along_and_across_the_road(observe, p, v, omega, a):
    seen_rows, _ = respond(observe, [[[200, 4, v * math.cos(p), v * math.sin(p)], [204, 4.5, v, 0]]])
    small = 1e-6
    ahead = (v + a * small) * math.cos(p + omega * small), (v + a * small) * math.sin(p + omega * small)
    rate = (ahead[0] - v * math.cos(p)) / small, (ahead[1] - v * math.sin(p)) / small
    longitudinal, lateral = seen_rows
    assert longitudinal @ [omega, a, 1.0] == pytest.approx(-rate[0] - 4.0, abs=1e-3)
    assert lateral @ [omega, a, 1.0] == pytest.approx(-rate[1] - 0.8, abs=1e-3)


@pytest.mark.parametrize("scheme", ["mi", "sw"])
def test_the_filter_brakes_behind_a_car_that_is_too_near(table, observe, scheme):
    settings = FilterSettings(kind="rss", scheme=scheme)
    rss = FilterInLoop(settings, table)
    rss.filter(observe([0.0, 4.0, 0.0, 24.0], [[90.0, 4.0, 0.0, 22.0]]), Control(0.0, 1.0))
    result = rss.filter(observe([0.0, 4.0, 0.0, 24.0], [[25.0, 4.0, 0.0, 22.0]]), Control(0.0, 1.0))
    assert result.constraints == 1
    assert result.control.acceleration == pytest.approx(-4.0 if scheme == "mi" else -6.0, abs=1e-4)


def test_the_memory_has_room_for_any_number_of_cars(table, observe):
    rss = FilterInLoop(FilterSettings(kind="rss"), table)
    cars = [[1000.0 + 50.0 * j, 4.0, 0.0, 22.0] for j in range(999)] + [[25.0, 4.0, 0.0, 22.0]]
    result = rss.filter(observe([0.0, 4.0, 0.0, 24.0], cars), Control(0.0, 1.0))
    assert set(result.rows.vehicle.tolist()) == {999}
