"""The planner's model of the world once more, in plain Python, one instant after the other and sharing nothing."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hj_cosim.planning.contract import LEFT, RIGHT
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.idm import idm_acceleration
from hj_cosim.vehicles.mobil import lane_change_incentive, mobil_parameters


def observed(
    cars: Sequence[tuple[int, float, float]], lane: int = 1, speed: float = 24.0, road: Road | None = None
) -> Observation:
    """Return a robot in the middle of its lane at 1000 m, among cars given as (lane, m ahead of it, m/s)."""
    width = (road or StraightRoad(4)).lane_width
    rows = np.array(cars, float).reshape(-1, 3)
    lanes = rows[:, 0].astype(np.int64)
    count = len(rows)
    return Observation(
        time=0.0, robot=np.array([1000.0, lane * width, 0.0, speed]), robot_acceleration=0.0,
        vehicle=np.arange(count), x=1000.0 + rows[:, 1], y=lanes * width, heading=np.zeros(count), speed=rows[:, 2],
        acceleration=np.zeros(count), lane=lanes, target_lane=lanes, length=np.full(count, 5.0),
        width=np.full(count, 2.0),
    )  # fmt: skip


def random_scene(seed: int, cars: int, reach: float = 80.0, spacing: float = 14.0) -> Observation:
    """Return a robot in lane 1 or 2 among `cars`, none nearer than `spacing` to another in its lane."""
    random = np.random.default_rng(seed)
    lane = int(random.integers(1, 3))
    placed: list[tuple[int, float, float]] = [(lane, 0.0, 0.0)]
    while len(placed) <= cars:
        car = (int(random.integers(4)), float(random.uniform(-reach, reach)), float(random.uniform(20.0, 25.0)))
        if all(car[0] != other[0] or abs(car[1] - other[1]) >= spacing for other in placed):
            placed.append(car)
    return observed(placed[1:], lane, float(random.uniform(22.0, 26.0)))


@pytest.fixture(scope="session")
def observe() -> Callable[..., Observation]:
    return observed


@pytest.fixture(scope="session")
def draw_scene() -> Callable[..., Observation]:
    return random_scene


@dataclass(frozen=True)
class ReferenceState:
    x: np.ndarray  # (J,)
    y: np.ndarray
    speed: np.ndarray
    lane: np.ndarray
    second_lane: np.ndarray
    robot: tuple[float, float, float, float]  # x, y, θ, v
    planned_lane: int
    planned_speed: float
    crashed: bool = False


class ReferenceModel:
    """What an action leads to, by the definitions: every car looks around anew and all move at once, step by step."""

    def __init__(self, settings: PlannerSettings, drivers: DriverSettings, road: Road, table: ValueTable | None):
        self.settings, self.road, self.table = settings, road, table
        self.driver = np.array([
            drivers.desired_speed.mean, drivers.max_acceleration.mean, drivers.comfortable_deceleration.mean,
            drivers.time_headway.mean, drivers.minimum_gap.mean, drivers.exponent,
        ])  # fmt: skip
        self.mobil = mobil_parameters(drivers.politeness, drivers.gain_threshold, drivers.safe_braking)
        self.body = RobotSettings()

    def start(self, seen: Observation, target: Target) -> ReferenceState:
        return ReferenceState(
            seen.x, seen.y, seen.speed, seen.lane, seen.lane, tuple(seen.robot), target.lane, target.speed
        )

    def robot_lanes(self, y: float) -> list[int]:
        reach = 0.5 * self.road.lane_width + 1.0
        return [lane for lane in range(self.road.lane_count) if abs(y - lane * self.road.lane_width) < reach]

    def decide_lanes(self, state: ReferenceState) -> np.ndarray:
        """Return the cars' lanes after MOBIL, asked of every car and every lane, the front-most first."""
        lanes = self.robot_lanes(state.robot[1])
        order = np.argsort(np.append(state.x, state.robot[0]), kind="stable")
        position = np.append(state.x, state.robot[0])[order]
        speed = np.append(state.speed, state.robot[3])[order]
        lane = np.append(state.lane, lanes[0])[order]
        second = np.append(state.second_lane, lanes[-1])[order]
        length = np.full(len(order), 5.0)
        drivers = np.tile(self.driver, (len(order), 1))
        for place in reversed(range(len(order))):
            if order[place] == len(state.x) or lane[place] != second[place]:
                continue
            if all(lane[place] not in (lane[ahead], second[ahead]) for ahead in range(place + 1, len(order))):
                continue
            wishes = {
                target: lane_change_incentive(place, target, position, speed, lane, second, length, drivers, self.mobil)
                for target in (lane[place] + 1, lane[place] - 1)
                if 0 <= target < self.road.lane_count
            }
            best = max(wishes, key=lambda target: wishes[target])
            if wishes[best] > 0.0:
                lane[place] = best
        decided = np.empty(len(order), np.int64)
        decided[order] = lane
        return decided[:-1]

    def accelerations(
        self, state: ReferenceState, now: ReferenceState, lanes: list[set[int]], behind_robot: dict[int, set[int]]
    ) -> np.ndarray:
        """Return IDM's accelerations at an instant `now` of an action that begins in `state`."""
        noticed = set(self.robot_lanes(now.robot[1]))
        result = np.empty(len(now.x))
        for car in range(len(now.x)):
            ahead = [
                other for other in range(len(now.x)) if state.x[other] > state.x[car] and lanes[other] & lanes[car]
            ]
            gap, lead_speed = math.inf, 0.0
            if ahead:
                leader = min(ahead, key=lambda other: state.x[other])
                gap, lead_speed = now.x[leader] - now.x[car] - 5.0, now.speed[leader]
            to_robot = now.robot[0] - now.x[car]
            if behind_robot[car] & noticed and 0.0 < to_robot < gap + 5.0:
                gap, lead_speed = to_robot - 5.0, now.robot[3]
            followed = max(idm_acceleration(now.speed[car], gap, lead_speed, self.driver), -9.0)
            result[car] = followed if gap < math.inf else 0.0
        return result

    def advance(self, state: ReferenceState, action: int) -> ReferenceState:
        settings, width = self.settings, self.road.lane_width
        planned_lane = state.planned_lane + {LEFT: 1, RIGHT: -1}.get(action, 0)
        planned_speed = state.planned_speed + {1: 1.0, 2: -1.0}.get(action, 0.0) * settings.speed_step
        lane = self.decide_lanes(state)
        lanes = [{int(a), int(b)} for a, b in zip(lane, state.second_lane, strict=True)]
        behind_robot: dict[int, set[int]] = {car: set() for car in range(len(state.x))}
        for road_lane in range(self.road.lane_count):
            behind = [car for car in behind_robot if road_lane in lanes[car] and state.x[car] < state.robot[0]]
            if behind:
                behind_robot[max(behind, key=lambda car: state.x[car])].add(road_lane)
        steps = round(settings.action_time / settings.prediction_step)
        step = settings.action_time / steps
        now, crashed, heading = state, False, 0.0
        for _ in range(steps):
            acceleration = self.accelerations(state, now, lanes, behind_robot)
            speed = np.maximum(now.speed + acceleration * step, 0.0)
            rate = width / settings.others_lane_change_time * step
            y = np.clip(lane * width, now.y - rate, now.y + rate)
            x_r, y_r, _, v_r = now.robot
            kept = math.exp(-step / settings.speed_response)
            travelled = planned_speed * step + (v_r - planned_speed) * settings.speed_response * (1.0 - kept)
            robot_rate = min(width / settings.lane_change_time * step, travelled * math.sin(settings.heading_max))
            next_y = min(max(planned_lane * width, y_r - robot_rate), y_r + robot_rate)
            heading = 0.0
            if next_y != planned_lane * width:
                later = planned_speed + (v_r - planned_speed) * kept
                sideways = min(width / settings.lane_change_time, later * math.sin(settings.heading_max))
                heading = math.copysign(math.atan2(sideways, later), planned_lane * width - next_y)
            then = replace(
                now,
                x=now.x + 0.5 * (now.speed + speed) * step,
                y=y,
                speed=speed,
                robot=(x_r + travelled, next_y, heading, planned_speed + (v_r - planned_speed) * kept),
            )
            crashed = crashed or touches_between(now, then)
            now = then
        has_left = np.abs(now.y - lane * width) <= 0.5 * (width - 2.0)
        return replace(
            now, lane=lane, second_lane=np.where(has_left, lane, state.second_lane), planned_lane=planned_lane,
            planned_speed=planned_speed, crashed=crashed,
        )  # fmt: skip

    def reward(self, state: ReferenceState) -> float:
        settings = self.settings
        gamma_r = 1.0 if settings.kind == "op" else settings.gamma_r
        span = settings.speed_high - settings.speed_low
        driving = settings.speed_weight * (state.planned_speed - settings.speed_low) / span
        driving += settings.lane_weight * state.planned_lane / (self.road.lane_count - 1)
        driving -= settings.crash_weight * state.crashed
        worst = settings.value_clip
        if gamma_r < 1.0 and self.table is not None and len(state.x):
            x, y, heading, speed = state.robot
            count = len(state.x)
            columns = (x - state.x, y - state.y, np.full(count, heading), np.full(count, speed), state.speed)
            worst = float(np.clip(self.table.value(np.column_stack(columns)).min(), -settings.value_clip, worst))
        low_speed = settings.speed_weight * (settings.speed_floor - settings.speed_low) / span
        lowest = gamma_r * (low_speed - settings.crash_weight) - (1.0 - gamma_r) * settings.value_clip
        highest = gamma_r * (settings.speed_weight + settings.lane_weight) + (1.0 - gamma_r) * settings.value_clip
        return (gamma_r * driving + (1.0 - gamma_r) * worst - lowest) / (highest - lowest)

    def actions(self, state: ReferenceState) -> list[int]:
        if state.crashed:
            return []
        settings = self.settings
        off_centre = state.robot[1] - state.planned_lane * self.road.lane_width
        exists = {
            0: True,
            1: state.planned_speed + settings.speed_step <= settings.speed_high,
            2: state.planned_speed - settings.speed_step >= settings.speed_floor,
            LEFT: state.planned_lane + 1 < self.road.lane_count and off_centre >= -0.25 * self.road.lane_width,
            RIGHT: state.planned_lane > 0 and off_centre <= 0.25 * self.road.lane_width,
        }
        return [action for action, possible in exists.items() if possible]

    def best_value(self, state: ReferenceState, depth: int) -> float:
        """Return the highest discounted sum of `depth` rewards from here, by trying everything."""
        if depth == 0:
            return 0.0
        return max(
            (
                self.reward(then) + self.settings.discount * self.best_value(then, depth - 1)
                for then in (self.advance(state, action) for action in self.actions(state))
            ),
            default=0.0,
        )


def touches_between(now: ReferenceState, then: ReferenceState, instants: int = 400) -> bool:
    """Return whether the bodies overlap at any of many instants between two, all moving on straight lines."""
    share = np.linspace(0.0, 1.0, instants)[:, np.newaxis]
    x = (now.x - now.robot[0]) * (1.0 - share) + (then.x - then.robot[0]) * share
    y = (now.y - now.robot[1]) * (1.0 - share) + (then.y - then.robot[1]) * share
    return bool(np.any((np.abs(x) < 5.0) & (np.abs(y) < 2.0)))


@pytest.fixture(scope="session")
def reference() -> type[ReferenceModel]:
    return ReferenceModel


@pytest.fixture(scope="session")
def scene_seeds() -> list[tuple[int, int]]:
    """Seeds and numbers of cars of the scenes that are compared with the reference."""
    return list(itertools.product(range(4), (3, 8)))
