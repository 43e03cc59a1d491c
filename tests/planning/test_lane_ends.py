"""Lanes that begin and end, as the planner sees them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bent_roads import WIDTH, circle

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import LEFT, RIGHT
from hj_cosim.planning.optimistic.lane_ends import robots_lanes, with_lane_ends
from hj_cosim.scene.observation import NOBODY, Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings

# Lanes 1 and 2 all along; the right lane 0 up to 600 m, where it ends.
ENDS = {
    "section_start": np.array([0.0, 600.0]),
    "first_lane": np.array([0, 1]),
    "lanes_there": np.array([3, 2]),
    "leading_off": np.array([0, 0]),
}


def observed(robot: tuple[float, int, float], *cars: tuple[float, int, float]) -> Observation:
    """A scene of s, lane and speed; nobody turns."""
    x, lane, speed = (np.array(column) for column in zip(*cars, strict=True)) if cars else (np.empty(0),) * 3
    lane = lane.astype(np.int64)
    count = len(x)
    return Observation(
        time=0.0,
        robot=np.array([robot[0], robot[1] * WIDTH, 0.0, robot[2]]),
        robot_acceleration=0.0,
        vehicle=np.arange(count),
        x=x.astype(float),
        y=lane * WIDTH,
        heading=np.zeros(count),
        speed=speed.astype(float),
        acceleration=np.zeros(count),
        lane=lane,
        target_lane=lane,
        length=np.full(count, 5.0),
        width=np.full(count, 2.0),
    )


def planner(table, road, **settings: object):
    chosen = PlannerSettings(**{"expansions": 200, **settings})
    return make_planner(chosen, RobotSettings(), DriverSettings(), road, table)


@pytest.mark.parametrize(("s", "lanes"), [(100.0, (0, 2)), (300.0, (0, 2)), (380.0, (1, 2)), (590.0, (1, 2))])
def test_the_robot_may_plan_for_lanes_that_last_until_it_is_far_beyond(s, lanes):
    road = circle(1000.0, **ENDS)
    assert robots_lanes(road, observed((s, 1, 25.0)), 120.0) == lanes


def test_who_is_in_a_lane_that_ends_may_stay_until_there_is_room():
    road = circle(1000.0, **ENDS)
    assert robots_lanes(road, observed((500.0, 0, 25.0)), 120.0) == (0, 2)


@pytest.mark.parametrize("kind", ["hjop", "op"])
@pytest.mark.parametrize(("s", "is_an_option"), [(100.0, True), (450.0, False)])
def test_nobody_plans_into_a_lane_that_ends_within_reach(small_table, kind, s, is_an_option):
    """Both lanes that last are blocked by slow cars, the right one is free."""
    scene = observed((s, 1, 25.0), (s + 45.0, 1, 12.0), (s + 30.0, 2, 12.0))
    plan = planner(small_table, circle(1000.0, **ENDS), kind=kind).plan(scene, Target(1, 25.0))
    assert math.isfinite(plan.statistics.action_values[RIGHT]) == is_an_option
    assert is_an_option or plan.action != RIGHT


def test_a_robot_in_a_lane_that_ends_leaves_it_or_slows_down(small_table):
    road = circle(1000.0, **ENDS)
    free = planner(small_table, road).plan(observed((510.0, 0, 25.0)), Target(0, 25.0))
    assert free.action == LEFT
    walls = [(510.0 + x, 1, 25.0) for x in (-16.0, -8.0, 0.0, 8.0, 16.0)]
    beside = planner(small_table, road, expansions=1000).plan(observed((510.0, 0, 25.0), *walls), Target(0, 25.0))
    s, d = beside.statistics.trajectory.robot[:, :2].T
    assert beside.target.lane == 0
    assert s[-1] > 600.0
    assert (d[s > 595.0] > WIDTH - 0.5).all()


def test_the_end_of_a_lane_stands_in_it_and_only_where_it_is_in_sight():
    road = circle(1000.0, **ENDS)
    near = with_lane_ends(observed((500.0, 1, 25.0), (520.0, 0, 20.0)), road, 120.0)
    assert near.vehicle.tolist() == [0, NOBODY]
    assert near.x[1] - 0.5 * near.length[1] == 600.0
    assert (near.speed[1], near.lane[1], near.y[1]) == (0.0, 0, 0.0)
    far = observed((400.0, 1, 25.0))
    assert with_lane_ends(far, road, 120.0) is far
    exits = circle(1000.0, **{**ENDS, "leading_off": np.array([1, 0])})
    leaving = observed((500.0, 1, 25.0))
    assert with_lane_ends(leaving, exits, 120.0) is leaving
    straight = StraightRoad(3)
    assert with_lane_ends(leaving, straight, 120.0) is leaving


def test_a_car_in_a_lane_that_ends_is_predicted_to_come_over_and_one_that_leaves_is_not(small_table):
    scene = observed((500.0, 1, 25.0), (530.0, 0, 20.0))
    predicted = {}
    for name, leading_off in (("ends", 0), ("exit", 1)):
        road = circle(1000.0, **{**ENDS, "leading_off": np.array([leading_off, 0])})
        plan = planner(small_table, road).plan(scene, Target(1, 25.0))
        predicted[name] = plan.statistics.trajectory
    assert predicted["ends"].vehicle.tolist() == [0]  # the obstacle is no car
    assert predicted["ends"].y.shape == predicted["ends"].x.shape == (len(predicted["ends"].time), 1)
    assert predicted["ends"].y[-1, 0] > 0.5 * WIDTH or predicted["ends"].speed[-1, 0] < 18.0
    assert predicted["exit"].y[-1, 0] == 0.0
    assert predicted["exit"].speed[-1, 0] == pytest.approx(20.0, abs=1e-3)


def test_others_are_not_predicted_into_lanes_that_are_not_there(small_table):
    """The right lane ends far behind them: the car behind a slow one can only go left."""
    road = circle(1000.0, **ENDS)
    scene = observed((800.0, 2, 20.0), (820.0, 1, 25.0), (845.0, 1, 10.0), (900.0, 2, 25.0))
    plan = planner(small_table, road).plan(scene, Target(2, 20.0))
    assert plan.statistics.trajectory.y.min() >= WIDTH - 1e-6
    straight = replace(scene)
    anywhere = planner(small_table, StraightRoad(3, WIDTH)).plan(straight, Target(2, 20.0))
    assert anywhere.statistics.trajectory.y.min() < WIDTH - 0.5


def sampled(table, road, scene, lane) -> Target:
    """Return what the sampling planner asks for after some plans of the same instant."""
    sampling, target = planner(table, road, kind="mppi"), Target(lane, float(scene.robot[3]))
    for _ in range(6):
        target = sampling.plan(scene, target).target
    return target


def test_the_sampling_planner_asks_for_no_lane_that_ends_within_reach(small_table):
    """Both lanes that last are blocked by slow cars, the right one is free."""
    road = circle(1000.0, **ENDS)
    scenes = [observed((s, 1, 25.0), (s + 45.0, 1, 12.0), (s + 30.0, 2, 12.0)) for s in (100.0, 450.0)]
    assert [sampled(small_table, road, scene, 1).lane for scene in scenes] == [0, 1]


def test_the_sampling_planner_leaves_a_lane_that_ends_and_is_slower_where_it_cannot(small_table):
    road, endless = circle(1000.0, **ENDS), circle(1000.0)
    assert sampled(small_table, road, observed((540.0, 0, 20.0)), 0).lane == 1
    walls = [(540.0 + x, 1, 20.0) for x in (-16.0, -8.0, 0.0, 8.0, 16.0)]
    beside, with_room = (sampled(small_table, each, observed((540.0, 0, 20.0), *walls), 0) for each in (road, endless))
    assert beside.lane == with_room.lane == 0
    assert beside.speed < with_room.speed - 0.5
