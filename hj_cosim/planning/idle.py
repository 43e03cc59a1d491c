"""The planner that changes nothing."""

from hj_cosim.planning.contract import IDLE, Plan
from hj_cosim.scene.observation import Observation, Target


class IdlePlanner:
    """Keeps the lane and the speed that it was given first."""

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the previous target; the observation is not looked at."""
        return Plan(action=IDLE, target=previous)
