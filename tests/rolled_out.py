"""What the planner's model expects of given actions, node by node: to lay it beside what then happens in SUMO."""

from collections.abc import Sequence

from hj_cosim.planning.contract import PredictedTrajectory
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.scene.observation import Observation, Target


def predict(
    planner: OptimisticPlanner, observation: Observation, previous: Target, actions: Sequence[int]
) -> PredictedTrajectory:
    """Return what a planner's model expects of a sequence of actions, one for each action time."""
    return planner.foresee(observation, previous, actions)
