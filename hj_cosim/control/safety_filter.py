"""The safety filter between the tracking controller and the robot: SPC, RSS, or none.

A filter never returns a control that is not finite or not within the robot's limits. Where it cannot judge, because
the observation or the table gave NaN or infinity, it brakes as hard as the robot may and steers straight along the
road; where only the desired control is not finite, it filters that control instead. Both are counted.
"""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hj_cosim.config import FilterSettings, RobotSettings
from hj_cosim.control.hji_rows import Disturbance, all_finite, hji_rows
from hj_cosim.control.rss_rows import NEVER_SEEN, Response, rss_rows
from hj_cosim.control.safety_problem import SafetyRows, SafetySolver, available_controls, least_slack
from hj_cosim.reachability.value_table import ValueTable
from hj_cosim.vehicles.observation import Control, Observation

NOBODY = -1
# A row is met, and rows can be met together, when the slack is below this (m/s for the HJI, m/s² for RSS).
SLACK_TOLERANCE = 1e-6
# s, in which a robot that cannot judge turns to the road's direction.
STRAIGHTENING_TIME = 0.5

_NO_ROWS = SafetyRows(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0), np.empty(0), np.empty(0))


@dataclass(frozen=True, slots=True)
class FilterResult:
    """What the filter did at one instant, and why."""

    control: Control
    desired: Control  # as asked for, within the robot's limits
    value: float  # m, min over cars of V; +inf when no car is within the table
    value_vehicle: int  # whose number, NOBODY if none
    constraints: int  # |K|: cars with V <= ε, or dangerous ones for RSS
    intervening: bool  # K is not empty
    slack: float  # t of the control; 0 without rows, negative in SW where all rows are met with room
    least_slack: float  # the least t >= 0 that any control within the limits needs
    rows: SafetyRows
    available: np.ndarray  # (4,) lower and upper ω, lower and upper a that the rows were to be met within
    backend: str  # what solved the problem; empty without rows or when the filter could not judge

    @property
    def meetable(self) -> bool:
        """Whether the rows can be met together within the robot's limits."""
        return self.least_slack <= SLACK_TOLERANCE

    @property
    def meets_rows(self) -> bool:
        """Whether the control meets all rows."""
        return self.slack <= SLACK_TOLERANCE


class SafetyFilter(Protocol):
    """Turns the desired control into a safe one."""

    counts: Counter[str]  # "<backend> failed", "desired not finite", "could not judge"

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the control to apply for the next step; to be called once a step, in order."""
        ...


def make_filter(settings: FilterSettings, robot: RobotSettings, table: ValueTable, step: float) -> SafetyFilter:
    """Return the filter that the settings name.

    Args:
        settings: kind, scheme and parameters.
        robot: limits and body.
        table: the value function; all filters report its least value.
        step: s, the time for which a control is held.

    Raises:
        ConfigurationError: if the chosen backend is not installed.
    """
    if settings.kind == "none":
        return NoFilter(robot, table)
    if settings.kind == "rss":
        return RssFilter(settings, robot, table)
    return SafetyPreservingFilter(settings, robot, table, step)


class _Door:
    """What all filters share: the limits, the look-up, and the guard against what is not finite."""

    def __init__(self, robot: RobotSettings, table: ValueTable) -> None:
        self.counts: Counter[str] = Counter()
        self._robot = robot
        self._limits = np.array([-robot.omega_max, robot.omega_max, robot.acceleration_min, robot.acceleration_max])
        self._arrays = table.arrays
        self._disturbance = Disturbance.of(table)

    def _within_limits(self, control: Control) -> Control:
        robot = self._robot
        return Control(
            min(max(control.omega, -robot.omega_max), robot.omega_max),
            min(max(control.acceleration, robot.acceleration_min), robot.acceleration_max),
        )

    def _brake_in_lane(self, heading: float) -> Control:
        omega = -heading / STRAIGHTENING_TIME if math.isfinite(heading) else 0.0
        return self._within_limits(Control(omega, self._robot.acceleration_min))

    def _admit(self, observation: Observation, desired: Control) -> Control | None:
        """Return the desired control within the limits, or None when the observation cannot be judged."""
        seen = observation
        if not all_finite(seen.robot, seen.x, seen.y, seen.heading, seen.speed):
            self.counts["could not judge"] += 1
            return None
        if not math.isfinite(desired.omega + desired.acceleration):
            self.counts["desired not finite"] += 1
            return self._brake_in_lane(observation.robot[2])
        return self._within_limits(desired)

    def _values(self, observation: Observation, epsilon: float) -> tuple[np.ndarray, np.ndarray, float, int]:
        """Return cars in K, rows (V, p, q, c), the least V and its car's number."""
        cars, rows, value, nearest = hji_rows(
            self._arrays,
            observation.robot,
            observation.x,
            observation.y,
            observation.speed,
            epsilon,
            self._disturbance,
        )
        return cars, rows, value, NOBODY if nearest < 0 else int(observation.vehicle[nearest])

    def _unjudged(self, observation: Observation) -> FilterResult:
        control = self._brake_in_lane(float(observation.robot[2]))
        return FilterResult(control, control, math.inf, NOBODY, 0, False, 0.0, 0.0, _NO_ROWS, self._limits, "")

    def _unfiltered(self, desired: Control, value: float, value_vehicle: int) -> FilterResult:
        return FilterResult(desired, desired, value, value_vehicle, 0, False, 0.0, 0.0, _NO_ROWS, self._limits, "")


