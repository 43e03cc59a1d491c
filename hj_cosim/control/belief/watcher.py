"""Who is watched, what is believed of them, and who is suspected: the state of the belief during a drive."""

import math

import numpy as np

from hj_cosim.control.belief.hypotheses import ASSUMED, Hypotheses, prior_log_odds, watch
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import DEFAULT_DRIVERS, DriverSettings
from hj_cosim.vehicles.idm import PARAMETER_NAMES, mean_driver

PERIOD = 0.1  # s, between two looks
SUSPECTED_FROM, CLEARED_BELOW = 0.8, 0.5  # beliefs; two, so that who is suspected does not change back and forth
_ROUNDING = 1e-6  # s


class Watcher:
    """Keeps the probability of each car that its driver means harm.

    Args:
        robot_length: m.
        lane_width: m.
        drivers: what the others' parameters are drawn from; their means are what is expected of everybody where an
            observation does not tell drivers apart, and of one in the robot's place.
        of: the two hypotheses.
    """

    def __init__(
        self,
        robot_length: float,
        lane_width: float,
        drivers: DriverSettings = DEFAULT_DRIVERS,
        of: Hypotheses = ASSUMED,
    ) -> None:
        self._robot_length, self._lane_width, self._of = robot_length, lane_width, of
        self._mean_driver = mean_driver(drivers)
        self._never_seen = (prior_log_odds(of), math.nan)
        self._believed = np.empty((0, 2))
        self._suspected = np.empty(0, np.bool_)
        self._seen_at = -math.inf

    def see(self, observation: Observation) -> None:
        """Look at all cars, if it is time to; whatever the clock, ten times a second at the most."""
        if observation.time < self._seen_at + PERIOD - _ROUNDING:
            return
        self._seen_at = observation.time
        cars = observation.cars
        self._make_room(cars.vehicle)
        watch(
            observation.robot, self._robot_length, cars, observation.acceleration, self._expected(observation),
            self._lane_width, observation.time, self._believed, self._of,
        )  # fmt: skip
        belief = self._probability(cars.vehicle)
        was = self._suspected[cars.vehicle]
        self._suspected[cars.vehicle] = np.where(was, belief >= CLEARED_BELOW, belief >= SUSPECTED_FROM)

    def belief(self, vehicle: np.ndarray) -> np.ndarray:
        """Return the probability that each of some cars (J,), by number, is driven by one who means harm, (J,).

        Of a car that has not been looked at yet, such as one that entered since, it is the prior.
        """
        self._make_room(vehicle)
        return self._probability(vehicle)

    def suspected(self, vehicle: np.ndarray) -> np.ndarray:
        """Return which of some cars (J,), by number, are suspected, (J,) bool; none that has not been looked at."""
        self._make_room(vehicle)
        return np.asarray(self._suspected[vehicle])

    def _make_room(self, vehicle: np.ndarray) -> None:
        """See to it that there are rows for some cars (J,), by number."""
        if len(vehicle) == 0 or (needed := int(vehicle.max()) + 1) <= len(self._believed):
            return
        more = max(2 * needed, 16) - len(self._believed)
        self._believed = np.vstack([self._believed, np.tile(self._never_seen, (more, 1))])
        self._suspected = np.concatenate([self._suspected, np.zeros(more, np.bool_)])

    def _probability(self, vehicle: np.ndarray) -> np.ndarray:
        """Return what is believed of some cars (J,), by number, for whom there are rows, (J,)."""
        return np.asarray(1.0 / (1.0 + np.exp(-self._believed[vehicle, 0])))

    def _expected(self, observation: Observation) -> np.ndarray:
        """Return what is expected of the cars' drivers, and last of one in the robot's place, (J + 1, 6)."""
        drivers = np.empty((len(observation.x) + 1, len(PARAMETER_NAMES)))
        drivers[:] = self._mean_driver
        if observation.expected_driver is not None:
            drivers[:-1] = observation.expected_driver
        return drivers
