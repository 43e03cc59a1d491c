"""Every planner's answer passes here before the robot follows it, whoever wrote the planner."""

import math
from dataclasses import replace

from hj_cosim.planning.contract import ACTION_COUNT, Plan, Planner, PreparedPlanner
from hj_cosim.plugin_answers import answered_quickly, called, is_number, shown_answer, wrong_answer
from hj_cosim.scene.observation import FARTHEST, Observation, Target
from hj_cosim.scene.road import Road


class GuardedPlanner:
    """A planner whose failures end the episode in one sentence that names its file and line.

    Args:
        planner: any of the contract.
        road: the lanes that its targets have to be among.
    """

    def __init__(self, planner: Planner, road: Road) -> None:
        self._planner = planner
        self._lane_count = road.lane_count

    def prepare(self, observation: Observation) -> None:
        """Let the planner do what it has to before the drive.

        Raises:
            PluginError: if it fails, or writes into what it is handed.
            HjCosimError: as the planner raises it.
        """
        if isinstance(self._planner, PreparedPlanner):
            called(self._planner, "prepare", observation)

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the planner's plan; see Planner.

        Raises:
            PluginError: if it fails, takes too long, writes into what it is handed, or returns what is no plan for this
                road.
            HjCosimError: as the planner raises it.
        """
        plan = answered_quickly(self._planner, "plan", observation, previous)
        if what := self._wrong(plan):
            raise wrong_answer(self._planner, "plan", what)
        # A float32, as of a neural network, would have the tracker's and the filter's kernels compiled once more.
        return replace(plan, action=int(plan.action), target=Target(int(plan.target.lane), float(plan.target.speed)))

    def _wrong(self, plan: object) -> str:
        """Return what is wrong with an answer, to go on after "returned"; empty if nothing is."""
        if not (isinstance(plan, Plan) and isinstance(plan.target, Target)):
            return f"{shown_answer(plan)}, which is no Plan with a Target"
        lane, speed, action = plan.target.lane, plan.target.speed, plan.action
        if not (is_number(lane) and math.isfinite(lane) and lane == int(lane) and 0 <= lane < self._lane_count):
            return f"a target in lane {shown_answer(lane)}; the road has the lanes 0 to {self._lane_count - 1}"
        if not (is_number(speed) and 0.0 <= speed <= FARTHEST):
            return f"a target speed of {shown_answer(speed)}; 0 m/s or more is a speed"
        if not (is_number(action) and action in range(ACTION_COUNT)):
            return f"the action {shown_answer(action)}; the actions are 0 to {ACTION_COUNT - 1} (planning/contract.py)"
        return ""
