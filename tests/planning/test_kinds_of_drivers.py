"""The planner among vehicles of several sizes and kinds of drivers."""

import dataclasses

import numpy as np
import pytest

from hj_cosim.planning.contract import IDLE
from hj_cosim.planning.mppi.others import Habits, Others, predict_others
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver

TRUCKER = np.array([22.0, 1.0, 3.0, 2.0, 5.0, 4.0])
ROAD = StraightRoad(4)


def planner(table, **settings):
    return OptimisticPlanner(PlannerSettings(**settings), RobotSettings(), DriverSettings(), ROAD, table)


def with_bodies(scene, length, width):
    return dataclasses.replace(scene, length=np.full(len(scene.x), length), width=np.full(len(scene.x), width))


def test_a_plan_among_trucks_minds_their_table(sized_table, draw_scene):
    """With their table alone, told that it is for all who are no larger, a planner finds the same path."""
    trucks = sized_table.by_size[2]
    differ = 0
    for seed in range(6):
        scene = with_bodies(draw_scene(seed, 6, spacing=30.0), 16.5, 2.5)
        of_classes, of_trucks, of_cars = (
            planner(table, expansions=60, value_clip=40.0).plan(scene, Target(1, 24.0)).statistics.best_value
            for table in (sized_table, trucks, dataclasses.replace(sized_table, larger=()))
        )
        assert of_classes == of_trucks
        differ += of_classes != of_cars
    assert differ > 2


def test_behind_a_truck_the_robot_plans_to_drive_slower_than_behind_a_car(sized_table, observe):
    scene, speeds = observe([(1, 32.0, 22.0), (2, -3.0, 24.0), (0, 4.0, 24.0)], speed=24.0), []
    for length, width in ((5.0, 2.0), (18.0, 2.5)):
        plan = planner(sized_table).plan(with_bodies(scene, length, width), Target(1, 24.0))
        speeds.append(plan.target.speed)
    assert speeds[1] < speeds[0]


def steps(x, speed, lead, lead_speed, gap_off, driver, count, step):
    """Drive one vehicle behind a leader that keeps its speed, written out."""
    for _ in range(count):
        acceleration = max(float(idm_acceleration(speed, lead - x - gap_off, lead_speed, driver)), -9.0)
        later = max(speed + acceleration * step, 0.0)
        x, speed, lead = x + 0.5 * (speed + later) * step, later, lead + lead_speed * step
    return x


def test_each_driver_is_predicted_by_what_is_expected_of_it(small_table, observe):
    scene = observe([(3, 50.0, 20.0), (3, 10.0, 24.0), (0, 60.0, 20.0), (0, 15.0, 24.0)], speed=24.0)
    mean = mean_driver(DriverSettings())
    scene = dataclasses.replace(
        scene, length=np.array([5.0, 16.5, 5.0, 5.0]), expected_driver=np.array([mean, TRUCKER, mean, mean])
    )
    model = planner(small_table)
    settings = PlannerSettings()
    count = round(settings.action_time / settings.prediction_step)
    step = settings.action_time / count
    path = model.foresee(scene, Target(1, 24.0), [IDLE])
    where = dict(zip(path.vehicle.tolist(), (path.x[1] - 1000.0).tolist(), strict=True))
    truck = steps(10.0, 24.0, 50.0, 20.0, 0.5 * (5.0 + 16.5), TRUCKER, count, step)
    car = steps(15.0, 24.0, 60.0, 20.0, 5.0, mean, count, step)
    assert where[1] == pytest.approx(truck, abs=1e-3)
    assert where[3] == pytest.approx(car, abs=1e-3)
    # And where nothing is expected, everybody is the mean driver again.
    again = planner(small_table).foresee(dataclasses.replace(scene, expected_driver=None), Target(1, 24.0), [IDLE])
    mean_truck = steps(10.0, 24.0, 50.0, 20.0, 0.5 * (5.0 + 16.5), mean, count, step)
    assert dict(zip(again.vehicle.tolist(), (again.x[1] - 1000.0).tolist(), strict=True))[1] == pytest.approx(
        mean_truck, abs=1e-3
    )
    assert abs(mean_truck - truck) > 0.05


def test_who_would_not_gain_by_its_own_parameters_stays_in_its_lane(small_table, observe):
    scene = observe([(0, 90.0, 20.0), (0, 10.0, 20.0), (3, 400.0, 25.0)], speed=24.0, lane=3)
    content = np.array([20.0, 3.0, 5.0, 0.5, 5.0, 4.0])  # desires what it drives
    eager = np.array([35.0, 3.0, 5.0, 1.5, 5.0, 4.0])
    lanes = {}
    for name, driver in (("content", content), ("eager", eager)):
        seen = dataclasses.replace(scene, expected_driver=np.tile(driver, (3, 1)))
        seen.expected_driver[0] = content
        ahead = dataclasses.replace(
            seen, x=np.append(seen.x, 1115.0), y=np.append(seen.y, 4.0), speed=np.append(seen.speed, 30.0),
            vehicle=np.arange(4), heading=np.zeros(4), acceleration=np.zeros(4), lane=np.append(seen.lane, 1),
            target_lane=np.append(seen.target_lane, 1), length=np.full(4, 5.0), width=np.full(4, 2.0),
            expected_driver=np.vstack([seen.expected_driver, content]),
        )  # fmt: skip
        path = planner(small_table).foresee(ahead, Target(3, 24.0), [IDLE, IDLE])
        lanes[name] = float(path.y[-1, path.vehicle.tolist().index(1)])
    assert lanes["content"] == 0.0
    assert lanes["eager"] > 1.0


def test_mppi_predicts_each_driver_by_its_own_parameters():
    x = np.array([[0.0, 0.0, 40.0, 40.0]])
    shape = (6, 4)
    others = Others(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.full(4, 5.0), np.full(4, 2.0))
    others.x[0], others.y[0], others.speed[0] = x, [0.0, 12.0, 0.0, 12.0], [24.0, 24.0, 18.0, 18.0]
    drivers = np.array([TRUCKER, mean_driver(DriverSettings()), TRUCKER, TRUCKER])
    robot = np.tile([500.0, 40.0, 0.0, 20.0], (6, 1))
    predict_others(others, others.y[0].copy(), robot, 5.0, Habits(drivers, 1.0, 3.0), 0.2)
    for car in (0, 1):
        expected = steps(0.0, 24.0, 40.0, 18.0, 5.0, drivers[car], 5, 0.2)
        assert others.x[-1, car] == pytest.approx(expected)
