"""The guard before and behind every safety filter, whoever wrote it: no control leaves it that no robot can drive.

Where nothing can be judged, because the observation, the table or the filter gave NaN, infinity or what cannot be
(`observation.FARTHEST`), the robot brakes as hard as it may and steers straight along the road; where only the desired
control is not finite, that braking is what is filtered instead. Both are counted, and summary.json tells.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hj_cosim.control.contract import FilterDecision, PreparedFilter, SafetyFilter
from hj_cosim.plugin_answers import answered_quickly, called, is_number, shown_answer, wrong_answer
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.settings import RobotSettings

NOT_JUDGED = "could not judge"
DESIRED_NOT_FINITE = "desired not finite"
# s, in which a robot that cannot judge turns to the road's direction.
STRAIGHTENING_TIME = 0.5
_MOST_CONSTRAINTS = 2**31  # what a recorded column has room for


class GuardedFilter:
    """A filter whose controls are always finite and within the robot's limits.

    Args:
        safety_filter: any of the contract.
        robot: the limits.

    Attributes:
        counts: the diagnostics summed since the beginning, NOT_JUDGED and DESIRED_NOT_FINITE among them.
    """

    def __init__(self, safety_filter: SafetyFilter, robot: RobotSettings) -> None:
        self.counts: Counter[str] = Counter()
        self._filter = safety_filter
        self._robot = robot

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Let the filter do what it has to before the drive.

        Raises:
            PluginError: if it fails, or writes into what it is handed.
            HjCosimError: as the filter raises it.
        """
        if isinstance(self._filter, PreparedFilter) and values.is_known:
            called(self._filter, "prepare", observation, values)

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the filter's decision, or braking in lane; see SafetyFilter, but for what may be asked.

        Args:
            observation, values, desired: finite or not.

        Raises:
            PluginError: if the filter fails, takes too long, writes into what it is handed, or returns what is no
                decision.
            HjCosimError: as the filter raises it.
        """
        if not values.is_known:
            return self._not_judged(observation)
        wanted = self._wanted(observation, desired)
        decision: FilterDecision = answered_quickly(self._filter, "filter", observation, values, wanted)
        if what := _wrong(decision, len(observation.vehicle)):
            raise wrong_answer(self._filter, "filter", what)
        omega, acceleration = float(decision.control.omega), float(decision.control.acceleration)
        if decision.diagnostics:
            self.counts.update(decision.diagnostics)
        if not math.isfinite(omega + acceleration):
            return self._not_judged(observation)
        control = self._within_limits(decision.control, float(observation.robot[3]))
        return decision if control is decision.control else replace(decision, control=control)

    def _not_judged(self, observation: Observation) -> FilterDecision:
        self.counts[NOT_JUDGED] += 1
        return FilterDecision(self._brake_in_lane(observation.robot))

    def _wanted(self, observation: Observation, desired: Control) -> Control:
        """Return the desired control within the limits; braking where it is not finite."""
        if not math.isfinite(desired.omega + desired.acceleration):
            self.counts[DESIRED_NOT_FINITE] += 1
            return self._brake_in_lane(observation.robot)
        return self._within_limits(desired, float(observation.robot[3]))

    def _within_limits(self, control: Control, speed: float) -> Control:
        """Return the control itself where it is within the limits, so that the common case makes nothing new.

        How far the robot may turn at a speed, m/s, is what it can and what its tyres hold.
        """
        robot, turning_max = self._robot, self._robot.omega_max
        if speed * turning_max > robot.lateral_acceleration_max:
            turning_max = robot.lateral_acceleration_max / speed
        if (
            -turning_max <= control.omega <= turning_max
            and robot.acceleration_min <= control.acceleration <= robot.acceleration_max
        ):
            return control
        return Control(
            min(max(control.omega, -turning_max), turning_max),
            min(max(control.acceleration, robot.acceleration_min), robot.acceleration_max),
        )

    def _brake_in_lane(self, robot: np.ndarray) -> Control:
        heading, speed = float(robot[2]), float(robot[3])
        omega = -heading / STRAIGHTENING_TIME if math.isfinite(heading) else 0.0
        return self._within_limits(Control(omega, self._robot.acceleration_min), speed)


def _wrong(decision: object, cars: int) -> str:
    """Return what is wrong with an answer about so many cars, to go on after "returned"; empty if nothing is.

    A control may be NaN or infinite: so a filter says that it cannot judge.
    """
    if not (isinstance(decision, FilterDecision) and isinstance(decision.control, Control)):
        return f"{shown_answer(decision)}, which is no FilterDecision with a Control"
    slack, constraints, belief = decision.slack, decision.constraints, decision.belief
    if not (is_number(decision.control.omega) and is_number(decision.control.acceleration)):
        return f"{shown_answer(decision)}, which is no FilterDecision of numbers"
    is_count = is_number(constraints) and 0 <= constraints < _MOST_CONSTRAINTS and constraints % 1 == 0
    if not (is_count and is_number(slack) and math.isfinite(slack)):
        answers = f"slack = {shown_answer(slack)}, constraints = {shown_answer(constraints)}"
        return f"{answers}; a finite slack and a count are right"
    if belief is not None:
        numbers = np.asarray(belief)
        if numbers.shape != (cars,) or numbers.dtype.kind not in "fiu" or not ((numbers >= 0) & (numbers <= 1)).all():
            return f"belief = {shown_answer(belief)}; a probability of each of the {cars} cars is right"
    if decision.diagnostics and not _are_numbers_by_name(decision.diagnostics):
        return f"diagnostics = {shown_answer(decision.diagnostics)}; finite numbers by name are right"
    return ""


def _are_numbers_by_name(diagnostics: object) -> bool:
    return isinstance(diagnostics, Mapping) and all(
        isinstance(name, str) and is_number(value) and math.isfinite(value) for name, value in diagnostics.items()
    )
