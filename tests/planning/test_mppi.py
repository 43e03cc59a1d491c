"""The sampling planner: its parts against plain Python, and what it plans in scenes whose answer is plain."""

import math

import numpy as np
import pytest

from hj_cosim.planning.contract import FASTER, LEFT, RIGHT, SLOWER
from hj_cosim.planning.mppi.others import Habits, Others, predict_others
from hj_cosim.planning.mppi.planner import MppiPlanner
from hj_cosim.planning.mppi.rollouts import Costs, Outlook, RobotModel, drive, worth
from hj_cosim.planning.optimistic.reward import reward_model
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver

ROAD, STEP = StraightRoad(4), 0.2
ROBOT = RobotModel(5.0, 2.0, 0.3, -6.0, 4.0, 4.0, 40.0, 0.3, 4.0, 4)


@pytest.fixture
def make(small_table):
    def made(road=ROAD, **options) -> MppiPlanner:
        given = MppiPlanner.Options(**options)
        return MppiPlanner(PlannerSettings(), given, RobotSettings(), DriverSettings(), road, small_table)

    return made


def planned(planner, observation, times=4):
    """Return the last of some plans of the same instant, by which time the mean has settled."""
    target = Target(1, float(observation.robot[3]))
    for _ in range(times):
        plan = planner.plan(observation, target)
        target = plan.target
    return plan


def test_an_empty_road_is_driven_fast_and_on_the_left(make, observe):
    plan = planned(make(), observe([], lane=1, speed=24.0))
    assert (plan.action, plan.target.lane) == (LEFT, 2)
    assert plan.target.speed > 24.5
    assert planned(make(), observe([], lane=3, speed=24.0)).action == FASTER


def test_a_slow_car_is_passed_where_there_is_room(make, observe):
    slow = (3, 40.0, 8.0)
    assert planned(make(), observe([slow], lane=3, speed=22.0)).action == RIGHT


def test_a_path_that_first_enters_the_right_lane_asks_for_the_right_lane(make, observe):
    road, slow = StraightRoad(3), [(1, 25.0, 12.0), (2, 25.0, 12.0)]
    planner, scene, path = make(road), observe(slow, lane=1, speed=22.0), np.empty((21, 4))
    comes_back = 0
    for _ in range(8):
        plan = planner.plan(scene, Target(1, 22.0))
        drive(scene.robot, planner._plan.copy(), path, ROBOT, STEP)
        comes_back += road.lane_at(path[-1, 1], path[-1, 0]) > 0
        assert (plan.action, plan.target.lane) == (RIGHT, 0)
    assert comes_back > 2


@pytest.mark.parametrize(
    ("lanes", "action"),
    [((1, 0, 2), RIGHT), ((1, 2, 0), LEFT), ((1, 0, 1), RIGHT), ((1, 1, 2), FASTER), ((1, 1, 1), FASTER)],
    ids=str,
)
def test_of_the_lanes_on_a_path_the_first_other_one_within_a_second_is_asked_for_at_the_speed_of_its_beginning(
    make, observe, lanes, action
):
    times = np.arange(21) * STEP
    speed = np.interp(times, [0.0, 2.0, 4.0], [22.0, 28.0, 10.0])
    path = np.column_stack([1000.0 + 22.0 * times, 4.0 * np.interp(times, [0.0, 2.0, 4.0], lanes), 0.0 * times, speed])
    plan = make()._answer(observe([], lane=1, speed=22.0), path, (0, 3))
    assert (plan.action, plan.target.lane) == (action, 1 + {LEFT: 1, RIGHT: -1}.get(action, 0))
    assert plan.target.speed == pytest.approx(22.0 + 3.0 * PlannerSettings().speed_response)


@pytest.mark.parametrize(("across", "action"), [(0.9, LEFT), (1.1, LEFT), (1.4, FASTER), (2.6, FASTER)])
def test_a_lane_that_the_path_enters_later_than_a_robot_told_to_now_is_not_asked_for_yet(make, observe, across, action):
    times = np.arange(21) * STEP
    lateral = np.where(times > across, 8.0, 4.0)
    path = np.column_stack([1000.0 + 24.0 * times, lateral, 0.0 * times, 22.0 + times])
    plan = make()._answer(observe([], lane=1, speed=22.0), path, (0, 3))
    assert (plan.action, plan.target.lane) == (action, 2 if action == LEFT else 1)


