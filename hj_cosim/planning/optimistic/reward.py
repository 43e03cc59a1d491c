"""The reward of a planned state (paper, section Planner Dynamics and Reward Function), mapped to [0, 1]."""

from typing import NamedTuple

from hj_cosim.kernels import kernel
from hj_cosim.scene.road import Road
from hj_cosim.settings import PlannerSettings


class RewardModel(NamedTuple):
    """The weights of the reward, as kernels take them."""

    gamma_r: float  # weight of the driving reward; 1 is OP, and no value is looked up
    value_clip: float  # m
    speed_weight: float
    lane_weight: float
    crash_weight: float
    speed_low: float  # m/s
    speed_high: float  # m/s
    leftmost: int  # lane
    lowest: float  # the smallest total that occurs
    span: float  # the largest minus the smallest


def reward_model(settings: PlannerSettings, road: Road) -> RewardModel:
    """Return the weights of `settings` with the range of the total, from which it is mapped to [0, 1].

    The range is that of the reward's formula over the speeds that may be planned, every lane, and both outcomes.
    """
    gamma_r = settings.gamma_r
    slowest = settings.speed_weight * (settings.speed_floor - settings.speed_low)
    slowest /= settings.speed_high - settings.speed_low
    lane_weight = settings.lane_weight if road.lane_count > 1 else 0.0
    lowest = gamma_r * (slowest - settings.crash_weight) - (1.0 - gamma_r) * settings.value_clip
    highest = gamma_r * (settings.speed_weight + lane_weight) + (1.0 - gamma_r) * settings.value_clip
    return RewardModel(
        gamma_r=gamma_r,
        value_clip=settings.value_clip,
        speed_weight=settings.speed_weight,
        lane_weight=lane_weight,
        crash_weight=settings.crash_weight,
        speed_low=settings.speed_low,
        speed_high=settings.speed_high,
        leftmost=max(road.lane_count - 1, 1),
        lowest=lowest,
        span=highest - lowest,
    )


@kernel
def driving_reward(planned_speed: float, planned_lane: int, crashed: bool, weights: RewardModel) -> float:
    """Return R = r_speed + r_crash + r_lane of a planner state, the paper's reward without the HJI term."""
    speed = weights.speed_weight * (planned_speed - weights.speed_low) / (weights.speed_high - weights.speed_low)
    lane = weights.lane_weight * planned_lane / weights.leftmost
    return speed + lane - (weights.crash_weight if crashed else 0.0)


@kernel
def total_reward(
    planned_speed: float, planned_lane: int, crashed: bool, worst_value: float, weights: RewardModel
) -> float:
    """Return γ_R R + (1 − γ_R) clip(min_j V, ±c), mapped to [0, 1].

    The two are added as they are, R without a unit and V in metres; only their sum is mapped. Normalised one by
    one, a single lane would be worth more than the whole range of V.

    Args:
        planned_speed: v_p, m/s.
        planned_lane: l_p.
        crashed: whether the robot is in collision.
        worst_value: the least V over the cars, m; not looked at where γ_R is 1.
        weights: the reward's.
    """
    total = weights.gamma_r * driving_reward(planned_speed, planned_lane, crashed, weights)
    if weights.gamma_r < 1.0:
        total += (1.0 - weights.gamma_r) * min(max(worst_value, -weights.value_clip), weights.value_clip)
    return (total - weights.lowest) / weights.span
