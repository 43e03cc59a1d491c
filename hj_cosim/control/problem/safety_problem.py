"""The safety filter's optimisation problem (paper, eq. case study multiagent safety controller) and what solves it.

    min over (ω, a, t) of  λ_1 (ω − ω_des)² + λ_2 (a − a_des)² + λ_3 t
    subject to             p_k ω + q_k a + t >= −c_k  for every k in K,   (ω, a) in the robot's box,   t >= 0 in MI.

The paper's max_k η_k is the one shared slack t. `switching` (SW) has λ_2 = 0, which leaves a undetermined wherever no
row speaks of it; a tie weight of 1e-6 ā⁻² on (a − a_des)² makes it unique and changes nothing else.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from hj_cosim.control.problem.enumeration import ENUMERATION, least_cost_control
from hj_cosim.settings import FilterSettings, RobotSettings

_NARROWEST = 1e-3  # rad/s, m/s²; half a box that leaves no choice has to be scaled by something
TIE_WEIGHT = 1e-6  # of λ_1, λ_2 after scaling by ω̄ and ā
# An answer is refused when it misses a row or the box by more than this (in a row's units, relative to the slack).
FEASIBILITY_TOLERANCE = 1e-4
# A row with a larger coefficient comes from a broken table; squares of smaller ones do not overflow in any solver.
LARGEST_COEFFICIENT = 1e12
# In MI the desired control is the solution, of cost 0, where it lies in the box and meets all rows.
NOT_NEEDED = "none needed"
# What a backend's name is followed by where its failures are counted.
FAILED = " failed"


@njit(cache=True)
def are_possible(p: np.ndarray, q: np.ndarray, c: np.ndarray) -> bool:
    """Return whether no coefficient, (K,) each, is larger than a sound table's, or no number."""
    for k in range(len(p)):
        if not max(abs(p[k]), abs(q[k]), abs(c[k])) <= LARGEST_COEFFICIENT or np.isnan(p[k] + q[k] + c[k]):
            return False
    return True


@dataclass(frozen=True)
class SafetyRows:
    """The half-planes p_k ω + q_k a >= −c_k of the K constraints; for the HJI, rows of min over w_o of dV/dt."""

    vehicle: np.ndarray  # (K,) int, whose
    value: np.ndarray  # (K,) m, that car's V
    p: np.ndarray  # (K,) coefficient of ω; ∂V/∂θ_r for the HJI
    q: np.ndarray  # (K,) coefficient of a; ∂V/∂v_r
    c: np.ndarray  # (K,) c_0; the drift under the worst disturbance, less what the recovery asks for

    def __len__(self) -> int:
        return len(self.p)

    @property
    def are_possible(self) -> bool:
        """Whether every number is one, and none larger than a sound table's."""
        return are_possible(self.p, self.q, self.c)

    def margins(self, omega: float, acceleration: float) -> np.ndarray:
        """Return p ω + q a + c, (K,): negative where a control violates a row."""
        return self.p * omega + self.q * acceleration + self.c


NO_ROWS = SafetyRows(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0), np.empty(0), np.empty(0))


@dataclass(frozen=True)
class SafetyWeights:
    """λ of the problem, λ_2 the tie weight in SW, and whether t may be negative (SW)."""

    omega: float  # λ_1, (rad/s)⁻²
    acceleration: float  # λ_2, (m/s²)⁻²
    slack: float  # λ_3
    slack_is_free: bool

    @classmethod
    def of(cls, settings: FilterSettings, robot: RobotSettings) -> "SafetyWeights":
        """Return λ = (ω̄⁻², ā⁻², λ_3) of the paper for a scheme, MI or SW."""
        switching = settings.scheme == "sw"
        return cls(
            omega=robot.omega_max**-2,
            acceleration=(TIE_WEIGHT if switching else 1.0) * robot.acceleration_max**-2,
            slack=settings.slack_weight,
            slack_is_free=switching,
        )


