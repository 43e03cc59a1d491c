"""Optimistic planning of deterministic systems (Hren & Munos 2008) over the robot's actions.

A node is what the robot and the cars around it will be after a sequence of actions. With rewards in [0, 1] and a
discount γ, no continuation of a node at depth d can be worth more than its upper bound, the discounted rewards on
the way to it plus γ^d / (1 − γ); those rewards alone are its lower bound. Each expansion takes the leaf of the
highest upper bound and adds a child for each action. The answer is the first action on the way to the node of the
highest lower bound.

A tree of n expansions has at most 5 n + 1 nodes, each of 58 + 16 (J + 1) bytes for J cars; all are allocated before the
search begins, and nothing is allocated in it.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.planning.prediction import (
    CENTRED,
    Motion,
    PredictionModel,
    Scene,
    approach,
    change_lanes,
    drive_robot,
    drive_without_robot,
    find_leaders,
    react_to_robot,
    robot_crashes,
    sort_scene,
)
from hj_cosim.planning.reward import RewardModel, driving_reward, total_reward
from hj_cosim.reachability.lookup import TableArrays, value_at

IDLE, FASTER, SLOWER, LEFT, RIGHT = range(5)
ACTION_COUNT = 5
ROOT = 0


class ActionModel(NamedTuple):
    """What the robot's actions change, and what ends with them."""

    discount: float  # γ
    speed_step: float  # m/s
    speed_floor: float  # m/s
    speed_high: float  # m/s
    expansions: int  # the budget


class Tree(NamedTuple):
    """The nodes of a search, N of them, and its frontier, a binary heap. Node 0 is the root."""

    parent: np.ndarray  # (N,) int32
    action: np.ndarray  # (N,) int8, that led to it
    depth: np.ndarray  # (N,) int32
    value: np.ndarray  # (N,) lower bound: the discounted rewards on the way to it
    planned_lane: np.ndarray  # (N,) int32, l_p
    planned_speed: np.ndarray  # (N,) v_p, m/s
    heading: np.ndarray  # (N,) of the robot, rad
    vehicle: np.ndarray  # (N, M) int16; this and the following as in Scene, nearly sorted by position
    position: np.ndarray  # (N, M) float32, m ahead of the robot's position at the root
    speed: np.ndarray  # (N, M) float32, m/s
    lateral: np.ndarray  # (N, M) float32, m
    lane: np.ndarray  # (N, M) int8
    second_lane: np.ndarray  # (N, M) int8
    bound: np.ndarray  # (N,) upper bounds of the leaves, a binary heap with the highest first
    leaf: np.ndarray  # (N,) int32, the leaves that they belong to


def empty_tree(expansions: int, vehicles: int) -> Tree:
    """Return a tree with room for a search of `expansions` over `vehicles`, the robot included."""
    nodes = ACTION_COUNT * expansions + 1
    return Tree(
        parent=np.zeros(nodes, np.int32),
        action=np.zeros(nodes, np.int8),
        depth=np.zeros(nodes, np.int32),
        value=np.zeros(nodes),
        planned_lane=np.zeros(nodes, np.int32),
        planned_speed=np.zeros(nodes),
        heading=np.zeros(nodes),
        vehicle=np.zeros((nodes, vehicles), np.int16),
        position=np.zeros((nodes, vehicles), np.float32),
        speed=np.zeros((nodes, vehicles), np.float32),
        lateral=np.zeros((nodes, vehicles), np.float32),
        lane=np.zeros((nodes, vehicles), np.int8),
        second_lane=np.zeros((nodes, vehicles), np.int8),
        bound=np.zeros(nodes),
        leaf=np.zeros(nodes, np.int32),
    )