class NoFilter(_Door):
    """Lets the desired control through, within the robot's limits."""

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the desired control; see SafetyFilter."""
        wanted = self._admit(observation, desired)
        if wanted is None:
            return self._unjudged(observation)
        _, _, value, value_vehicle = self._values(observation, -math.inf)
        return self._unfiltered(wanted, value, value_vehicle)


class _Intervening(_Door):
    """A filter with rows: solves the problem whenever there are any."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable) -> None:
        super().__init__(robot, table)
        self._settings = settings
        self._solver = SafetySolver(settings, robot, self.counts)
        self._previous_omega = 0.0

    def _solve(
        self,
        rows: SafetyRows,
        constraints: int,
        wanted: Control,
        box: np.ndarray,
        value: float,
        value_vehicle: int,
    ) -> FilterResult:
        """Return the result for a set K; the desired control itself where K is empty."""
        if constraints == 0:
            self._previous_omega = wanted.omega
            return self._unfiltered(wanted, value, value_vehicle)
        # SW holds the steering instead of following the desired one (paper, section HJI Safety Controller).
        omega = self._previous_omega if self._settings.scheme == "sw" else wanted.omega
        solution = self._solver.solve(rows, omega, wanted.acceleration, box)
        self._previous_omega = solution.omega
        return FilterResult(
            control=Control(solution.omega, solution.acceleration),
            desired=wanted,
            value=value,
            value_vehicle=value_vehicle,
            constraints=constraints,
            intervening=True,
            slack=solution.slack,
            least_slack=0.0 if solution.slack <= 0.0 else least_slack(rows, box),
            rows=rows,
            available=box,
            backend=solution.backend,
        )

    def _cannot_judge(self, observation: Observation) -> FilterResult:
        result = self._unjudged(observation)
        self._previous_omega = result.control.omega
        return result


class SafetyPreservingFilter(_Intervening):
    """SPC, the paper's multi-agent safety-preserving control."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable, step: float) -> None:
        super().__init__(settings, robot, table)
        heading_lower, heading_upper = table.grid.lower[2], table.grid.upper[2]
        self._bounds = np.array([heading_lower, heading_upper, 0.0, robot.speed_max])
        self._step = step

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the control nearest to the desired one that lets no V in K decrease; see SafetyFilter."""
        wanted = self._admit(observation, desired)
        if wanted is None:
            return self._cannot_judge(observation)
        cars, rows, value, value_vehicle = self._values(observation, self._settings.epsilon)
        if not np.isfinite(rows).all():
            self.counts["could not judge"] += 1
            return self._cannot_judge(observation)
        safety_rows = SafetyRows(observation.vehicle[cars], rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3])
        state = observation.robot
        box = available_controls(self._limits, state[2], state[3], self._bounds, self._step)
        return self._solve(safety_rows, len(cars), wanted, box, value, value_vehicle)


class RssFilter(_Intervening):
    """The RSS proper response as the filter's rows, the paper's baseline."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable) -> None:
        super().__init__(settings, robot, table)
        self._response = Response.of(settings.rss)
        self._size = np.array([robot.length, robot.width])
        self._memory = np.full(64, NEVER_SEEN, dtype=np.int64)

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the control nearest to the desired one that responds to all dangerous cars; see SafetyFilter."""
        wanted = self._admit(observation, desired)
        if wanted is None:
            return self._cannot_judge(observation)
        _, _, value, value_vehicle = self._values(observation, -math.inf)
        self._remember_all(observation.vehicle)
        cars, rows, dangerous = rss_rows(
            observation.robot,
            self._size,
            observation.vehicle,
            observation.x,
            observation.y,
            observation.heading,
            observation.speed,
            observation.length,
            observation.width,
            self._response,
            self._memory,
        )
        safety_rows = SafetyRows(observation.vehicle[cars], np.zeros(len(cars)), rows[:, 0], rows[:, 1], rows[:, 2])
        return self._solve(safety_rows, dangerous, wanted, self._limits, value, value_vehicle)

    def _remember_all(self, vehicle: np.ndarray) -> None:
        """Make room in the memory for all numbers seen."""
        highest = int(vehicle.max(initial=-1))
        if highest >= len(self._memory):
            longer = np.full(2 * (highest + 1), NEVER_SEEN, dtype=np.int64)
            longer[: len(self._memory)] = self._memory
            self._memory = longer
