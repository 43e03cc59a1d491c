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
        self._evader = self._on_road(0.0) if road.is_straight else None
        self._evader_numbers = packed(self._on_road(0.0))
        self._driven = NO_SHIFT

    def prepare(self, observation: Observation) -> None:
        """Compile what is driven with, and remember nothing of it."""
        evader = self._on_road_here(observation)
        cars, _ = self._cars(evader, observation)
        evade(evader, _motion(observation), cars, Held(0.0, 0.0, self._step), NO_SHIFT)

    def evasion(self, observation: Observation, asked: Control) -> Evasion | None:
        """Return what to do instead of what is asked for, None where that may pass."""
        evader = self._on_road_here(observation)
        cars, gravest = self._cars(evader, observation)
        if len(cars) == 0:
            self._driven = NO_SHIFT
            return None
        held = Held(asked.omega, asked.acceleration, self._step)
        control, verdict, self._driven = evade(evader, _motion(observation), cars, held, self._driven)
        if verdict == PASSED:
            return None
        return Evasion(Control(control.omega, control.acceleration), verdict == CAUGHT, gravest < BREAKS)

    def _cars(self, evader: Evader, observation: Observation) -> tuple[np.ndarray, int]:
        numbers = self._evader_numbers if evader is self._evader else packed(evader)
        cars, gravest = cars_to_evade(
            numbers, observation.robot, observation.cars, observation.acceleration, self._games, self._numbers
        )
        return cars, int(gravest)

    def _on_road_here(self, observation: Observation) -> Evader:
        return self._evader or self._on_road(float(observation.robot[0]))

    def _on_road(self, along: float) -> Evader:
        """Return the robot, with where its centre stays across the road."""
        lines = self._road.lane_lines(along)
        return Evader.of(self._robot, float(lines[0]) + self._beside, float(lines[-1]) - self._beside)


def _motion(observation: Observation) -> Motion:
    return Motion(*observation.robot.tolist())
