"""No filter at all, to compare with."""

from hj_cosim.control.contract import FilterDecision
from hj_cosim.scene.observation import CarValues, Control, Observation


class NoFilter:
    """Lets the desired control through."""

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the desired control; see SafetyFilter."""
        return FilterDecision(desired)
