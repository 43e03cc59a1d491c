"""The RSS proper response as the filter's rows, the paper's baseline."""

import math

import numpy as np

from hj_cosim.control.contract import CANNOT_JUDGE, FilterDecision
from hj_cosim.control.problem.availability import Availability
from hj_cosim.control.problem.nearest_control import NearestControl
from hj_cosim.control.problem.safety_problem import NO_ROWS, SafetyRows
from hj_cosim.control.rss.rss_rows import NEVER_SEEN, RssDistances, rss_rows
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import FilterSettings, RobotSettings

_HEADINGS = (-0.5 * math.pi, 0.5 * math.pi)  # rad; its rows are about any of them


class RssFilter:
    """Keeps the proper response to every car that is dangerous by RSS.

    Args:
        settings: scheme, the RSS parameters and the problem's.
        robot: limits and body.
        road: the lanes, beyond which it does not turn if that is asked for.
        step: s, the time for which a control is held.

    Raises:
        ConfigurationError: if the chosen backend is not installed.
    """

    def __init__(self, settings: FilterSettings, robot: RobotSettings, road: Road, step: float) -> None:
        self._nearest = NearestControl(settings, robot)
        self._available = Availability(settings, robot, road, _HEADINGS, step)
        self._distances = RssDistances.of(settings.rss)
        self._size = np.array([robot.length, robot.width])
        self._memory = np.full(64, NEVER_SEEN, dtype=np.int64)

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Compile what is driven with, and remember nothing of it."""
        self._make_room(observation.vehicle)
        rss_rows(observation.robot, self._size, observation.cars, self._distances, self._memory.copy())
        self._available.prepare()
        self._nearest.prepare(self._available.at(observation.robot))

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the control nearest to the desired one that responds properly; see SafetyFilter.

        V is not looked at. Where a car's body cannot be, nothing can be judged.
        """
        self._make_room(observation.vehicle)
        cars, rows, dangerous = rss_rows(observation.robot, self._size, observation.cars, self._distances, self._memory)
        if dangerous < 0:
            return CANNOT_JUDGE
        found = NO_ROWS
        if dangerous > 0:
            found = SafetyRows(observation.vehicle[cars], np.zeros(len(cars)), *rows)
        decision = self._nearest.choose(found, dangerous, desired, self._available.at(observation.robot))
        self._nearest.applied_omega = decision.control.omega
        return decision

    def _make_room(self, vehicle: np.ndarray) -> None:
        """Let the memory hold all numbers seen."""
        highest = int(vehicle.max(initial=-1))
        if highest >= len(self._memory):
            longer = np.full(2 * (highest + 1), NEVER_SEEN, dtype=np.int64)
            longer[: len(self._memory)] = self._memory
            self._memory = longer
