"""Our drivers in a user's simulation, IDM and MOBIL as in our own scenarios, in the place of theirs.

Every vehicle keeps its body, its route, and the speed that it desires: its top speed and its factor of the lane's
limit. It follows by IDM with parameters drawn from the scenario's drivers, from the warm-up on. Those near the robot
change lanes by MOBIL, and by SUMO's strategic rules where their way asks for it; those who are not seen from the robot
as SUMO has them.
"""

import contextlib
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings
from hj_cosim.traffic.lane_changes import DrivingCars, wanted_lanes
from hj_cosim.traffic.sources.kinds import draw_drivers
from hj_cosim.traffic.sumo.fleet import DECISION_PERIOD, DECISION_TURNS, LASTING, ONLY_REQUESTED_IF_SAFE, STRATEGIC
from hj_cosim.traffic.sumo.input import vehicle_type
from hj_cosim.traffic.sumo.puppet import Placement
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes
from hj_cosim.vehicles.mobil import mobil_parameters

PEOPLE = 100  # different drivers, among whom each vehicle gets one
TYPE = "hj-cosim_driver_"  # what their types' names begin with
LANE_CHANGING = (("lcOvertakeRight", "1"), ("lcKeepRight", "0"))  # as `input.vehicle_type` has them
AS_SUMO_HAS_THEM = 1621  # setLaneChangeMode, where nothing else was asked for
TURN_TOLERANCE = 1e-6  # of a turn: a step's beginning is the turn's in spite of rounding
IN_ITS_LANE = 1e-3  # m, nearer to its centre line a vehicle is not between lanes
_ANY_BODY = (5.0, 2.0)  # m; each vehicle keeps its own


def write_driver_types(folder: Path, drivers: DriverSettings, seed: int) -> Path:
    """Write the types of PEOPLE drivers, as an additional file for SUMO.

    Args:
        folder: where to.
        drivers: what they are drawn from.
        seed: of the draw.
    """
    path = folder / "drivers.add.xml"
    people = draw_drivers(drivers, PEOPLE, np.random.default_rng([seed, 5]))
    types = [vehicle_type(f"{TYPE}{number}", driver, 1000.0, _ANY_BODY) for number, driver in enumerate(people)]
    path.write_text("\n".join(["<additional>", *types, "</additional>"]), encoding="utf-8")
    return path


class OurDrivers:
    """Gives each vehicle of a simulation one of our drivers when it departs."""

    def __init__(self, seed: int) -> None:
        """Begin.

        Args:
            seed: of who gets which driver.
        """
        self._random = np.random.default_rng([seed, 6])

    def take_the_wheel(self, names: Iterable[str]) -> None:
        """Put one of our drivers into each of these vehicles that has none."""
        vehicle = libsumo.vehicle
        for name in names:
            if vehicle.getTypeID(name).startswith(TYPE):
                continue
            body = vehicle.getLength(name), vehicle.getWidth(name)
            fastest, factor = vehicle.getMaxSpeed(name), vehicle.getSpeedFactor(name)
            kind = vehicle.getVehicleClass(name)
            vehicle.setType(name, f"{TYPE}{int(self._random.integers(PEOPLE))}")
            vehicle.setLength(name, body[0])
            vehicle.setWidth(name, body[1])
            vehicle.setMaxSpeed(name, fastest)
            vehicle.setSpeedFactor(name, factor)
            vehicle.setVehicleClass(name, kind)
            # Which a change of its type leaves as they were; the models SL2015 and DK2008 have no such rules.
            with contextlib.suppress(libsumo.TraCIException):
                for parameter, value in LANE_CHANGING:
                    vehicle.setParameter(name, f"laneChangeModel.{parameter}", value)

    def take_those_who_departed(self) -> None:
        """Do so with those who came in SUMO's last step."""
        if libsumo.simulation.getDepartedNumber():
            self.take_the_wheel(libsumo.simulation.getDepartedIDList())


