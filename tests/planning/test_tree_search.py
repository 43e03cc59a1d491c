import math

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import FASTER, IDLE, LEFT, RIGHT, SLOWER
from hj_cosim.planning.optimistic.frontier import pop_leaf, push_leaf
from hj_cosim.planning.optimistic.tree_search import NODE, empty_tree
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings

ROAD = StraightRoad(4)


def make(table, road=ROAD, **settings):
    return make_planner(PlannerSettings(**settings), RobotSettings(), DriverSettings(), road, table)


def test_the_frontier_gives_the_highest_bound_first_then_the_shallower_then_the_older():
    random = np.random.default_rng(0)
    bounds = random.integers(0, 6, 200).astype(float)
    nodes = np.zeros(200, NODE)
    nodes["depth"] = random.integers(0, 5, 200)
    heap_bounds, heap = np.zeros(200), np.zeros(200, np.int64)
    for count in range(200):
        push_leaf(heap_bounds, heap, nodes, count, count, bounds[count])
    taken = []
    for count in range(200, 0, -1):
        taken.append(int(heap[0]))
        pop_leaf(heap_bounds, heap, nodes, count)
    assert taken == sorted(range(200), key=lambda node: (-bounds[node], nodes["depth"][node], node))


@pytest.mark.parametrize("kind", ["op", "hjop"])
@pytest.mark.parametrize(("seed", "cars", "depth"), [(0, 3, 4), (1, 5, 3), (2, 8, 3)])
def test_the_value_found_is_as_near_to_exhaustive_search_as_the_bound_says(
    small_table, draw_scene, reference, kind, seed, cars, depth
):
    settings = PlannerSettings(kind=kind, expansions=400, discount=0.7)
    scene = draw_scene(seed, cars)
    target = Target(round(scene.robot[1] / 4.0), float(scene.robot[3]))
    model = reference(settings, DriverSettings(), ROAD, small_table)
    exhaustive = model.best_value(model.start(scene, target), depth)
    beyond = settings.discount**depth / (1.0 - settings.discount)
    found = make(small_table, kind=kind, expansions=400, discount=0.7).plan(scene, target).statistics
    # A node of depth d − 1 was expanded, so the search's regret is at most γ^(d − 1) / (1 − γ).
    regret = settings.discount ** (found.depth - 1) / (1.0 - settings.discount)
    assert exhaustive - regret <= found.best_value <= exhaustive + beyond
    assert found.best_value >= exhaustive - 1e-5  # it has searched so many levels through, and more


@pytest.mark.parametrize("kind", ["op", "hjop"])
def test_the_first_action_is_one_that_exhaustive_search_finds_best(small_table, draw_scene, reference, kind):
    settings = PlannerSettings(kind=kind, expansions=200, discount=0.3)
    planner = make(small_table, kind=kind, expansions=200, discount=0.3)
    for seed in range(3):
        scene = draw_scene(seed, 3)
        target = Target(round(scene.robot[1] / 4.0), float(scene.robot[3]))
        model = reference(settings, DriverSettings(), ROAD, small_table)
        root = model.start(scene, target)
        values = {}
        for action in model.actions(root):
            then = model.advance(root, action)
            values[action] = model.reward(then) + settings.discount * model.best_value(then, 2)
        beyond = settings.discount**3 / (1.0 - settings.discount)
        assert values[planner.plan(scene, target).action] >= max(values.values()) - beyond


def test_more_expansions_never_find_less(small_table, draw_scene):
    for seed in range(5):
        scene = draw_scene(seed, 8)
        values = [
            make(small_table, expansions=budget).plan(scene, Target(1, 24.0)).statistics.best_value
            for budget in (1, 3, 10, 30, 100, 300)
        ]
        assert values == sorted(values)


def test_equal_rewards_are_searched_breadth_first_and_answered_with_idle(small_table, observe):
    # All rewards are 1, and with γ = 1/2 all sums are exact: every leaf has the same upper bound.
    # Seven lanes and lane changes within one action let all five actions exist at every node of three levels.
    planner = make(
        small_table, StraightRoad(7), kind="op", expansions=31, discount=0.5, speed_weight=0.0, lane_weight=0.0,
        speed_low=5.0, speed_high=100.0, lane_change_time=0.5,
    )  # fmt: skip
    plan = planner.plan(observe([], lane=3), Target(3, 24.0))
    assert plan.statistics.nodes == 1 + 5 + 25 + 125
    assert plan.statistics.depth == 3
    assert plan.action == IDLE


def existing(statistics):
    return set(np.flatnonzero(np.isfinite(statistics.action_values)).tolist())


@pytest.mark.parametrize(
    ("lane", "speed", "missing"),
    [(3, 24.0, {LEFT}), (0, 24.0, {RIGHT}), (1, 30.0, {FASTER}), (1, 15.0, {SLOWER}), (1, 24.0, set())],
)
def test_actions_that_leave_the_road_or_the_speed_limits_do_not_exist(small_table, observe, lane, speed, missing):
    planner = make(small_table, expansions=1, speed_floor=15.0)
    plan = planner.plan(observe([], lane, speed), Target(lane, speed))
    assert existing(plan.statistics) == {IDLE, FASTER, SLOWER, LEFT, RIGHT} - missing


def test_a_lane_is_reached_before_the_next_is_planned_for_but_a_change_can_be_taken_back(small_table, observe):
    planner = make(small_table, expansions=1)
    seen = observe([], lane=1)
    seen.robot[1] += 1.8
    assert existing(planner.plan(seen, Target(2, 24.0)).statistics) == {IDLE, FASTER, SLOWER, RIGHT}


def test_nothing_is_expanded_beyond_a_crash(small_table, observe):
    wall = [(lane, 12.0, 0.0) for lane in range(4)]
    statistics = make(small_table, expansions=1000).plan(observe(wall), Target(1, 24.0)).statistics
    assert statistics.expansions == 1
    assert statistics.depth == 1


def test_expansions_allocate_nothing(small_table, draw_scene):
    scene, allocations = draw_scene(0, 10), {}
    _nrt_python.memsys_enable_stats()
    for budget in (1, 500):
        planner = make(small_table, expansions=budget)
        planner.plan(scene, Target(1, 24.0))
        before = rtsys.get_allocation_stats().alloc
        planner.plan(scene, Target(1, 24.0))
        allocations[budget] = rtsys.get_allocation_stats().alloc - before
    assert allocations[500] == allocations[1]


def test_memory_is_bounded_by_the_budget():
    assert sum(array.nbytes for array in empty_tree(50, 11)) == (5 * 50 + 1) * (80 + 18 * 11)


def test_the_best_value_belongs_to_the_action_chosen(small_table, draw_scene):
    for seed in range(5):
        plan = make(small_table, expansions=100).plan(draw_scene(seed, 8), Target(1, 24.0))
        assert plan.statistics.action_values[plan.action] == plan.statistics.best_value
        assert plan.statistics.action_values.max() == plan.statistics.best_value


def test_the_best_value_is_a_sum_of_rewards_between_0_and_1(small_table, draw_scene):
    for seed in range(10):
        statistics = make(small_table, expansions=100).plan(draw_scene(seed, 8), Target(1, 24.0)).statistics
        depth = len(statistics.trajectory.action)
        assert 0.0 < statistics.best_value <= (1.0 - 0.9**depth) / (1.0 - 0.9) + 1e-9
        assert math.isfinite(statistics.best_value)
