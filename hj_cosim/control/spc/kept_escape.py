"""The escape in a drive: it keeps one from all cars of an observation, and remembers the manoeuvre that it drives."""

import numpy as np

from hj_cosim.control.spc.escape import NO_MANOEUVRE, PASSED, keep_escape_in_traffic, manoeuvres_for, packed_escape
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.settings import RobotSettings


class KeptEscape:
    """Gives way to a manoeuvre where a control is not known to leave an escape.

    Args:
        table: V, and the game that the manoeuvres are judged in.
        robot: its limits.
        epsilon: ε, m.
        step: s, for which a control is held.

    Raises:
        TableError: if the table's game has no manoeuvres.
    """

    def __init__(self, table: ValueTable, robot: RobotSettings, epsilon: float, step: float) -> None:
        manoeuvres = manoeuvres_for(table, robot)
        self.games = manoeuvres.games  # (classes, n), of each size class
        self.numbers = packed_escape(table, epsilon, step)
        self._arrays = (manoeuvres.heading, manoeuvres.acceleration, manoeuvres.games)
        self._driven = NO_MANOEUVRE

    def prepare(self, observation: Observation, value: np.ndarray) -> None:
        """Compile what is driven with, and remember nothing of it."""
        self._judged(observation, value, Control(0.0, 0.0))

    def keep(self, observation: Observation, value: np.ndarray, asked: Control) -> tuple[Control, int]:
        """Return the control asked for or a manoeuvre's, and the verdict of `escape.keep_escape`.

        Args:
            observation: the robot and the J cars.
            value: (J,) V of the cars, m.
            asked: the control asked for.
        """
        omega, acceleration, verdict, self._driven = self._judged(observation, value, asked)
        return (asked if verdict == PASSED else Control(omega, acceleration)), verdict

    def forget(self) -> None:
        """Remember no manoeuvre: something else is driven."""
        self._driven = NO_MANOEUVRE

    def leaves_one(self, observation: Observation, value: np.ndarray, control: Control) -> bool:
        """Return whether a control leaves an escape; nothing is driven or remembered."""
        return bool(self._judged(observation, value, control)[2] == PASSED)

    def _judged(self, observation: Observation, value: np.ndarray, asked: Control) -> tuple[float, float, int, int]:
        return keep_escape_in_traffic(
            self._arrays,
            self.numbers,
            observation.robot,
            observation.x,
            observation.y,
            observation.speed,
            observation.length,
            observation.width,
            value,
            asked.omega,
            asked.acceleration,
            self._driven,
        )
