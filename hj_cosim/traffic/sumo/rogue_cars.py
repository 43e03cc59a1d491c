"""The rogues' cars in SUMO: ordinary cars until they begin, then moved from outside, as the robot is."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hj_cosim.plugin_answers import called, is_number, shown_answer, wrong_answer
from hj_cosim.plugins import plugin_name
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings, RogueSettings
from hj_cosim.traffic.rogues.catalogue import ChosenRogue, make_behaviour
from hj_cosim.traffic.rogues.contract import Behaviour, BehaviourInputs, CarInput, RogueView, ValuesOfCars
from hj_cosim.traffic.rogues.restraint import OwnCar, moved, ordinary_input, restrained
from hj_cosim.traffic.sumo.puppet import Puppet, placement
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo.shared_fleet import Moved, SharedFleet
from hj_cosim.vehicles.idm import DESIRED_SPEED

TOP_SPEED = 1000.0  # m/s; SUMO would cap the speed that it takes from a moved car's way
ROAD_LEFT = 10.0  # m of road ahead, with less of which a moved car is taken away
LANE_LEFT = 300.0  # m before its lane's end, where nobody begins


@dataclass(frozen=True)
class _Body:
    length: float  # m
    width: float


@dataclass
class _Rogue:
    """One of them."""

    name: str  # in SUMO
    number: int  # as World has it
    reference: str
    behaviour: Behaviour
    driver: np.ndarray  # (6,) IDM parameters, of when it drives as others do
    puppet: Puppet | None = None  # None until it begins
    speed: float = field(default=0.0)  # m/s, at the end of the last step


class RogueCars:
    """All rogues of a world.

    Attributes:
        roles: what each of them does, by its car's name.
    """

    def __init__(
        self,
        chosen: tuple[ChosenRogue, ...],
        fleet: SharedFleet,
        make_puppet: Callable[[str], Puppet],
        road: Road,
        robot: RobotSettings,
        settings: RogueSettings,
        values: ValuesOfCars | None,
    ) -> None:
        """Put a rogue into each chosen car.

        Args:
            chosen: who.
            fleet: the cars, by the numbers that `chosen` has.
            make_puppet: makes a puppet of a car by its name.
            road: the lanes.
            robot: its body and limits.
            settings: when they begin, and what their cars can.
            values: the robot's V; None where there is no table.

        Raises:
            ConfigurationError, PluginError: if a behaviour cannot be made.
        """
        self._fleet, self._make_puppet, self._road = fleet, make_puppet, road
        self._robot, self._settings = robot, settings
        self._rogues = []
        for each in chosen:
            random = np.random.default_rng(each.seed)
            inputs = BehaviourInputs(None, settings.limits, robot, road, random, values)
            behaviour = make_behaviour(each.behaviour, settings, inputs)
            name, driver = fleet.vehicle_names[each.car], fleet.drivers[each.car]
            self._rogues.append(_Rogue(name, each.car, each.behaviour, behaviour, driver))
        self.roles: Mapping[str, str] = {rogue.name: plugin_name(rogue.reference) for rogue in self._rogues}

    def place(self, observation: Observation, step: float) -> None:
        """Tell SUMO, and the fleet, where those that have begun are to be when the next step ends.

        Args:
            observation: now; its cars are in the fleet's order.
            step: s.

        Raises:
            PluginError: if a behaviour fails, or answers what nobody can do.
        """
        if not self._rogues:
            return
        index = {int(number): row for row, number in enumerate(observation.vehicle)}
        self._rogues = [rogue for rogue in self._rogues if rogue.number in index]
        for rogue in self._rogues:
            if rogue.puppet is None and self._begins(rogue, index[rogue.number], observation):
                self._take_over(rogue)
        active = [rogue for rogue in self._rogues if rogue.puppet is not None]
        for rogue in active:
            accomplices = tuple(index[other.number] for other in active if other.reference == rogue.reference)
            self._move(rogue, index[rogue.number], accomplices, observation, step)

    def _begins(self, rogue: _Rogue, row: int, observation: Observation) -> bool:
        """Return whether a rogue begins now; one that is changing lanes ends that first."""
        x, y = float(observation.x[row]), float(observation.y[row])
        is_near = abs(x - float(observation.robot[0])) <= self._settings.within
        if observation.time < self._settings.after or not is_near or self._fleet.is_changing(rogue.name):
            return False
        is_at_the_end = self._is_at_the_end(x, float(observation.length[row]))
        return self._road.lane_end(self._road.lane_at(y, x), x) - x > LANE_LEFT and not is_at_the_end

    def _is_at_the_end(self, x: float, length: float) -> bool:
        return self._road.length - x - 0.5 * length < ROAD_LEFT

    def _take_over(self, rogue: _Rogue) -> None:
        libsumo.vehicle.setMaxSpeed(rogue.name, TOP_SPEED)
        rogue.puppet = self._make_puppet(rogue.name)
        self._fleet.hand_over(rogue.name)

    def _move(
        self, rogue: _Rogue, row: int, accomplices: tuple[int, ...], observation: Observation, step: float
    ) -> None:
        assert rogue.puppet is not None
        car, limits = OwnCar(row, rogue.driver), self._settings.limits
        ordinary = ordinary_input(observation, car, self._road, self._robot.length)
        desired_speed = float(rogue.driver[DESIRED_SPEED])
        view = RogueView(observation, row, accomplices, self._road, self._robot.length, desired_speed, ordinary)
        wanted = _asked(rogue.behaviour, view) or ordinary
        wanted = restrained(wanted, observation, car, self._road, limits)
        columns = (observation.x, observation.y, observation.heading, observation.speed)
        state = np.array([float(column[row]) for column in columns])
        rogue.puppet.correct_speed(float(state[3]))
        state, acceleration = moved(state, wanted, limits, step)
        if self._is_at_the_end(float(state[0]), float(observation.length[row])):
            self._take_away(rogue)
            return
        placed = placement(state, _Body(float(observation.length[row]), float(observation.width[row])), self._road)
        rogue.puppet.place(placed, self._fleet.is_beside_somebody(rogue.name))
        rogue.speed = float(state[3])
        self._fleet.move(rogue.name, Moved(state, acceleration, placed))

    def _take_away(self, rogue: _Rogue) -> None:
        assert rogue.puppet is not None
        rogue.puppet.remove()
        self._fleet.take_away(rogue.name)
        self._rogues = [other for other in self._rogues if other is not rogue]

    def after_step(self) -> None:
        """Give those that were moved the speeds that they have."""
        for rogue in self._rogues:
            if rogue.puppet is not None:
                rogue.puppet.after_step(rogue.speed)


def _asked(behaviour: Behaviour, view: RogueView) -> CarInput | None:
    """Return what a behaviour answers.

    Raises:
        PluginError: if it raises something of its own, writes into what it sees, or answers what is no input.
    """
    answer = called(behaviour, "act", view, watched=[view.observation])
    if answer is None:
        return None
    if not isinstance(answer, CarInput) or not all(is_number(wanted) and math.isfinite(wanted) for wanted in answer):
        raise wrong_answer(behaviour, "act", f"{shown_answer(answer)}; a CarInput of finite numbers, or None, is right")
    return answer
