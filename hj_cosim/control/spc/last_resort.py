"""The evasion in a drive: it sees who breaks a duty, and remembers the manoeuvre that it drives."""

from typing import NamedTuple

import numpy as np

from hj_cosim.control.spc.duty_breakers import cars_to_evade
from hj_cosim.control.spc.evasion import CAUGHT, NO_SHIFT, PASSED, Evader, Held, Motion, evade
from hj_cosim.reachability.games.highway.breach import BREAKS
from hj_cosim.reachability.packing import packed
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings

BESIDE_LINE = 0.3  # m, of a body from the road's edge, so that it can turn away from there without its tail beyond it


class Evasion(NamedTuple):
    """A manoeuvre's control."""

    control: Control  # not held to what is available
    is_caught: bool  # it keeps the bodies apart longest, but not to the end
    is_in_doubt: bool  # whether somebody breaks a duty; what V promises may still hold


class LastResort:
    """Gives way to a manoeuvre where a car breaks a duty and nothing else is left.

    Args:
        robot: limits and body.
        road: the lanes, beyond which no manoeuvre leads.
        games: (classes, n) of `Manoeuvres.games`, which say what the duties are.
        numbers: (classes, n) of `packed_escape`, which say what bodies belong to which.
        step: s, the time for which a control is held.
    """

    def __init__(self, robot: RobotSettings, road: Road, games: np.ndarray, numbers: np.ndarray, step: float) -> None:
        self._robot, self._road, self._games, self._numbers, self._step = robot, road, games, numbers, step
        self._beside = 0.5 * robot.width + BESIDE_LINE
        self._everywhere = self._evader_at(0.0) if road.is_straight else None
        self._driven = NO_SHIFT

    def prepare(self, observation: Observation) -> None:
        """Compile what is driven with, and remember nothing of it."""
        evader, cars, _ = self._seen(observation)
        evade(evader, _motion(observation), cars, Held(0.0, 0.0, self._step), NO_SHIFT)

    def evasion(self, observation: Observation, asked: Control) -> Evasion | None:
        """Return what to do instead of what is asked for, None where that may pass; `forget` it if it is not done."""
        evader, cars, gravest = self._seen(observation)
        if len(cars) == 0:
            self._driven = NO_SHIFT
            return None
        held = Held(asked.omega, asked.acceleration, self._step)
        control, verdict, self._driven = evade(evader, _motion(observation), cars, held, self._driven)
        if verdict == PASSED:
            return None
        return Evasion(Control(control.omega, control.acceleration), verdict == CAUGHT, gravest < BREAKS)

    def forget(self) -> None:
        """Remember no manoeuvre: the last one is not driven after all."""
        self._driven = NO_SHIFT

    def _seen(self, observation: Observation) -> tuple[Evader, np.ndarray, int]:
        """Return the robot, the cars that count, and the gravest breach, as of `cars_to_evade`."""
        evader, packed_evader = self._everywhere or self._evader_at(float(observation.robot[0]))
        cars, gravest = cars_to_evade(
            packed_evader, observation.robot, observation.cars, observation.acceleration, self._games, self._numbers
        )
        return evader, cars, int(gravest)

    def _evader_at(self, along: float) -> tuple[Evader, np.ndarray]:
        """Return the robot with where its centre stays across the road, and the same packed."""
        lines = self._road.lane_lines(along)
        evader = Evader.of(self._robot, float(lines[0]) + self._beside, float(lines[-1]) - self._beside)
        return evader, packed(evader)


def _motion(observation: Observation) -> Motion:
    return Motion(*observation.robot.tolist())
