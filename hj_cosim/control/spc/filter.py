"""SPC, the paper's multi-agent safety-preserving control, and the escape that it keeps."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hj_cosim.control.contract import CANNOT_JUDGE, FilterDecision
from hj_cosim.control.problem.availability import Availability
from hj_cosim.control.problem.nearest_control import NearestControl, RowsDecision, within
from hj_cosim.control.problem.safety_problem import NO_ROWS, SafetyRows
from hj_cosim.control.spc.approach import binding_rows
from hj_cosim.control.spc.conflicts import robot_answers, severity
from hj_cosim.control.spc.escape import ESCAPING, NO_ESCAPE, PASSED
from hj_cosim.control.spc.kept_escape import KeptEscape
from hj_cosim.control.spc.last_resort import LastResort
from hj_cosim.reachability.table.cars import rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import FilterSettings, RobotSettings

# Diagnostics: how often
ESCAPED = "escaped"  # the control gave way to a manoeuvre that escapes
HAD_NO_ESCAPE = "had no escape"  # it gave way to the manoeuvre that guarantees most, for none escapes
WAS_EVADED = "evaded"  # the control gave way to a manoeuvre away from who breaks a duty
WAS_CAUGHT = "caught"  # it gave way to the manoeuvre that keeps the bodies apart longest, for none does to the end
_ESCAPES: Mapping[int, Mapping[str, float]] = {ESCAPING: {ESCAPED: 1}, NO_ESCAPE: {HAD_NO_ESCAPE: 1}}


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
        self._nearest = NearestControl(settings, robot)
        self._epsilon = settings.epsilon
        self._recovery = settings.recovery
        self._approach, self._smooth = settings.approach, settings.smooth_gradient
        # Below its bound a car may need a row: ε, or any V that a look-up gives.
        self._bound = settings.epsilon if settings.approach == 0.0 else np.finfo(np.float64).max
        self._by_responsibility = settings.conflicts == "responsibility"
        self._body = (robot.length, robot.width)
        self._table = table
        self._escape = KeptEscape(table, robot, settings.epsilon, step) if settings.keep_escape else None
        self._last_resort = None
        if settings.evade and self._escape is not None:
            self._last_resort = LastResort(robot, road, self._escape.games, self._escape.numbers, step)
        self._available = Availability(settings, robot, road, (table.grid.lower[2], table.grid.upper[2]), step)

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Compile what is driven with: Ctrl-C while Numba compiles may be lost, which no step of a drive is to risk."""
        self._available.prepare()
        available = self._available.at(observation.robot)
        self._rows(observation, values, Control(0.0, 0.0), available)
        self._nearest.prepare(available)
        if self._escape is not None:
            self._escape.prepare(observation, values.value)
        if self._last_resort is not None:
            self._last_resort.prepare(observation)

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the control nearest to the desired one under which no V in K falls; see SafetyFilter."""
        available = self._available.at(observation.robot)
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
        if self._escape is not None:
            decision = self._with_a_way_out(observation, values, decision, self._escape)
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

    def _with_a_way_out(
        self, observation: Observation, values: CarValues, decision: RowsDecision, escape: KeptEscape
    ) -> RowsDecision:
        """Return the decision, or a manoeuvre's: of an escape, or of an evasion where nothing else is left.

        As long as a breach of duty is in doubt the escape comes first: no evasion may cost one that there is.
        """
        wanted, verdict = escape.keep(observation, values.value, decision.control)
        kept = decision if verdict == PASSED else _given_way(decision, wanted, _ESCAPES[verdict])
        if self._last_resort is None:
            return kept
        evasion = self._last_resort.evasion(observation, kept.control)
        if evasion is None:
            return kept
        evading = _given_way(decision, evasion.control, {WAS_CAUGHT if evasion.is_caught else WAS_EVADED: 1})
        escape_comes_first = evasion.is_in_doubt and verdict != NO_ESCAPE
        if escape_comes_first and not escape.leaves_one(observation, values.value, evading.control):
            self._last_resort.forget()
            return kept
        escape.forget()
        return evading


def _given_way(decision: RowsDecision, wanted: Control, diagnostics: Mapping[str, float]) -> RowsDecision:
    """Return the decision with a manoeuvre's control, held to what is available."""
    control = within(decision.available, wanted)
    slack = max(-float(decision.rows.margins(control.omega, control.acceleration).min(initial=0.0)), 0.0)
    diagnostics = {**decision.diagnostics, **diagnostics}
    return replace(decision, control=control, escaping=True, slack=slack, diagnostics=diagnostics)
