import pytest
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.planning.optimistic.reward import driving_reward, reward_model, total_reward
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import PlannerSettings

ROAD = StraightRoad(4)


@pytest.mark.parametrize(
    ("speed", "lane", "crashed", "reward"),
    [
        (15.0, 0, False, 0.0),
        (30.0, 0, False, 0.4),
        (15.0, 3, False, 1.0),
        (30.0, 3, False, 1.4),
        (22.5, 1, False, 0.2 + 1 / 3),
        (30.0, 3, True, 0.4),
        (15.0, 0, True, -1.0),
    ],
)
def test_the_driving_reward_is_the_papers(speed, lane, crashed, reward):
    assert driving_reward(speed, lane, crashed, reward_model(PlannerSettings(), ROAD)) == pytest.approx(reward)


@given(
    st.sampled_from(["op", "hjop"]),
    st.floats(0.0, 15.0),
    st.floats(0.0, 1.0),
    st.integers(0, 3),
    st.booleans(),
    st.floats(-1e3, 1e3),
    st.floats(0.1, 50.0),
)
def test_rewards_lie_between_0_and_1(kind, floor, share, lane, crashed, value, clip):
    weights = reward_model(PlannerSettings(kind=kind, speed_floor=floor, value_clip=clip), ROAD)
    speed = floor + share * (30.0 - floor)
    assert -1e-9 <= total_reward(speed, lane, crashed, value, weights) <= 1.0 + 1e-9


@pytest.mark.parametrize("kind", ["op", "hjop"])
def test_the_whole_range_from_0_to_1_is_used(kind):
    weights = reward_model(PlannerSettings(kind=kind, speed_floor=15.0), ROAD)
    assert total_reward(15.0, 0, True, -100.0, weights) == pytest.approx(0.0)
    assert total_reward(30.0, 3, False, 100.0, weights) == pytest.approx(1.0)


def test_the_hji_term_is_added_in_metres_before_the_sum_is_mapped():
    weights = reward_model(PlannerSettings(gamma_r=0.9, value_clip=8.0), ROAD)
    one_lane = total_reward(24.0, 2, False, 0.0, weights) - total_reward(24.0, 1, False, 0.0, weights)
    one_metre = total_reward(24.0, 1, False, 1.0, weights) - total_reward(24.0, 1, False, 0.0, weights)
    assert one_lane / one_metre == pytest.approx((0.9 / 3.0) / 0.1)


def test_values_beyond_the_clip_and_no_car_at_all_are_worth_the_same():
    weights = reward_model(PlannerSettings(value_clip=8.0), ROAD)
    at_clip = total_reward(24.0, 1, False, 8.0, weights)
    assert total_reward(24.0, 1, False, 500.0, weights) == at_clip
    assert total_reward(24.0, 1, False, float("inf"), weights) == at_clip


def test_op_is_hjop_with_all_weight_on_the_driving_reward():
    op = reward_model(PlannerSettings(gamma_r=1.0), ROAD)
    assert total_reward(24.0, 1, False, -5.0, op) == total_reward(24.0, 1, False, 5.0, op)


def test_a_road_of_one_lane_rewards_no_lane():
    weights = reward_model(PlannerSettings(gamma_r=1.0, speed_floor=15.0), StraightRoad(1))
    assert total_reward(30.0, 0, False, 0.0, weights) == pytest.approx(1.0)
