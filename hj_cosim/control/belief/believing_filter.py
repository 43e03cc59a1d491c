"""SPC that assumes the worst of the cars that it suspects, and of the others what the table's game does."""

from dataclasses import replace
from functools import cache

import numpy as np

from hj_cosim.control.belief.watcher import Watcher
from hj_cosim.control.contract import FilterDecision
from hj_cosim.control.problem.nearest_control import RowsDecision
from hj_cosim.control.problem.safety_problem import SafetyRows
from hj_cosim.control.spc.approach import binding_rows
from hj_cosim.control.spc.filter import SafetyPreservingFilter
from hj_cosim.reachability.table.cars import car_values, rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import DEFAULT_DRIVERS, DriverSettings, FilterSettings, RobotSettings

WORST_TABLE = "highway_worst"  # of value_tables/: against anything that a car's limits allow
SUSPECTS = "suspected cars"  # diagnostics: how many, summed over the drive


@cache
def _worst_table(robot: RobotSettings) -> ValueTable:
    """Return the table against the worst, solved first if it has not been; once a process."""
    return load_table(WORST_TABLE, robot=robot)


class BelievingFilter(SafetyPreservingFilter):
    """SPC whose rows about suspected cars are those of the game against the worst, wherever that gives them less V.

    Mostly it does, but not at all states: the two games differ in more than what they assume of the other car, in how
    far the robot's body reaches when turned, say. A suspected car has the smaller of the two V, with the slopes and the
    row of the table that it is from: so its V is nowhere above what it would be if nobody suspected it, and where that
    is <= ε it has a row. A car that becomes suspected where V against the worst is <= ε already gets a row all the
    same, that V does not fall further.

    Args:
        settings, robot, table, step: as of SafetyPreservingFilter.
        road: its lanes are those that ordinary drivers keep to, besides.
        drivers: what ordinary drivers' parameters are drawn from, where an observation does not tell drivers apart.
    """

    def __init__(
        self,
        settings: FilterSettings,
        robot: RobotSettings,
        road: Road,
        table: ValueTable,
        step: float,
        drivers: DriverSettings = DEFAULT_DRIVERS,
    ) -> None:
        super().__init__(settings, robot, road, table, step)
        self._worst = _worst_table(robot)
        self._weight = settings.suspect_weight
        self._watcher = Watcher(robot.length, road.lane_width, drivers)
        self._suspected = np.empty(0, np.bool_)  # (J,) which cars are, at the instant that is filtered
        self._by_worst = np.empty(0, np.bool_)  # (J,) of which of them V is that against the worst

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Compile; see SafetyPreservingFilter."""
        super().prepare(observation, values)
        Watcher(1.0, 1.0, DEFAULT_DRIVERS).see(observation)
        car_values(self._worst, observation)

    def belief(self, observation: Observation) -> np.ndarray:
        """Return the probability of each car that its driver means harm, (J,), as of the last look."""
        return self._watcher.belief(observation.vehicle)

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the control nearest to the desired one under the rows of all cars; see SafetyFilter."""
        self._watcher.see(observation)
        self._suspected = self._watcher.suspected(observation.vehicle)
        belief = self._watcher.belief(observation.vehicle)
        if not self._suspected.any():
            return replace(super().filter(observation, values, desired), belief=belief)
        decision = super().filter(observation, self._assumed(observation, values), desired)
        diagnostics = {**decision.diagnostics, SUSPECTS: float(self._suspected.sum())}
        slack = self._unweighted_slack(observation, decision)
        return replace(decision, belief=belief, slack=slack, diagnostics=diagnostics)

    def _assumed(self, observation: Observation, values: CarValues) -> CarValues:
        """Return the values with those of the suspected cars against the worst where these are smaller, or the same."""
        worst = car_values(self._worst, observation)
        self._by_worst = self._suspected & (worst.value <= values.value)
        value = np.where(self._by_worst, worst.value, values.value)
        gradient = np.where(self._by_worst[:, None], worst.gradient, values.gradient)
        nearest = int(np.argmin(value))
        return CarValues(value, gradient, float(value[nearest]), nearest)

    def _rows(
        self, observation: Observation, values: CarValues, desired: Control, available: np.ndarray
    ) -> SafetyRows | None:
        if not self._suspected.any():
            return super()._rows(observation, values, desired, available)
        found = []
        for table, which in ((self._table, ~self._by_worst), (self._worst, self._by_worst)):
            of_these = replace(values, value=np.where(which, values.value, np.inf))
            gradient = smooth_gradients(table, observation, of_these) if self._smooth else values.gradient
            found.append(rows_of_cars(table, observation, of_these.value, gradient, self._bound))
        cars = np.concatenate([found[0][0], found[1][0]])
        rows = np.hstack([found[0][1], found[1][1]])
        kept, bound = binding_rows(
            rows, self._epsilon, self._recovery, self._approach, available, desired.omega, desired.acceleration
        )
        value, p, q, c = bound
        # What a row is missed by counts as often as its weight says where all cannot be met.
        weight = np.where(self._suspected[cars[kept]], self._weight, 1.0)
        rows_found = SafetyRows(observation.vehicle[cars[kept]], value, weight * p, weight * q, weight * c)
        return rows_found if rows_found.are_possible else None

    def _unweighted_slack(self, observation: Observation, decision: FilterDecision) -> float:
        """Return by how much the rows are missed, m/s, as they were before they were weighed; SW may be negative.

        So the slack of a record means the same with and without belief.
        """
        if not isinstance(decision, RowsDecision) or len(decision.rows) == 0:
            return decision.slack
        is_suspected = np.isin(decision.rows.vehicle, observation.vehicle[self._suspected])
        margins = decision.rows.margins(decision.control.omega, decision.control.acceleration)
        missed = -float((margins / np.where(is_suspected, self._weight, 1.0)).min())
        return missed if decision.slack < 0.0 else max(0.0, missed)