@dataclass(frozen=True)
class SafetySolution:
    """A solution of the problem and who found it."""

    omega: float  # rad/s
    acceleration: float  # m/s²
    slack: float  # t
    backend: str


def least_slack(rows: SafetyRows, box: np.ndarray) -> float:
    """Return the least t >= 0 with which some control in the box meets all rows; 0 when they can be met together.

    A weight of 1e12 on t against 1 on the distance from the middle of the box leaves an error below 1e-10.

    Args:
        rows: K half-planes.
        box: (4,) lower and upper ω, lower and upper a.
    """
    half = np.maximum([0.5 * (box[1] - box[0]), 0.5 * (box[3] - box[2])], _NARROWEST)
    weights = np.array([half[0] ** -2, half[1] ** -2, 1e12])
    middle = (0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]))
    return least_cost_control(rows.p, rows.q, rows.c, middle[0], middle[1], weights, False, box)[2]


@njit(cache=True)
def _meets_all(omega: float, acceleration: float, p: np.ndarray, q: np.ndarray, c: np.ndarray, box: np.ndarray) -> bool:
    for k in range(len(p)):
        if p[k] * omega + q[k] * acceleration + c[k] < 0.0:
            return False
    return box[0] <= omega <= box[1] and box[2] <= acceleration <= box[3]