class LaneChanges:
    """MOBIL for the vehicles that are seen from the robot."""

    def __init__(
        self, drivers: DriverSettings, robot_driver: np.ndarray, robot_length: float, road: Road, lanes: SumoLanes
    ) -> None:
        """Begin with nobody.

        Args:
            drivers: MOBIL's parameters.
            robot_driver: (6,) what the others' MOBIL takes the robot to be.
            robot_length: m.
            road: the lanes.
            lanes: what SUMO calls them.
        """
        self._mobil = mobil_parameters(drivers.politeness, drivers.gain_threshold, drivers.safe_braking)
        self._robot_driver, self._robot_length = robot_driver, robot_length
        self._road, self._lanes = road, lanes
        self._turns_taken = 0
        self._ours: dict[int, str] = {}  # those whose lane changes SUMO leaves to us, by number

    # Five parameters: who is there, and how long SUMO has for it.
    def request(
        self, seen: Observation, is_on_the_road: np.ndarray, names: Sequence[str], robot: Placement, step: float
    ) -> None:
        """Let those decide whose turn it is, a tenth of them every tenth of a second, and ask SUMO for what they want.

        Args:
            seen: at the end of SUMO's last step.
            is_on_the_road: (J,) bool, who of them is in a lane of the road and not beside it.
            names: in SUMO, by number.
            robot: where it is.
            step: s; a request that SUMO finds unsafe in this one step is dropped, not kept.
        """
        self._take_over({number: names[number] for number in seen.vehicle.tolist()})
        here = np.flatnonzero(is_on_the_road)
        numbers, lane, x = seen.vehicle[here], seen.lane[here], seen.x[here]
        offset = seen.y[here] - self._road.lane_centres(lane, x)
        is_between = np.abs(offset) > IN_ITS_LANE
        second = np.where(is_between, lane + np.where(offset > 0.0, 1, -1), lane)
        assert seen.expected_driver is not None  # of a user's simulation there is
        cars = DrivingCars(
            np.append(x, seen.robot[0]),
            np.append(seen.speed[here], seen.robot[3]),
            np.append(lane, robot.lane),
            np.append(second, robot.second_lane),
            np.append(seen.length[here], self._robot_length),
            np.vstack([seen.expected_driver[here], self._robot_driver]),
            np.tile(self._mobil, (len(here) + 1, 1)),
        )
        turns_due = math.floor(seen.time * DECISION_TURNS / DECISION_PERIOD + TURN_TOLERANCE) + 1
        turns = np.arange(self._turns_taken, turns_due) % DECISION_TURNS
        self._turns_taken = turns_due
        deciding = np.append(np.isin(numbers % DECISION_TURNS, turns) & ~is_between, False)
        order = np.argsort(cars.position, kind="stable")
        wanted = wanted_lanes(order, deciding, cars, self._road.lasting_lanes(cars.position, LASTING))
        for car in np.flatnonzero(wanted[:-1] != lane).tolist():
            self._ask(names[numbers[car]], int(wanted[car]), step)

    def _take_over(self, near: dict[int, str]) -> None:
        """Leave the lane changes of those who are near to MOBIL, and those of who was near to SUMO."""
        for number in near.keys() - self._ours.keys():
            libsumo.vehicle.setLaneChangeMode(near[number], ONLY_REQUESTED_IF_SAFE + STRATEGIC)
        left = self._ours.keys() - near.keys()
        there = set(libsumo.vehicle.getIDList()) if left else set()
        for number in left:
            if self._ours[number] in there:
                libsumo.vehicle.setLaneChangeMode(self._ours[number], AS_SUMO_HAS_THEM)
        self._ours = near

    def _ask(self, name: str, lane: int, step: float) -> None:
        """Ask SUMO for a lane change, if the vehicle may use that lane, and its way goes on from there."""
        index = self._lanes.index_on(libsumo.vehicle.getRoadID(name), lane)
        if index is None:
            return
        for where, usable, _, offset, _, _ in libsumo.vehicle.getBestLanes(name):
            if where.endswith(f"_{index}"):
                leads_on = offset == 0 or usable - libsumo.vehicle.getLanePosition(name) > LASTING
                if leads_on and _admits(where, libsumo.vehicle.getVehicleClass(name)):
                    libsumo.vehicle.changeLane(name, index, step)


def _admits(lane: str, kind: str) -> bool:
    allowed = libsumo.lane.getAllowed(lane)
    return kind in allowed or (not allowed and kind not in libsumo.lane.getDisallowed(lane))
