"""Who is watched, what is believed of them, and who is suspected: the state of the belief during a drive."""

import math

import numpy as np

from hj_cosim.control.belief.hypotheses import ASSUMED, Hypotheses, watch
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import DriverSettings
from hj_cosim.vehicles.idm import mean_driver

PERIOD = 0.1  # s, between two looks
SUSPECTED_FROM, CLEARED_BELOW = 0.8, 0.5  # beliefs; two, so that who is suspected does not change back and forth
_ROUNDING = 1e-6  # s


class Watcher:
    """Keeps the probability of each car that its driver means harm.

    Args:
        robot_length: m.
        lane_width: m.
        of: the two hypotheses.
    """

    def __init__(self, robot_length: float, lane_width: float, of: Hypotheses = ASSUMED) -> None:
        self._robot_length, self._lane_width, self._of = robot_length, lane_width, of
        self._driver = mean_driver(DriverSettings())
        self._believed = np.empty((0, 2))
        self._suspected = np.empty(0, np.bool_)
        self._seen_at = -math.inf

    def see(self, observation: Observation) -> None:
        """Look at all cars, if it is time to; whatever the clock, ten times a second at the most."""
        if observation.time < self._seen_at + PERIOD - _ROUNDING:
            return
        self._seen_at = observation.time
        cars = observation.cars
        needed = int(cars.vehicle.max(initial=-1)) + 1
        if needed > len(self._believed):
            more = max(2 * needed, 16) - len(self._believed)
            never = np.column_stack([np.zeros(more), np.full(more, np.nan)])
            self._believed = np.vstack([self._believed, never])
            self._suspected = np.concatenate([self._suspected, np.zeros(more, np.bool_)])
        watch(
            observation.robot, self._robot_length, cars, observation.acceleration, self._driver, self._lane_width,
            observation.time, self._believed, self._of,
        )  # fmt: skip
        belief = self.belief(cars.vehicle)
        was = self._suspected[cars.vehicle]
        self._suspected[cars.vehicle] = np.where(was, belief >= CLEARED_BELOW, belief >= SUSPECTED_FROM)

    def belief(self, vehicle: np.ndarray) -> np.ndarray:
        """Return the probability that each of some cars (J,), by number, is driven by one who means harm, (J,)."""
        return np.asarray(1.0 / (1.0 + np.exp(-self._believed[vehicle, 0])))

    def suspected(self, vehicle: np.ndarray) -> np.ndarray:
        """Return which of some cars (J,), by number, are suspected, (J,) bool."""
        return np.asarray(self._suspected[vehicle])
