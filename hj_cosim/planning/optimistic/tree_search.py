"""Optimistic planning of deterministic systems (Hren & Munos 2008) over the robot's actions.

A node is what the robot and the cars around it will be after a sequence of actions. With rewards in [0, 1] and a
discount γ, no continuation of a node at depth d can be worth more than its upper bound, the discounted rewards on
the way to it plus γ^d / (1 − γ); those rewards alone are its lower bound. Each expansion takes the leaf of the
highest upper bound and adds a child for each action. The answer is the first action on the way to the node of the
highest lower bound.

A tree of n expansions has at most 5 n + 1 nodes, each of 80 + 18 (J + 1) bytes for J cars; all are allocated before
the search begins, and nothing is allocated in it.
"""

import math
from typing import NamedTuple

import numpy as np

from hj_cosim.kernels import kernel
from hj_cosim.planning.contract import ACTION_COUNT
from hj_cosim.planning.optimistic.crash import robot_crashes
from hj_cosim.planning.optimistic.frontier import pop_leaf, push_leaf
from hj_cosim.planning.optimistic.politeness import braking_imposed
from hj_cosim.planning.optimistic.prediction import (
    BRANCH,
    LANE,
    LATERAL,
    LENGTH,
    POSITION,
    REACTING,
    SECOND_LANE,
    SHARED,
    SPEED,
    VEHICLE,
    WIDTH,
    PredictionModel,
    Scene,
    approach,
    decide_and_find_leaders,
    drive_cars,
    drive_robot,
    noticed_lanes,
    order_drivers,
    sort_by_position,
)
from hj_cosim.planning.optimistic.reward import RewardModel, total_reward
from hj_cosim.reachability.table.lookup import shift_of_grid, value_at
from hj_cosim.reachability.table.size_classes import offsets_in_class
from hj_cosim.reachability.table.stack import TableStack, grid_in

# Of each action, in the order of planning.contract.
LANE_CHANGE = (0, 0, 0, 1, -1)
SPEED_CHANGE = (0, 1, -1, 0, 0)  # in steps of the planned speed
ROOT = 0
KIND = 2  # the column of bodies that has their size classes

# A lane is reached when the robot's centre is this near to its centre line, in lane widths.
REACHED = 0.25

NODE = np.dtype(
    [
        ("parent", np.int64),
        ("action", np.int64),  # that led to it
        ("first_action", np.int64),  # that the way to it begins with
        ("depth", np.int64),
        ("planned_lane", np.int64),  # l_p
        ("planned_speed", np.float64),  # v_p, m/s
        ("heading", np.float64),  # the robot's, rad
        ("value", np.float64),  # the lower bound: the discounted rewards on the way to it
    ]
)


class ActionModel(NamedTuple):
    """What the robot's actions change, and how many nodes may be expanded to choose one."""

    discount: float  # γ
    speed_step: float  # m/s
    speed_floor: float  # m/s
    speed_high: float  # m/s
    expansions: int  # the budget
    lowest_lane: int  # that the robot may plan for
    highest_lane: int
    polite_braking: float  # m/s², harder than which nobody behind is to brake for a lane change


class PlannedState(NamedTuple):
    """What one of the robot's actions leads to: the planner state."""

    action: int
    lane: int  # l_p
    speed: float  # v_p, m/s


class Tree(NamedTuple):
    """The nodes of a search, N of them, and its frontier. Node 0 is the root."""

    nodes: np.ndarray  # (N,) NODE
    state: np.ndarray  # (N, 3, M) float32, rows POSITION (m ahead of the robot at the root), SPEED, LATERAL
    place: np.ndarray  # (N, 3, M) int16, rows VEHICLE, LANE, SECOND_LANE; columns nearly sorted by position
    bound: np.ndarray  # (N,) upper bounds of the leaves, a binary heap with the highest first
    leaf: np.ndarray  # (N,) int64, the leaves that they belong to


def empty_tree(expansions: int, vehicles: int) -> Tree:
    """Return a tree with room for a search of `expansions` over `vehicles`, the robot included."""
    nodes = ACTION_COUNT * expansions + 1
    return Tree(
        nodes=np.zeros(nodes, NODE),
        state=np.zeros((nodes, 3, vehicles), np.float32),
        place=np.zeros((nodes, 3, vehicles), np.int16),
        bound=np.zeros(nodes),
        leaf=np.zeros(nodes, np.int64),
    )


