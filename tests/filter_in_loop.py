"""A safety filter asked as the loop asks it: V is looked up first, and the filter is guarded."""

from collections import Counter

from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import FilterDecision
from hj_cosim.control.guard import GuardedFilter
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.settings import FilterSettings, RobotSettings

ROBOT = RobotSettings()
ROAD = StraightRoad(lane_count=4)
STEP = 0.02


class FilterInLoop:
    def __init__(
        self, settings: FilterSettings, table: ValueTable, robot: RobotSettings = ROBOT, road: Road = ROAD
    ) -> None:
        self._table = table
        self._guarded = GuardedFilter(make_filter(settings, robot, road, table, STEP), robot)
        self._is_prepared = False

    @property
    def counts(self) -> Counter[str]:
        return self._guarded.counts

    def filter(self, observation: Observation, desired: Control) -> FilterDecision:
        values = car_values(self._table, observation)
        if values.is_known and not self._is_prepared:
            self._guarded.prepare(observation, values)
            self._is_prepared = True
        return self._guarded.filter(observation, values, desired)