@pytest.mark.parametrize("lanes", [1, 2, 3])
def test_noise_is_spread_evenly_over_the_last_plan_and_over_the_simple_ways(make, lanes):
    planner = make(StraightRoad(lanes), omega_deviation=1e-6, acceleration_deviation=1e-6)
    samples = planner._drawn(np.array([1000.0, 4.0 * (lanes // 2) + 0.3, 0.0, 22.0]), (0, lanes - 1))
    middles, noisy = np.split(samples, [1 + 3 * lanes])
    distance = np.abs(noisy[:, np.newaxis] - middles).max(axis=(2, 3))
    assert distance.min(axis=1).max() < 1e-4
    around = np.bincount(np.argmin(distance, axis=1), minlength=len(middles))
    assert around[0] == pytest.approx(0.5 * len(noisy), abs=1.0)
    assert np.ptp(around[1:]) <= 1


def test_the_robot_slows_down_where_all_lanes_are_taken(make, observe):
    wall = [(1, 30.0, 16.0), (0, 0.0, 22.0), (2, 0.0, 22.0)]
    plan = planned(make(), observe(wall, lane=1, speed=22.0))
    assert (plan.action, plan.target.lane) == (SLOWER, 1)
    assert plan.target.speed < 21.0


def test_the_same_drive_gives_the_same_plans_prepared_or_not(make, observe):
    scene = observe([(2, 20.0, 20.0), (1, 40.0, 18.0)])
    first, second, prepared = make(), make(), make()
    prepared.prepare(scene)
    assert first.plan(scene, Target(1, 24.0)) == second.plan(scene, Target(1, 24.0))
    assert prepared.plan(scene, Target(1, 24.0)) == make().plan(scene, Target(1, 24.0))


def test_samples_move_as_the_bicycle_does():
    random = np.random.default_rng(0)
    controls = np.column_stack([random.uniform(-0.15, 0.15, 20), random.uniform(-3.0, 3.0, 20)])
    state = np.array([10.0, 4.0, 0.02, 22.0])
    path = np.empty((21, 4))
    drive(state, controls, path, ROBOT, STEP)
    exact = state
    for omega, acceleration in controls:
        exact = bicycle_step(exact, steering_for(omega, exact[3], 5.0), acceleration, 5.0, 40.0, STEP)
    assert path[-1, :2] == pytest.approx(exact[:2], abs=0.35)
    assert path[-1, 2:] == pytest.approx(exact[2:], abs=0.02)


def test_samples_are_held_to_what_robot_and_tyres_can():
    controls = np.array([[5.0, 50.0], [-5.0, -50.0]])
    path = np.empty((3, 4))
    drive(np.array([0.0, 0.0, 0.0, 20.0]), controls, path, ROBOT, STEP)
    assert controls == pytest.approx(np.array([[0.2, 4.0], [-4.0 / 20.8, -6.0]]))
    fast, held = np.array([0.0, 0.0, 0.29, 39.9]), np.array([[0.3, 4.0]])
    drive(fast, held, np.empty((2, 4)), ROBOT, STEP)
    assert held == pytest.approx(np.array([[0.05, 0.5]]))  # up to the largest heading and speed


def _scene(random: np.random.Generator, cars: int = 6) -> Others:
    x = np.empty((11, cars))
    x[0] = random.uniform(-40.0, 60.0, cars)
    others = Others(
        x, np.empty_like(x), np.empty_like(x), random.uniform(4.0, 12.0, cars), random.uniform(1.8, 2.5, cars)
    )
    others.y[0] = 4.0 * random.integers(0, 4, cars)
    others.speed[0] = random.uniform(15.0, 25.0, cars)
    for instant in range(10):
        others.x[instant + 1] = others.x[instant] + others.speed[0] * STEP
        others.y[instant + 1], others.speed[instant + 1] = others.y[0], others.speed[0]
    return others


@pytest.mark.parametrize("gamma_r", [0.9, 1.0])
def test_a_sample_is_worth_its_rewards_less_its_costs_up_to_a_crash(sized_table, gamma_r):
    random = np.random.default_rng(4)
    settings = PlannerSettings(gamma_r=gamma_r)
    reward = reward_model(settings, ROAD)
    crashes = 0
    for _ in range(60):
        others = _scene(random)
        controls = np.column_stack([random.uniform(-0.08, 0.08, 10), random.uniform(-3.0, 3.0, 10)])
        state, path = np.array([0.0, 4.0, 0.0, 22.0]), np.empty((11, 4))
        drive(state, controls, path, ROBOT, STEP)
        outlook = Outlook(others, reward, Costs(0.002, 0.001, 0.003), ROBOT, STEP, 0.98)
        expected, weight, crashed = 0.0, STEP, False
        for k in range(1, 11):
            x, y, heading, speed = path[k]
            beside = np.abs(others.y[k] - y) < 0.5 * (others.width + 2.0)
            crashed = bool((beside & (np.abs(others.x[k] - x) < 0.5 * (others.length + 5.0))).any())
            if crashed or not -1.0 <= y <= 13.0:
                break
            in_sight = [
                lane_cars[np.argmin(np.abs(others.x[k, lane_cars] - x))]
                for shift in (-1, 0, 1)
                for side in (True, False)
                if len(
                    lane_cars := np.flatnonzero(
                        (np.round((others.y[k] - y) / 4.0) == shift) & ((others.x[k] > x) == side)
                    )
                )
            ]
            least = math.inf
            for j in in_sight:
                is_car = others.length[j] <= 5.0 and others.width[j] <= 2.0  # the rest are up to 12 x 2.5 m
                state = [x - others.x[k, j], y - others.y[k, j], heading, speed, others.speed[k, j]]
                least = min(least, float(sized_table.by_size[0 if is_car else 1].value(np.array(state))[0]))
            total = gamma_r * (0.4 * (speed - 15.0) / 15.0 + y / 4.0 / 3.0)
            total += (1.0 - gamma_r) * min(max(least, -8.0), 8.0)
            omega, acceleration = controls[k - 1]
            change = acceleration - controls[max(k - 2, 0), 1]
            cost = 0.002 * (speed * omega) ** 2 + 0.001 * acceleration**2 + 0.003 * change**2
            expected += weight * ((total - reward.lowest) / reward.span - cost)
            weight *= 0.98
        crashes += crashed
        assert worth(path, controls, outlook, sized_table.stack) == pytest.approx(expected, abs=1e-6)
    assert 5 < crashes < 55


def test_the_others_follow_each_other_and_the_robot_as_it_last_planned():
    driver = mean_driver(DriverSettings())
    habits = Habits(np.tile(driver, (8, 1)), 4.0 / 3.0, 3.0)
    start = {"x": [0.0, 30.0, 10.0, -30.0], "y": [4.0, 4.0, 10.0, 0.0], "speed": [24.0, 18.0, 20.0, 25.0]}
    shape = (11, 4)
    others = Others(np.empty(shape), np.empty(shape), np.empty(shape), np.full(4, 5.0), np.full(4, 2.0))
    for name, values in start.items():
        getattr(others, name)[0] = values
    robot = np.column_stack([np.linspace(0.0, 30.0, 11), np.zeros(11), np.zeros(11), np.full(11, 15.0)])
    predict_others(others, np.array([4.0, 4.0, 12.0, 0.0]), robot, 5.0, habits, STEP)
    # The first follows the second, which sees nobody; the last follows the robot; the third goes to its lane.
    x, speed = 0.0, 24.0
    for instant in range(10):
        acceleration = idm_acceleration(speed, others.x[instant, 1] - x - 5.0, 18.0, driver)
        later = speed + max(acceleration, -9.0) * STEP
        x, speed = x + 0.5 * (speed + later) * STEP, later
    assert (others.x[-1, 0], others.speed[-1, 0]) == pytest.approx((x, speed))
    assert others.speed[-1, 1:3].tolist() == [18.0, 20.0]
    assert others.y[:, 2] == pytest.approx(np.minimum(10.0 + 4.0 / 3.0 * STEP * np.arange(11), 12.0))
    first = idm_acceleration(25.0, 25.0, 15.0, driver)
    assert others.speed[1, 3] == pytest.approx(25.0 + max(first, -9.0) * STEP)
