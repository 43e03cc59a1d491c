"""RSS distances against the ad-rss library's and hand-worked cases (fixtures/rss_distances.json)."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.vehicles.rss import lateral_distance, longitudinal_distance, stopping_distance

CASES = json.loads((Path(__file__).parent / "fixtures" / "rss_distances.json").read_text(encoding="utf-8"))
DEFAULTS = CASES["defaults"]
speeds = st.floats(0.0, 40.0)


def longitudinal(rear_speed, front_speed, rear, front):
    return longitudinal_distance(rear_speed, front_speed, rear["rho"], rear["a_acc"], rear["b_min"], front["b_max"])


def lateral(left_speed, right_speed, left, right):
    """Both speeds positive to the right, as in the fixture."""
    return lateral_distance(
        left_speed,
        -right_speed,
        left["rho"],
        left["a_lat"],
        left["b_lat"],
        right["rho"],
        right["a_lat"],
        right["b_lat"],
        0.5 * (left["mu"] + right["mu"]),  # the library takes the mean of both cars' margins
    )


@pytest.mark.parametrize("case", CASES["lon"])
def test_longitudinal_distance_is_the_ad_rss_library_s(case):
    distance = longitudinal(case["v_rear"], case["v_front"], case["rear"], case["front"])
    assert distance == pytest.approx(case["d_min"], abs=1e-9)


@pytest.mark.parametrize("case", CASES["lat"])
def test_lateral_distance_is_the_ad_rss_library_s(case):
    distance = lateral(case["v_left"], case["v_right"], case["left"], case["right"])
    assert distance == pytest.approx(case["d_min"], abs=1e-9)


def test_hand_worked_cases():
    rear_ego, other = DEFAULTS["ego"], DEFAULTS["other"]
    same = dict(rear_ego)
    assert longitudinal(20, 20, rear_ego, other) == pytest.approx(20 + 1.75 + 23.5**2 / 8 - 400 / 16, abs=1e-12)
    assert longitudinal(10, 30, rear_ego, other) == 0.0
    assert lateral(0.0, 0.0, same, same) == pytest.approx(0.1 + 2 * (0.1 + 0.04 / 1.6), abs=1e-12)
    assert lateral(1.0, 0.0, same, same) == pytest.approx(0.1 + 1.1 + 1.44 / 1.6 + 0.125, abs=1e-12)
    assert lateral(-1.0, 1.0, same, same) == 0.0


@given(rear=speeds, front=speeds, faster=st.floats(0.0, 10.0))
def test_a_faster_rear_car_needs_more_room_and_a_faster_front_car_less(rear, front, faster):
    parameters = (0.5, 3.0, 4.0, 8.0)
    distance = longitudinal_distance(rear, front, *parameters)
    assert longitudinal_distance(rear + faster, front, *parameters) >= distance >= 0.0
    assert longitudinal_distance(rear, front + faster, *parameters) <= distance


@given(rear=speeds, front=speeds)
def test_the_distance_is_just_enough_for_the_worst_case_to_end_without_contact(rear, front):
    response, acceleration, brake_min, brake_max = 0.5, 3.0, 4.0, 8.0
    gap = longitudinal_distance(rear, front, response, acceleration, brake_min, brake_max)
    after = rear + response * acceleration
    driven = rear * response + 0.5 * acceleration * response**2 + stopping_distance(after, brake_min)
    left_over = gap + stopping_distance(front, brake_max) - driven
    assert left_over >= -1e-9
    if gap > 0.0:
        assert left_over == pytest.approx(0.0, abs=1e-9)


def test_a_car_that_rolls_back_has_no_stopping_distance():
    assert stopping_distance(-3.0, 4.0) == 0.0
    assert stopping_distance(8.0, 4.0) == 8.0
