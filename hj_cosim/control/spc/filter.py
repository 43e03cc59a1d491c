"""SPC, the paper's multi-agent safety-preserving control, and the escape that it keeps."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hj_cosim.control.contract import CANNOT_JUDGE, FilterDecision
from hj_cosim.control.problem.nearest_control import Grip, NearestControl, RowsDecision, limits_of
from hj_cosim.control.problem.safety_problem import NO_ROWS, SafetyRows, available_controls
from hj_cosim.control.spc.approach import binding_rows
from hj_cosim.control.spc.conflicts import robot_answers, severity
from hj_cosim.control.spc.escape import (
    ESCAPING,
    NO_ESCAPE,
    NO_MANOEUVRE,
    PASSED,
    keep_escape_in_traffic,
    manoeuvres_for,
    packed_escape,
)
from hj_cosim.control.spc.road_edge import RoadEdge
from hj_cosim.reachability.games.highway.manoeuvres import NO_MANOEUVRES
from hj_cosim.reachability.table.cars import rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import FilterSettings, RobotSettings

# Diagnostics: how often
ESCAPED = "escaped"  # the control gave way to a manoeuvre that escapes
HAD_NO_ESCAPE = "had no escape"  # it gave way to the manoeuvre that guarantees most, for none escapes
_DIAGNOSTICS: Mapping[int, Mapping[str, float]] = {ESCAPING: {ESCAPED: 1}, NO_ESCAPE: {HAD_NO_ESCAPE: 1}}


class SafetyPreservingFilter:
    """Lets no V in K fall, K being the cars with V <= ε.

    Args:
        settings: scheme, ε, the problem's parameters, and whether an escape is kept.
        robot: limits and body.
        road: the lanes, beyond which it does not turn if that is asked for.
        table: V.
        step: s, the time for which a control is held.

    Raises:
        ConfigurationError: if the chosen backend is not installed.
        TableError: if an escape is to be kept and the table's game has no manoeuvres.
    """

    def __init__(
        self, settings: FilterSettings, robot: RobotSettings, road: Road, table: ValueTable, step: float
    ) -> None:
        self._edge = RoadEdge(road, robot.length, robot.width, step) if settings.keep_on_road else None
        self._nearest = NearestControl(settings, robot)
        self._epsilon = settings.epsilon
        self._recovery = settings.recovery
        self._approach, self._smooth = settings.approach, settings.smooth_gradient
        # Below its bound a car may need a row: ε, or any V that a look-up gives.
        self._bound = settings.epsilon if settings.approach == 0.0 else np.finfo(np.float64).max
        self._by_responsibility = settings.conflicts == "responsibility"
        self._body = (robot.length, robot.width)
        self._grip = Grip(robot)
        self._step = step
        self._table = table
        self._manoeuvres = manoeuvres_for(table, robot) if settings.keep_escape else NO_MANOEUVRES
        self._escape_numbers = packed_escape(table, settings.epsilon, step)
        self._manoeuvre_arrays = (self._manoeuvres.heading, self._manoeuvres.acceleration, self._manoeuvres.games)
        self._driven = NO_MANOEUVRE
        self._limits = limits_of(robot)
        # What the bicycle turns in a step at a changing speed differs from ω step, by less than the largest of these.
        turn = robot.omega_max * step
        self._bounds = np.array([table.grid.lower[2] + turn, table.grid.upper[2] - turn, 0.0, robot.speed_max])
        # Within these, no control leads beyond the bounds in one step, and the limits themselves are available.
        self._free_heading = (self._bounds[0] + turn, self._bounds[1] - turn)
        self._free_speed = (-robot.acceleration_min * step, robot.speed_max - robot.acceleration_max * step)

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Compile what is driven with: Ctrl-C while Numba compiles may be lost, which no step of a drive is to risk."""
        available = available_controls(self._limits, 0.0, 0.0, self._bounds, self._step)
        self._rows(observation, values, Control(0.0, 0.0), available)
        self._nearest.prepare(available)
        if len(self._manoeuvres.heading) > 0:
            self._kept_escape(observation, values, Control(0.0, 0.0))

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the control nearest to the desired one under which no V in K falls; see SafetyFilter."""
        available = self._available(observation.robot)
        rows: SafetyRows | None = NO_ROWS
        if values.least <= self._bound:
            rows = self._rows(observation, values, desired, available)
        if rows is None:
            return CANNOT_JUDGE
        in_k = int(np.count_nonzero(rows.value <= self._epsilon))
        decision = self._nearest.choose(rows, in_k, desired, available)
        if self._by_responsibility and not decision.meetable:
            cars = np.array([np.flatnonzero(observation.vehicle == vehicle)[0] for vehicle in rows.vehicle])
            answers = robot_answers(observation, cars, *self._body)
            decision = self._nearest.resolve(decision, answers, severity(rows.value, self._epsilon), desired)
        if len(rows) == 0 and available is not self._limits:
            decision = replace(decision, control=_within(available, desired.omega, desired.acceleration))
        if len(self._manoeuvres.heading) > 0:
            decision = self._escaping(observation, values, decision)
        self._nearest.applied_omega = decision.control.omega
        return decision

    def _rows(
        self, observation: Observation, values: CarValues, desired: Control, available: np.ndarray
    ) -> SafetyRows | None:
        """Return the rows of the cars with V up to the bound that could bind; None where a row is not finite."""
        gradient = smooth_gradients(self._table, observation, values) if self._smooth else values.gradient
        cars, rows = rows_of_cars(self._table, observation, values.value, gradient, self._bound)
        kept, rows = binding_rows(
            rows, self._epsilon, self._recovery, self._approach, available, desired.omega, desired.acceleration
        )
        found = SafetyRows(observation.vehicle[cars[kept]], *rows)
        return found if found.are_possible else None

    def _available(self, robot: np.ndarray) -> np.ndarray:
        """Return the controls that the tyres hold and that do not lead beyond the table or the road, (4,)."""
        place = robot.tolist()
        heading, speed = place[2], place[3]
        limits = self._grip.limits_at(speed)
        if self._edge is not None:
            fastest = self._edge.speed_within(place)
            if fastest < speed + limits[3] * self._step:
                limits = limits.copy()
                limits[3] = max((fastest - speed) / self._step, limits[2])
            turn = float(limits[1])
            lowest, highest = self._edge.headings_within(place, turn)
            if not lowest + turn * self._step <= heading <= highest - turn * self._step:
                bounds = self._bounds.copy()
                bounds[0], bounds[1] = max(bounds[0], lowest), min(bounds[1], highest)
                return available_controls(limits, heading, speed, bounds, self._step)
        if (
            self._free_heading[0] <= heading <= self._free_heading[1]
            and self._free_speed[0] <= speed <= self._free_speed[1]
        ):
            return limits
        return available_controls(limits, heading, speed, self._bounds, self._step)

    def _kept_escape(
        self, observation: Observation, values: CarValues, asked: Control
    ) -> tuple[float, float, int, int]:
        """Return what `keep_escape_in_traffic` does."""
        return keep_escape_in_traffic(
            self._manoeuvre_arrays,
            self._escape_numbers,
            observation.robot,
            observation.x,
            observation.y,
            observation.speed,
            observation.length,
            observation.width,
            values.value,
            asked.omega,
            asked.acceleration,
            self._driven,
        )

    def _escaping(self, observation: Observation, values: CarValues, decision: RowsDecision) -> RowsDecision:
        """Return the decision, or a manoeuvre's where the decision's control is not known to leave an escape."""
        omega, acceleration, verdict, self._driven = self._kept_escape(observation, values, decision.control)
        if verdict == PASSED:
            return decision
        diagnostics = {**decision.diagnostics, **_DIAGNOSTICS[verdict]}
        control = _within(decision.available, omega, acceleration)
        slack = max(-float(decision.rows.margins(control.omega, control.acceleration).min(initial=0.0)), 0.0)
        return replace(decision, control=control, escaping=True, slack=slack, diagnostics=diagnostics)


def _within(available: np.ndarray, omega: float, acceleration: float) -> Control:
    """Return a control held to what is available, (4,)."""
    return Control(min(max(omega, available[0]), available[1]), min(max(acceleration, available[2]), available[3]))
