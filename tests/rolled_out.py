"""What the planner's model expects of given actions, node by node: to lay it beside what then happens in SUMO."""

from collections.abc import Sequence

import numpy as np

from hj_cosim.planning.contract import PredictedTrajectory
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.planning.optimistic.tree_search import (
    LANE_CHANGE,
    SPEED_CHANGE,
    PlannedState,
    add_child,
    empty_tree,
    open_node,
)
from hj_cosim.scene.observation import Observation, Target


def predict(
    planner: OptimisticPlanner, observation: Observation, previous: Target, actions: Sequence[int]
) -> PredictedTrajectory:
    """Return what a planner's model expects of a sequence of actions, one for each action time."""
    cars, bodies = planner._enter(observation)
    tree = empty_tree(len(actions), len(cars) + 1)
    planner._plant_root(tree, observation, cars, previous)
    for node, action in enumerate(actions):
        lane = int(tree.nodes[node]["planned_lane"]) + int(LANE_CHANGE[action])
        speed = float(tree.nodes[node]["planned_speed"]) + SPEED_CHANGE[action] * planner._settings.speed_step
        robot = open_node(tree, node, planner._scene, bodies, planner._prediction)
        planned = PlannedState(action, lane, float(speed))
        add_child(tree, node, node + 1, planned, planner._scene, robot, planner._prediction)
    return planner._trajectory(tree, np.arange(len(actions) + 1), observation, cars)
