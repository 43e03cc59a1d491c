"""The safety filter between the tracking controller and the robot: SPC, RSS, or none.

A filter never returns a control that is not finite or not within the robot's limits. Where it cannot judge, because
the observation or the table gave NaN, infinity or what cannot be (`observation.FARTHEST`), it brakes as hard as the
robot may and steers straight along the road; where only the desired control is not finite, it filters that control
instead. Both are counted, and summary.json tells.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from hj_cosim.control.problem.safety_problem import SafetyRows, SafetySolver, available_controls, least_slack
from hj_cosim.control.rss.rss_rows import NEVER_SEEN, Response, rss_rows
from hj_cosim.control.spc.escape import ESCAPING, NO_ESCAPE, Extent, keep_escape_in_traffic, manoeuvres_for
from hj_cosim.reachability.games.highway.manoeuvres import NO_MANOEUVRES
from hj_cosim.reachability.table.cars import values_of_cars
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import FARTHEST, Control, Observation
from hj_cosim.settings import FilterSettings, RobotSettings

NOBODY = -1
# What filters count, beside the backends that failed.
NOT_JUDGED = "could not judge"
DESIRED_NOT_FINITE = "desired not finite"
ESCAPED = "escaped"  # the control gave way to a manoeuvre
HAD_NO_ESCAPE = "had no escape"
# A row is met, and rows can be met together, when the slack is below this (m/s for the HJI, m/s² for RSS).
SLACK_TOLERANCE = 1e-6
# s, in which a robot that cannot judge turns to the road's direction.
STRAIGHTENING_TIME = 0.5

# A row with a larger coefficient comes from a broken table; squares of smaller ones do not overflow in any solver.
LARGEST_COEFFICIENT = 1e12

_NO_CARS, _NO_TABLE_ROWS = np.empty(0, dtype=np.int64), np.empty((4, 0))
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
    escaping: bool = False  # the control is a manoeuvre's, because the problem's would have left no escape

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

    counts: Counter[str]  # "<backend> failed", DESIRED_NOT_FINITE, NOT_JUDGED

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


class _Sight(NamedTuple):
    """What the table says about the cars around."""

    cars: np.ndarray  # (K,) int, indices of the cars in K
    rows: np.ndarray  # (4, K) V, p, q, c
    values: np.ndarray  # (J,) m, V of all cars
    value: float  # m, the least of them
    value_vehicle: int


class _Door:
    """What all filters share: the limits, the look-up, and the guard against what is not finite."""

    def __init__(self, robot: RobotSettings, table: ValueTable) -> None:
        self.counts: Counter[str] = Counter()
        self._robot = robot
        self._limits = np.array([-robot.omega_max, robot.omega_max, robot.acceleration_min, robot.acceleration_max])
        self._arrays, self._rows_of_cars = table.arrays, table.rows_of_cars
        self._recovery = 0.0  # κ, 1/s; no filter but SPC has rows of the table

    def _within_limits(self, control: Control) -> Control:
        robot = self._robot
        return Control(
            min(max(control.omega, -robot.omega_max), robot.omega_max),
            min(max(control.acceleration, robot.acceleration_min), robot.acceleration_max),
        )

    def _brake_in_lane(self, heading: float) -> Control:
        omega = -heading / STRAIGHTENING_TIME if math.isfinite(heading) else 0.0
        return self._within_limits(Control(omega, self._robot.acceleration_min))

    def _wanted(self, observation: Observation, desired: Control) -> Control:
        """Return the desired control within the limits; braking where it is not finite."""
        if not (math.isfinite(desired.omega) and math.isfinite(desired.acceleration)):
            self.counts[DESIRED_NOT_FINITE] += 1
            return self._brake_in_lane(float(observation.robot[2]))
        return self._within_limits(desired)

    def _look(self, observation: Observation, epsilon: float) -> _Sight | None:
        """Return what the table says about all cars, or None where it cannot be judged."""
        robot, x, y, speed = observation.robot, observation.x, observation.y, observation.speed
        values = values_of_cars(self._arrays, robot, x, y, observation.heading, speed)
        if len(values) == 0:
            if not np.abs(robot).max() <= FARTHEST:
                return None
            return _Sight(_NO_CARS, _NO_TABLE_ROWS, values, math.inf, NOBODY)
        nearest = int(values.argmin())
        value = float(values[nearest])
        if math.isnan(value):
            return None
        if value > epsilon:
            rows, cars = _NO_TABLE_ROWS, _NO_CARS
        else:
            cars, rows = self._rows_of_cars(self._arrays, robot, x, y, speed, values, epsilon)
            if not np.abs(rows).max() <= LARGEST_COEFFICIENT:
                return None
            if self._recovery > 0.0:
                rows[3] -= self._recovery * np.minimum(epsilon - values[cars], epsilon)
        return _Sight(cars, rows, values, value, NOBODY if math.isinf(value) else int(observation.vehicle[nearest]))

    def _unjudged(self, observation: Observation) -> FilterResult:
        self.counts[NOT_JUDGED] += 1
        control = self._brake_in_lane(float(observation.robot[2]))
        return FilterResult(control, control, math.inf, NOBODY, 0, False, 0.0, 0.0, _NO_ROWS, self._limits, "")

    def _unfiltered(self, wanted: Control, sight: _Sight) -> FilterResult:
        return FilterResult(
            wanted, wanted, sight.value, sight.value_vehicle, 0, False, 0.0, 0.0, _NO_ROWS, self._limits, ""
        )


class NoFilter(_Door):
    """Lets the desired control through, within the robot's limits."""

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the desired control; see SafetyFilter."""
        sight = self._look(observation, -math.inf)
        if sight is None:
            return self._unjudged(observation)
        return self._unfiltered(self._wanted(observation, desired), sight)


class _Intervening(_Door, ABC):
    """A filter with rows: solves the problem whenever there are any."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable) -> None:
        super().__init__(robot, table)
        self._settings = settings
        self._solver = SafetySolver(settings, robot, self.counts)
        self._previous_omega = 0.0

    def filter(self, observation: Observation, desired: Control) -> FilterResult:
        """Return the control nearest to the desired one that keeps the rows; see SafetyFilter."""
        result = self._judged(observation, desired)
        self._previous_omega = result.control.omega
        return result

    def _judged(self, observation: Observation, desired: Control) -> FilterResult:
        sight = self._look(observation, self._epsilon())
        found = None if sight is None else self._rows(observation, sight)
        if sight is None or found is None:
            return self._unjudged(observation)
        wanted = self._wanted(observation, desired)
        rows, constraints = found
        if constraints == 0:
            return self._escaping(observation, sight, self._unfiltered(wanted, sight))
        result = self._solve(rows, constraints, wanted, self._available(observation.robot), sight)
        return self._escaping(observation, sight, result)

    def _escaping(self, observation: Observation, sight: _Sight, result: FilterResult) -> FilterResult:
        """Return the result, or one whose control is a manoeuvre's where the result's would leave no escape."""
        return result

    @abstractmethod
    def _epsilon(self) -> float:
        """Return up to which V a car needs a row of the table."""

    @abstractmethod
    def _rows(self, observation: Observation, sight: _Sight) -> tuple[SafetyRows, int] | None:
        """Return the rows, and the number of cars that they are about; None where they cannot be judged."""

    def _available(self, robot: np.ndarray) -> np.ndarray:
        """Return the controls within which the rows are to be met, (4,)."""
        return self._limits

    def _solve(
        self, rows: SafetyRows, constraints: int, wanted: Control, box: np.ndarray, sight: _Sight
    ) -> FilterResult:
        # SW holds the steering instead of following the desired one (paper, section HJI Safety Controller).
        omega = self._previous_omega if self._settings.scheme == "sw" else wanted.omega
        solution = self._solver.solve(rows, omega, wanted.acceleration, box)
        return FilterResult(
            control=Control(solution.omega, solution.acceleration),
            desired=wanted,
            value=sight.value,
            value_vehicle=sight.value_vehicle,
            constraints=constraints,
            intervening=True,
            slack=solution.slack,
            least_slack=0.0 if solution.slack <= 0.0 else least_slack(rows, box),
            rows=rows,
            available=box,
            backend=solution.backend,
        )