@njit(cache=True)
def _scaled_problem(
    p: np.ndarray,
    q: np.ndarray,
    desired: tuple[float, float],
    scale: tuple[float, float],
    tie: float,
    slack_weight: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear cost (3,) and the inequality's matrix (K, 3) over (ω, a, t), in units of `scale`."""
    linear = np.array([-2.0 * desired[0] / scale[0], -2.0 * tie * desired[1] / scale[1], slack_weight])
    inequality = np.empty((len(p), 3))
    for k in range(len(p)):
        inequality[k, 0], inequality[k, 1], inequality[k, 2] = -p[k] * scale[0], -q[k] * scale[1], -1.0
    return linear, inequality


@njit(cache=True)
def _judged_answer(
    point: np.ndarray, scale: tuple[float, float], p: np.ndarray, q: np.ndarray, c: np.ndarray, box: np.ndarray
) -> tuple[bool, float, float, float]:
    """Return whether a backend's (ω, a, t) is a solution, ω and a within the box, and max_k −(p_k ω + q_k a + c_k)."""
    omega, acceleration = point[0] * scale[0], point[1] * scale[1]
    inside = (
        box[0] - FEASIBILITY_TOLERANCE <= omega <= box[1] + FEASIBILITY_TOLERANCE
        and box[2] - FEASIBILITY_TOLERANCE <= acceleration <= box[3] + FEASIBILITY_TOLERANCE
    )
    omega, acceleration = min(max(omega, box[0]), box[1]), min(max(acceleration, box[2]), box[3])
    needed = -math.inf
    for k in range(len(p)):
        needed = max(needed, -(p[k] * omega + q[k] * acceleration + c[k]))
    kept = needed - point[2] <= FEASIBILITY_TOLERANCE * (1.0 + abs(needed))
    return inside and kept and math.isfinite(omega + acceleration + point[2]), omega, acceleration, needed


@njit(cache=True)
def available_controls(limits: np.ndarray, heading: float, speed: float, bounds: np.ndarray, step: float) -> np.ndarray:
    """Return the controls that keep heading and speed within bounds for one step; the game's own state limits.

    At a bound of the value table the input that would cross it is not available, in the game as here: beyond, the
    table does not know what it promises. A heading that is beyond is led back, as fast as the limits allow if it takes
    longer than a step.

    Args:
        limits: (4,) lower and upper ω, lower and upper a.
        heading, speed: θ and v of the robot, rad and m/s.
        bounds: (4,) lower and upper θ, lower and upper v.
        step: s, for which the control is held.

    Returns:
        (4,) like `limits`, never empty.
    """
    return np.array(
        [
            min(max(limits[0], (bounds[0] - heading) / step), limits[1]),
            max(min(limits[1], (bounds[1] - heading) / step), limits[0]),
            max(limits[2], min((bounds[2] - speed) / step, 0.0)),
            min(limits[3], max((bounds[3] - speed) / step, 0.0)),
        ]
    )


class SafetySolver:
    """Solves the problem with one of qpsolvers' backends; one that fails is answered by the next, and counted."""

    def __init__(self, settings: FilterSettings, robot: RobotSettings, counts: Counter[str]) -> None:
        """Prepare what does not change.

        Args:
            settings: scheme, λ_3 and backend.
            robot: its limits.
            counts: written: how often "<backend> failed".

        Raises:
            ConfigurationError: if the backend is not installed.
        """
        self.counts = counts
        self.weights = SafetyWeights.of(settings, robot)
        self._weight_array = np.array([self.weights.omega, self.weights.acceleration, self.weights.slack])
        # In units of ω̄ and ā (and t as it is) the problem is well conditioned.
        self._scale = (robot.omega_max, robot.acceleration_max)
        self._tie = TIE_WEIGHT if self.weights.slack_is_free else 1.0
        # Those of qpsolvers that are asked, in turn: none where enumeration is chosen, which cannot fail.
        self.backends: Sequence[str] = ()
        if settings.solver != ENUMERATION:
            from hj_cosim.control.problem.backends import Backends, answering_in_turn  # see there

            self.backends = answering_in_turn(settings.solver)
            self._answers = Backends(self._tie, self.weights.slack)
        self._last_box = np.empty(0)
        self._bounds = (np.empty(0), np.empty(0))
        self._lowest_slack = -math.inf if self.weights.slack_is_free else 0.0

    def solve(
        self, rows: SafetyRows, desired_omega: float, desired_acceleration: float, box: np.ndarray
    ) -> SafetySolution:
        """Return the control that solves the problem.

        Args:
            rows: K >= 1 half-planes, finite.
            desired_omega, desired_acceleration: rad/s, m/s²; finite, in the box or not.
            box: (4,) lower and upper ω, lower and upper a.
        """
        if not self.weights.slack_is_free and _meets_all(
            desired_omega, desired_acceleration, rows.p, rows.q, rows.c, box
        ):
            return SafetySolution(desired_omega, desired_acceleration, 0.0, NOT_NEEDED)  # its cost is 0
        if not self.backends:
            return self._enumerated(rows, desired_omega, desired_acceleration, box)
        linear, inequality = _scaled_problem(
            rows.p,
            rows.q,
            (desired_omega, desired_acceleration),
            self._scale,
            self._tie,
            self.weights.slack,
        )
        lower, upper = self._scaled_bounds(box)
        for backend in self.backends:
            point = self._answers.answer(backend, linear, inequality, rows.c, lower, upper)
            if point is not None:
                good, omega, acceleration, needed = _judged_answer(point, self._scale, rows.p, rows.q, rows.c, box)
                if good:
                    slack = needed if self.weights.slack_is_free else max(needed, 0.0)
                    return SafetySolution(omega, acceleration, slack, backend)
            self.counts[backend + FAILED] += 1
        return self._enumerated(rows, desired_omega, desired_acceleration, box)

    def _enumerated(
        self, rows: SafetyRows, desired_omega: float, desired_acceleration: float, box: np.ndarray
    ) -> SafetySolution:
        """Return the solution by enumeration."""
        omega, acceleration, slack = least_cost_control(
            rows.p,
            rows.q,
            rows.c,
            desired_omega,
            desired_acceleration,
            self._weight_array,
            self.weights.slack_is_free,
            box,
        )
        return SafetySolution(omega, acceleration, slack, ENUMERATION)

    def _scaled_bounds(self, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both bounds over (ω, a, t), in units of the scale; the last ones again while the box is the same."""
        if box is not self._last_box:
            self._last_box = box
            self._bounds = (
                np.array([box[0] / self._scale[0], box[2] / self._scale[1], self._lowest_slack]),
                np.array([box[1] / self._scale[0], box[3] / self._scale[1], math.inf]),
            )
        return self._bounds