@njit(cache=True)
def search(
    tree: Tree,
    scene: Scene,
    motion: Motion,
    bodies: np.ndarray,
    prediction: PredictionModel,
    actions: ActionModel,
    weights: RewardModel,
    table: TableArrays,
) -> tuple[int, int, int]:
    """Search from the root, which the caller has written into node 0, until the budget is spent.

    Args:
        tree: whose node 0 is the root; the rest is overwritten.
        scene, motion: work space for M vehicles.
        bodies: (M, 2) length and width of each vehicle by its number, m.
        prediction, actions, weights, table: the models.

    Returns:
        The number of nodes, the number of expansions, and the node of the highest lower bound (the earliest of
        several).
    """
    nodes, expansions, best = 1, 0, ROOT
    leaves = push_leaf(tree, 0, ROOT, 1.0 / (1.0 - actions.discount))
    while leaves > 0 and expansions < actions.expansions:
        node = tree.leaf[0]
        leaves = pop_leaf(tree, leaves)
        robot = open_scene(tree, node, scene, bodies)
        change_lanes(scene, robot, prediction)
        find_leaders(scene, robot, motion)
        drive_without_robot(scene, robot, motion, prediction)
        expansions += 1
        weight = actions.discount ** tree.depth[node]
        for action in range(ACTION_COUNT):
            if not action_exists(tree, node, action, actions, prediction.lane_count):
                continue
            child = nodes
            nodes += 1
            crashed = add_child(tree, node, child, action, scene, robot, motion, prediction, actions)
            driving = driving_reward(tree.planned_speed[child], tree.planned_lane[child], crashed, weights)
            worst = math.inf
            if weights.gamma_r < 1.0:
                worst = worst_value(tree, child, robot, table, weights.value_clip)
            tree.value[child] = tree.value[node] + weight * total_reward(driving, worst, weights)
            if tree.value[child] > tree.value[best] or best == ROOT:
                best = child
            if not crashed:
                bound = tree.value[child] + weight * actions.discount / (1.0 - actions.discount)
                leaves = push_leaf(tree, leaves, child, bound)
    return nodes, expansions, best


@njit(cache=True)
def action_exists(tree: Tree, node: int, action: int, actions: ActionModel, lane_count: int) -> bool:
    """Return whether an action stays on the road and within the speed limits."""
    if action == FASTER:
        return tree.planned_speed[node] + actions.speed_step <= actions.speed_high
    if action == SLOWER:
        return tree.planned_speed[node] - actions.speed_step >= actions.speed_floor
    if action == LEFT:
        return tree.planned_lane[node] + 1 < lane_count
    if action == RIGHT:
        return tree.planned_lane[node] > 0
    return True


@njit(cache=True)
def open_scene(tree: Tree, node: int, scene: Scene, bodies: np.ndarray) -> int:
    """Lay a node's vehicles out in `scene`, sorted by position, and return the robot's place."""
    for place in range(len(scene.vehicle)):
        vehicle = tree.vehicle[node, place]
        scene.vehicle[place] = vehicle
        scene.position[place] = tree.position[node, place]
        scene.speed[place] = tree.speed[node, place]
        scene.lateral[place] = tree.lateral[node, place]
        scene.lane[place] = tree.lane[node, place]
        scene.second_lane[place] = tree.second_lane[node, place]
        scene.length[place] = bodies[vehicle, 0]
        scene.width[place] = bodies[vehicle, 1]
    return sort_scene(scene)


@njit(cache=True)
def add_child(
    tree: Tree,
    node: int,
    child: int,
    action: int,
    scene: Scene,
    robot: int,
    motion: Motion,
    prediction: PredictionModel,
    actions: ActionModel,
) -> bool:
    """Predict the robot's `action` from `node`, write the state it leads to, and return whether the robot crashes."""
    lane, speed = tree.planned_lane[node], tree.planned_speed[node]
    if action == FASTER:
        speed += actions.speed_step
    elif action == SLOWER:
        speed -= actions.speed_step
    elif action == LEFT:
        lane += 1
    elif action == RIGHT:
        lane -= 1
    tree.parent[child] = node
    tree.action[child] = action
    tree.depth[child] = tree.depth[node] + 1
    tree.planned_lane[child] = lane
    tree.planned_speed[child] = speed
    tree.heading[child] = drive_robot(scene, robot, lane, speed, motion, prediction)
    react_to_robot(scene, robot, motion, prediction)
    close_scene(tree, child, scene, robot, motion, prediction)
    return robot_crashes(scene, robot, motion, prediction)