class SafetyPreservingFilter(_Intervening):
    """SPC, the paper's multi-agent safety-preserving control."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable, step: float) -> None:
        super().__init__(settings, robot, table)
        self._bounds = np.array([table.grid.lower[2], table.grid.upper[2], 0.0, robot.speed_max])
        self._step = step
        self._recovery = settings.recovery
        self._manoeuvres = manoeuvres_for(table, robot) if settings.keep_escape else NO_MANOEUVRES
        self._extent = Extent.of(table)
        if settings.keep_escape:
            # Compiled here, not in the first step of a drive: Ctrl-C while Numba compiles may be lost.
            nobody = np.empty(0)
            keep_escape_in_traffic(
                self._manoeuvres, self._extent, np.zeros(4), nobody, nobody, nobody, nobody, 0.0, 0.0, 0.0, step
            )
        # Within these, no control leads beyond the bounds in one step, and the limits themselves are available.
        turn = robot.omega_max * step
        self._free_heading = (self._bounds[0] + turn, self._bounds[1] - turn)
        self._free_speed = (-robot.acceleration_min * step, robot.speed_max - robot.acceleration_max * step)

    def _epsilon(self) -> float:
        return self._settings.epsilon

    def _rows(self, observation: Observation, sight: _Sight) -> tuple[SafetyRows, int]:
        """Return the rows of the cars with V <= ε: no V of theirs may decrease."""
        if len(sight.cars) == 0:
            return _NO_ROWS, 0
        value, p, q, c = sight.rows
        return SafetyRows(observation.vehicle[sight.cars], value, p, q, c), len(sight.cars)

    def _available(self, robot: np.ndarray) -> np.ndarray:
        heading, speed = float(robot[2]), float(robot[3])
        if (
            self._free_heading[0] <= heading <= self._free_heading[1]
            and self._free_speed[0] <= speed <= self._free_speed[1]
        ):
            return self._limits
        return available_controls(self._limits, heading, speed, self._bounds, self._step)

    def _escaping(self, observation: Observation, sight: _Sight, result: FilterResult) -> FilterResult:
        if len(self._manoeuvres.heading) == 0:
            return result
        robot, asked = observation.robot, result.control
        omega, acceleration, verdict = keep_escape_in_traffic(
            self._manoeuvres,
            self._extent,
            robot,
            observation.x,
            observation.y,
            observation.speed,
            sight.values,
            self._settings.epsilon,
            asked.omega,
            asked.acceleration,
            self._step,
        )
        if verdict == NO_ESCAPE:
            self.counts[HAD_NO_ESCAPE] += 1
        if verdict != ESCAPING:
            return result
        self.counts[ESCAPED] += 1
        box = self._available(robot)
        control = Control(min(max(omega, box[0]), box[1]), min(max(acceleration, box[2]), box[3]))
        slack = max(-float(result.rows.margins(control.omega, control.acceleration).min(initial=0.0)), 0.0)
        return replace(result, control=control, escaping=True, slack=slack)


class RssFilter(_Intervening):
    """The RSS proper response as the filter's rows, the paper's baseline."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, table: ValueTable) -> None:
        super().__init__(settings, robot, table)
        self._response = Response.of(settings.rss)
        self._size = np.array([robot.length, robot.width])
        self._memory = np.full(64, NEVER_SEEN, dtype=np.int64)

    def _epsilon(self) -> float:
        return -math.inf

    def _rows(self, observation: Observation, sight: _Sight) -> tuple[SafetyRows, int] | None:
        """Return the proper response's rows, and the number of dangerous cars; None where a car's body cannot be."""
        self._make_room(observation.vehicle)
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
        if dangerous < 0:
            return None
        if dangerous == 0:
            return _NO_ROWS, 0
        p, q, c = rows
        return SafetyRows(observation.vehicle[cars], np.zeros(len(cars)), p, q, c), dangerous

    def _make_room(self, vehicle: np.ndarray) -> None:
        """Let the memory hold all numbers seen."""
        highest = int(vehicle.max(initial=-1))
        if highest >= len(self._memory):
            longer = np.full(2 * (highest + 1), NEVER_SEEN, dtype=np.int64)
            longer[: len(self._memory)] = self._memory
            self._memory = longer