@kernel
def search(
    tree: Tree,
    scene: Scene,
    bodies: np.ndarray,
    prediction: PredictionModel,
    actions: ActionModel,
    weights: RewardModel,
    tables: TableStack,
    action_values: np.ndarray,
) -> tuple[int, int, int]:
    """Search from the root, which the caller has written into node 0, until the budget is spent.

    Args:
        tree: whose node 0 is the root; the rest is overwritten.
        scene: work space for M vehicles.
        bodies: (M, 3) length and width of each vehicle by its number, m, and its size class among the tables (KIND).
        prediction, actions, weights, tables: the models.
        action_values: (5,) gets the highest lower bound that follows each first action; −inf where there is none.

    Returns:
        The number of nodes, the number of expansions, and the node of the highest lower bound (the earliest of
        several).
    """
    nodes = tree.nodes
    action_values[:] = -math.inf
    count, expansions, best, leaves = 1, 0, ROOT, 0
    leaves = push_leaf(tree.bound, tree.leaf, nodes, leaves, best, 1.0 / (1.0 - actions.discount))
    while leaves > 0 and expansions < actions.expansions:
        node = tree.leaf[0]
        leaves = pop_leaf(tree.bound, tree.leaf, nodes, leaves)
        robot = open_node(tree, node, scene, bodies, prediction)
        expansions += 1
        weight = actions.discount ** nodes[node].depth
        off_centre = scene.state[LATERAL, robot] - nodes[node].planned_lane * prediction.lane_width
        for action in range(ACTION_COUNT):
            lane = nodes[node].planned_lane + LANE_CHANGE[action]
            speed = nodes[node].planned_speed + SPEED_CHANGE[action] * actions.speed_step
            if not actions.lowest_lane <= lane <= actions.highest_lane:
                continue
            if not actions.speed_floor <= speed <= actions.speed_high:
                continue
            if not may_change_lane(LANE_CHANGE[action], off_centre, prediction.lane_width):
                continue
            crashed, imposed = add_child(tree, node, count, PlannedState(action, lane, speed), scene, robot, prediction)
            if LANE_CHANGE[action] != 0 and imposed > actions.polite_braking:
                continue
            child = nodes[count]
            worst = math.inf
            if weights.gamma_r < 1.0:
                worst = worst_value(
                    tree.state[count], tree.place[count], bodies, robot, child.heading, tables, weights.value_clip
                )
            child.value = nodes[node].value + weight * total_reward(speed, lane, crashed, worst, weights)
            child.first_action = action if node == ROOT else nodes[node].first_action
            action_values[child.first_action] = max(action_values[child.first_action], child.value)
            if best == ROOT or child.value > nodes[best].value:
                best = count
            if not crashed:
                bound = child.value + weight * actions.discount / (1.0 - actions.discount)
                leaves = push_leaf(tree.bound, tree.leaf, nodes, leaves, count, bound)
            count += 1
    return count, expansions, best


@kernel
def open_node(tree: Tree, node: int, scene: Scene, bodies: np.ndarray, prediction: PredictionModel) -> int:
    """Prepare what the children of a node share, and return the robot's column of the scene."""
    robot = open_scene(tree.state[node], tree.place[node], scene.state, scene.place, bodies)
    if prediction.tells_apart:
        order_drivers(scene, prediction)
    decide_and_find_leaders(scene, robot, prediction)
    drive_cars(scene, robot, noticed_lanes(scene.state[LATERAL, robot], prediction), SHARED, prediction)
    return robot


@kernel
def add_child(
    tree: Tree,
    node: int,
    child: int,
    planned: PlannedState,
    scene: Scene,
    robot: int,
    prediction: PredictionModel,
) -> tuple[bool, float]:
    """Write the node that an action of an opened node leads to; see what the robot does on the way.

    Returns:
        Whether it crashes, and how hard those brake whose lane it enters, m/s².
    """
    occupied, heading = drive_robot(scene, robot, planned.lane, planned.speed, prediction)
    drive_cars(scene, robot, occupied, REACTING, prediction)
    close_scene(tree.state[child], tree.place[child], scene, robot, prediction)
    entry = tree.nodes[child]
    entry.parent = node
    entry.action = planned.action
    entry.depth = tree.nodes[node].depth + 1
    entry.planned_lane = planned.lane
    entry.planned_speed = planned.speed
    entry.heading = heading
    return robot_crashes(scene, robot, prediction), braking_imposed(scene, robot, occupied, prediction)


@kernel
def may_change_lane(change: int, off_centre: float, lane_width: float) -> bool:
    """Return whether the robot may now plan for the lane to the left (+1) or the right (−1); 0 is always allowed.

    It must have come near the lane that it planned for, or be turning back. Otherwise the reward of a lane far across
    could be had at once by planning for it, and lost never by turning back in time; and the tracking controller,
    which steers the harder the farther the lane is, would cross faster than predicted.

    Args:
        change: of the planned lane.
        off_centre: where the robot is to the left of the lane planned for now, m.
        lane_width: m.
    """
    return change * off_centre >= -REACHED * lane_width


