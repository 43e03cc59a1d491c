"""The control nearest to the desired one that meets a filter's rows, with all that led to it."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from hj_cosim.control.contract import FilterDecision
from hj_cosim.control.problem.safety_problem import NO_ROWS, SafetyRows, SafetySolver, least_slack
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings

# Rows can be met together when the least slack is below this (m/s for the HJI, m/s² for RSS).
SLACK_TOLERANCE = 1e-6
_FIRST = 100.0  # times as much counts a row that comes first, beyond the least by which it has to be missed


@dataclass(frozen=True, slots=True, kw_only=True)
class RowsDecision(FilterDecision):
    """The decision of a filter that has rows."""

    desired: Control  # as asked for
    rows: SafetyRows
    available: np.ndarray  # (4,) lower and upper ω, lower and upper a that the rows were to be met within
    least_slack: float = 0.0  # the least t >= 0 that any control within the limits needs
    backend: str = ""  # what solved the problem; empty without rows
    escaping: bool = False  # the control is a manoeuvre's, because the problem's would have left no escape

    @property
    def meetable(self) -> bool:
        """Whether the rows can be met together within the robot's limits."""
        return self.least_slack <= SLACK_TOLERANCE


def limits_of(robot: RobotSettings) -> np.ndarray:
    """Return the robot's limits as a box, (4,) lower and upper ω (rad/s), lower and upper a (m/s²)."""
    return np.array([-robot.omega_max, robot.omega_max, robot.acceleration_min, robot.acceleration_max])


def within(available: np.ndarray, control: Control) -> Control:
    """Return a control held to what is available, (4,); the same one where it is."""
    omega = min(max(control.omega, available[0]), available[1])
    acceleration = min(max(control.acceleration, available[2]), available[3])
    held = omega == control.omega and acceleration == control.acceleration
    return control if held else Control(float(omega), float(acceleration))


class Grip:
    """The robot's limits, with no more turning than its tyres hold.

    Args:
        robot: its limits.
    """

    def __init__(self, robot: RobotSettings) -> None:
        self._limits = limits_of(robot)
        self._sideways = robot.lateral_acceleration_max
        self._free = robot.lateral_acceleration_max / robot.omega_max  # m/s, up to which tyres hold any turn

    def limits_at(self, speed: float) -> np.ndarray:
        """Return the limits at a speed (m/s), (4,) as of `limits_of`; the same array where tyres hold any turn."""
        if speed <= self._free:
            return self._limits
        turning_max = self._sideways / speed
        return np.array([-turning_max, turning_max, self._limits[2], self._limits[3]])


class NearestControl:
    """Chooses a control under rows, by one of the schemes MI and SW.

    SW holds the steering instead of following the desired one (paper, section HJI Safety Controller): whoever uses it
    says which ω was applied last.

    Args:
        settings: scheme, λ_3 and backend.
        robot: its limits.

    Raises:
        ConfigurationError: if the backend is not installed.
    """

    def __init__(self, settings: FilterSettings, robot: RobotSettings) -> None:
        self._holds_steering = settings.scheme == "sw"
        self._failures: Counter[str] = Counter()
        self._solver = SafetySolver(settings, robot, self._failures)
        self.applied_omega = 0.0  # rad/s, of the step before

    def prepare(self, available: np.ndarray) -> None:
        """Compile what solves the problem, with a row that no control meets; it leaves nothing behind."""
        row = SafetyRows(np.zeros(1, dtype=np.int64), np.zeros(1), np.zeros(1), np.zeros(1), np.full(1, -1.0))
        self._solver.solve(row, 0.0, 0.0, available)
        least_slack(row, available)
        self._failures.clear()

    def choose(self, rows: SafetyRows, constraints: int, desired: Control, available: np.ndarray) -> RowsDecision:
        """Return the decision under K rows.

        Args:
            rows: half-planes, finite; without any the desired control is the decision, as far as it is available.
            constraints: how many cars they are about.
            desired: finite, within the robot's limits.
            available: (4,) lower and upper ω, lower and upper a.
        """
        if len(rows) == 0:
            return RowsDecision(within(available, desired), desired=desired, rows=NO_ROWS, available=available)
        omega = self.applied_omega if self._holds_steering else desired.omega
        solution = self._solver.solve(rows, omega, desired.acceleration, available)
        return RowsDecision(
            control=Control(solution.omega, solution.acceleration),
            constraints=constraints,
            slack=solution.slack,
            diagnostics=self._new_failures(),
            desired=desired,
            rows=rows,
            available=available,
            least_slack=0.0 if solution.slack <= 0.0 else least_slack(rows, available),
            backend=solution.backend,
        )

    def resolve(self, decision: RowsDecision, first: np.ndarray, weight: np.ndarray, desired: Control) -> RowsDecision:
        """Return the decision under rows that cannot be met together, some of which come first.

        Those are missed as little as can be, and of the controls that do that the others are missed the least.

        Args:
            decision: of `choose`, by one slack for all.
            first: (K,) bool, which rows come first.
            weight: (K,) how much missing each counts among its like.
            desired: as there.
        """
        rows = decision.rows
        p, q, c = weight * rows.p, weight * rows.q, weight * rows.c
        if first.any():
            leading = SafetyRows(rows.vehicle[first], rows.value[first], p[first], q[first], c[first])
            c = np.where(first, c + least_slack(leading, decision.available), c)
        times = np.where(first, _FIRST, 1.0)
        weighed = replace(rows, p=times * p, q=times * q, c=times * c)
        omega = self.applied_omega if self._holds_steering else desired.omega
        solution = self._solver.solve(weighed, omega, desired.acceleration, decision.available)
        missed = -float(rows.margins(solution.omega, solution.acceleration).min())
        control = Control(solution.omega, solution.acceleration)
        return replace(decision, control=control, slack=max(missed, 0.0), backend=solution.backend)

    def _new_failures(self) -> dict[str, float]:
        """Return how often each backend failed since the last step, by its name and FAILED."""
        failures: dict[str, float] = dict(self._failures)
        self._failures.clear()
        return failures