@njit(cache=True)
def close_scene(tree: Tree, child: int, scene: Scene, robot: int, motion: Motion, prediction: PredictionModel) -> None:
    """Write the vehicles at the end of the predicted motion into a node, in the order of the scene."""
    last = prediction.steps
    moved = prediction.others_lateral_speed * prediction.step * last
    for place in range(len(scene.vehicle)):
        tree.vehicle[child, place] = scene.vehicle[place]
        if place == robot:
            continue
        branch = motion.branch[place]
        centre = scene.lane[place] * prediction.lane_width
        lateral = approach(scene.lateral[place], centre, moved)
        arrived = abs(lateral - centre) < CENTRED
        tree.position[child, place] = motion.position[branch, place, last]
        tree.speed[child, place] = motion.speed[branch, place, last]
        tree.lateral[child, place] = lateral
        tree.lane[child, place] = scene.lane[place]
        tree.second_lane[child, place] = scene.lane[place] if arrived else scene.second_lane[place]
    tree.position[child, robot] = motion.robot_position[last]
    tree.speed[child, robot] = motion.robot_speed[last]
    tree.lateral[child, robot] = motion.robot_lateral[last]
    lowest, highest = outermost_lanes(motion.robot_lanes[last], prediction.lane_count)
    tree.lane[child, robot] = lowest
    tree.second_lane[child, robot] = highest


@njit(cache=True)
def outermost_lanes(lanes: int, lane_count: int) -> tuple[int, int]:
    """Return the lowest and the highest lane of a bit set."""
    lowest, highest = lane_count - 1, 0
    for lane in range(lane_count):
        if lanes & (1 << lane):
            lowest, highest = min(lowest, lane), max(highest, lane)
    return min(lowest, highest), highest


@njit(cache=True)
def worst_value(tree: Tree, node: int, robot: int, table: TableArrays, clip: float) -> float:
    """Return min_j V at a node's relative states, m; +inf where no car is within the table's grid.

    Stops at −clip: nothing below it changes the reward.
    """
    worst = math.inf
    x, y, speed = tree.position[node, robot], tree.lateral[node, robot], tree.speed[node, robot]
    heading = tree.heading[node]
    for place in range(tree.position.shape[1]):
        if place == robot:
            continue
        value = value_at(
            table,
            float(x - tree.position[node, place]),
            float(y - tree.lateral[node, place]),
            heading,
            float(speed),
            float(tree.speed[node, place]),
        )
        worst = min(worst, value)
        if worst <= -clip:
            return worst
    return worst


@njit(cache=True)
def comes_first(tree: Tree, bound: float, node: int, other_bound: float, other: int) -> bool:
    """Return whether a leaf is expanded before another: the higher bound, then the shallower, then the older."""
    if bound != other_bound:
        return bound > other_bound
    if tree.depth[node] != tree.depth[other]:
        return tree.depth[node] < tree.depth[other]
    return node < other


@njit(cache=True)
def push_leaf(tree: Tree, leaves: int, node: int, bound: float) -> int:
    """Put a leaf on the frontier, a heap of `leaves`, and return how many it now has."""
    place = leaves
    while place > 0:
        above = (place - 1) // 2
        if not comes_first(tree, bound, node, tree.bound[above], tree.leaf[above]):
            break
        tree.bound[place] = tree.bound[above]
        tree.leaf[place] = tree.leaf[above]
        place = above
    tree.bound[place] = bound
    tree.leaf[place] = node
    return leaves + 1


@njit(cache=True)
def pop_leaf(tree: Tree, leaves: int) -> int:
    """Take the first leaf off the frontier, a heap of `leaves`, and return how many are left."""
    last = leaves - 1
    bound, node = tree.bound[last], tree.leaf[last]
    place = 0
    while True:
        below = 2 * place + 1
        if below >= last:
            break
        right = below + 1
        if right < last and comes_first(tree, tree.bound[right], tree.leaf[right], tree.bound[below], tree.leaf[below]):
            below = right
        if not comes_first(tree, tree.bound[below], tree.leaf[below], bound, node):
            break
        tree.bound[place] = tree.bound[below]
        tree.leaf[place] = tree.leaf[below]
        place = below
    tree.bound[place] = bound
    tree.leaf[place] = node
    return last