@kernel
def open_scene(
    node_state: np.ndarray, node_place: np.ndarray, state: np.ndarray, place: np.ndarray, bodies: np.ndarray
) -> int:
    """Lay a node's vehicles out in a scene, sorted by position, and return the robot's column."""
    for column in range(state.shape[1]):
        vehicle = node_place[VEHICLE, column]
        place[VEHICLE, column] = vehicle
        place[LANE, column] = node_place[LANE, column]
        place[SECOND_LANE, column] = node_place[SECOND_LANE, column]
        state[POSITION, column] = node_state[POSITION, column]
        state[SPEED, column] = node_state[SPEED, column]
        state[LATERAL, column] = node_state[LATERAL, column]
        state[LENGTH, column] = bodies[vehicle, 0]
        state[WIDTH, column] = bodies[vehicle, 1]
    return sort_by_position(state, place)


@kernel
def close_scene(
    node_state: np.ndarray, node_place: np.ndarray, scene: Scene, robot: int, prediction: PredictionModel
) -> None:
    """Write the vehicles at the end of the predicted motion into a node, in the order of the scene.

    A car is in the lane that it comes from until its body has left it.
    """
    state, place, last = scene.state, scene.place, prediction.steps
    moved = prediction.others_lateral_speed * prediction.step * last
    for car in range(state.shape[1]):
        lane = place[LANE, car]
        centre = lane * prediction.lane_width
        lateral = approach(state[LATERAL, car], centre, moved)
        node_place[VEHICLE, car] = place[VEHICLE, car]
        node_place[LANE, car] = lane
        is_within = abs(lateral - centre) <= 0.5 * (prediction.lane_width - state[WIDTH, car])
        node_place[SECOND_LANE, car] = lane if is_within else place[SECOND_LANE, car]
        node_state[POSITION, car] = scene.motion[place[BRANCH, car], POSITION, car, last]
        node_state[SPEED, car] = scene.motion[place[BRANCH, car], SPEED, car, last]
        node_state[LATERAL, car] = lateral
    lowest, highest = outermost_lanes(scene.robot_lanes[last], prediction.lane_count)
    node_place[LANE, robot] = lowest
    node_place[SECOND_LANE, robot] = highest
    node_state[POSITION, robot] = scene.robot_motion[POSITION, last]
    node_state[SPEED, robot] = scene.robot_motion[SPEED, last]
    node_state[LATERAL, robot] = scene.robot_motion[LATERAL, last]


@kernel
def outermost_lanes(lanes: int, lane_count: int) -> tuple[int, int]:
    """Return the lowest and the highest lane of a bit set that is not empty."""
    lowest, highest = lane_count - 1, 0
    for lane in range(lane_count):
        if lanes & (1 << lane):
            lowest, highest = min(lowest, lane), max(highest, lane)
    return lowest, highest


@kernel
def worst_value(
    state: np.ndarray,
    place: np.ndarray,
    bodies: np.ndarray,
    robot: int,
    heading: float,
    tables: TableStack,
    clip: float,
) -> float:
    """Return min_j V at a node's relative states, m; +inf where no car is within the table's grid.

    Stops at −clip: nothing below it changes the reward.
    """
    worst, flat, numbers = math.inf, tables.flat, tables.numbers
    for kind in range(len(numbers)):
        grid = grid_in(numbers, kind)
        lower, upper = grid.lower, grid.upper
        for car in range(state.shape[1]):
            vehicle = place[VEHICLE, car]
            if car == robot or bodies[vehicle, KIND] != kind:
                continue
            p_x, p_y = offsets_in_class(
                numbers,
                kind,
                float(state[POSITION, robot] - state[POSITION, car]),
                float(state[LATERAL, robot] - state[LATERAL, car]),
                bodies[vehicle, 0],
                bodies[vehicle, 1],
            )
            # Most cars of a large scene are beyond the grid: they need not be looked up to be told so.
            v_r, v_o = float(state[SPEED, robot]), float(state[SPEED, car])
            if not (lower[1] <= p_y <= upper[1] and lower[0] <= p_x - shift_of_grid(grid, v_r, v_o) <= upper[0]):
                continue
            value = value_at(flat, grid, p_x, p_y, heading, v_r, v_o)
            worst = min(worst, value)
            if worst <= -clip:
                return worst
    return worst
