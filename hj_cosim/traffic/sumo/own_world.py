"""A user's own simulation as a World: their network, traffic and drivers, with the robot in one vehicle's place."""

import contextlib
import math
from pathlib import Path
from typing import Self

import numpy as np
import tomli_w

from hj_cosim.errors import NetworkError, ScenarioError, SimulationError
from hj_cosim.files import temporary_folder
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, NetworkSettings, RobotSettings, Scenario
from hj_cosim.traffic.junctions import read_junctions
from hj_cosim.traffic.road_end import RoadEnd
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.settling import robot_driver
from hj_cosim.traffic.sources.own_configuration import OwnConfiguration, copy_configuration
from hj_cosim.traffic.sumo.clocks import TwoClocks
from hj_cosim.traffic.sumo.known_drivers import known_bodies, typical_driver
from hj_cosim.traffic.sumo.our_drivers import LaneChanges, OurDrivers, write_driver_types
from hj_cosim.traffic.sumo.puppet import GHOST, ROBOT, placement, without_ghost
from hj_cosim.traffic.sumo.route_puppet import RoutePuppet
from hj_cosim.traffic.sumo.session import SUMO_ERRORS, SumoSession, libsumo, log
from hj_cosim.traffic.sumo.surroundings import Surroundings
from hj_cosim.traffic.sumo.take_over import TakeOver
from hj_cosim.traffic.sumo.warm_up import quiet, resumed, warm_up
from hj_cosim.traffic.sumo_lanes import LanePlace, SumoLanes
from hj_cosim.vehicles.idm import PARAMETER_NAMES, mean_driver

ROUTE = "robot's route"
BENDS_LOOKED_AT = 2.0  # m of s
LEAST_ROAD = 100.0  # m, before a bend that is too sharp
# What the robot's vehicle is, whatever the default type of the user's is changed to.
USUAL_TYPE = "DEFAULT_VEHTYPE"
ANY_LANE = "ignoring"  # a vehicle class that SUMO sees on every lane
# What SUMO is told over the user's configuration while the robot drives, and why.
OVERRIDDEN = {
    "lateral-resolution": ("0", "the robot is seen in whole lanes only"),
    "lanechange.duration": ("3", "lane changes are continuous"),
    "step-method.ballistic": ("true", "cars move continuously between two steps"),
    "time-to-teleport": ("-1", "nobody vanishes around the robot"),
    "collision.action": ("warn", "nobody is removed whom the robot touches"),
    "collision.mingap-factor": ("0", "only overlaps are collisions"),
}


class OwnWorld:
    """A user's traffic, each with its own driver, and the robot in it; a World, one at a time in a process.

    Attributes:
        road: the way of the vehicle that was taken over, as far as it is a road.
        predicted: what a planner may take the others for: the mean of what is known of those near at the take-over.
        told: TOML, what was chosen, overridden and silenced.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotSettings,
        seed: int,
        step: float,
        traffic_step: float,
        fastest: float | None = None,
        looks_farther: bool = False,
    ) -> None:
        """Warm the simulation up, and put the robot into a vehicle's place.

        Args:
            scenario: names the configuration, in `own`.
            robot: its body.
            seed: of SUMO, and of the choice of the vehicle.
            step: s, the robot's.
            traffic_step: s, SUMO's while the robot drives; a multiple of the robot's.
            fastest: m/s, that is planned, for which the road's bends must not be too sharp; the robot's limit unless
                given.
            looks_farther: whether `everybody` is asked for.

        Raises:
            ConfigurationError: if the configuration or a file of it cannot be read.
            NetworkError: if its network cannot be driven on.
            ScenarioError: if no vehicle can be taken over.
            SimulationError: if SUMO refuses it, or a world is open already.
        """
        self._body = robot
        self._clocks = TwoClocks(step, traffic_step)
        self._session: SumoSession | None = None
        with contextlib.ExitStack() as unless_built:
            folder = unless_built.enter_context(temporary_folder())
            unless_built.callback(self._close_session)
            self._is_driven_by_us = scenario.own.traffic == "idm-mobil"
            added = write_driver_types(folder, scenario.drivers, seed) if self._is_driven_by_us else None
            own = copy_configuration(Path(scenario.own.file), folder, added)
            self._drivers = OurDrivers(seed) if self._is_driven_by_us else None
            taken = warm_up(own, scenario, read_junctions(own.network), seed, folder, robot.length, self._drivers)
            self.road, lanes, end = _road_of(own, taken)
            place = _place_of(taken, lanes)
            start = place.start + place.scale * taken.position - robot.length
            self._end = _before_sharp_bends(self.road, robot, min(fastest or math.inf, robot.speed_max), start, end)
            self._resume(own, taken, seed)
            self._robot, self._robot_acceleration = self._take_over(taken, place), 0.0
            self._puppet = RoutePuppet(self.road, lanes, ROUTE)
            self._surroundings = Surroundings(ROBOT, GHOST, self.road, lanes, scenario.own.near, farther=looks_farther)
            self._surroundings.read()
            self._lane_changes: LaneChanges | None = None
            if self._is_driven_by_us:
                driver = robot_driver(scenario.drivers, taken.speed)
                self._lane_changes = LaneChanges(scenario.drivers, driver, robot.length, self.road, lanes)
            near = [self.vehicle_names[number] for number in self.observe().vehicle]
            self.predicted = typical_driver(near, scenario.drivers)
            self.told = _notes(own, taken, self._clocks.traffic_step, self._end, self.predicted, self._is_driven_by_us)
            self._at_the_end = unless_built.pop_all()

    def _resume(self, own: OwnConfiguration, taken: TakeOver, seed: int) -> None:
        self._session = SumoSession(without_ghost)
        words = [*resumed(own, taken, seed), *quiet(self._session.warnings_file)]
        words += ["--step-length", repr(self._clocks.traffic_step)]
        for name, (value, _) in OVERRIDDEN.items():
            words += [f"--{name}", value]
        self._session.start(words, f"{own.path} from {taken.time:g} s on", inserts=False)

    def _take_over(self, taken: TakeOver, place: LanePlace) -> np.ndarray:
        """Put the robot into the vehicle's place, at once and at its speed, and return its state (4,)."""
        for kind, names in (("vehicle", libsumo.vehicle.getIDList()), ("type", libsumo.vehicletype.getIDList())):
            if {ROBOT, GHOST} & set(names):
                raise ScenarioError(f"the simulation has a {kind} called {ROBOT!r} or {GHOST!r}; rename it")
        front = place.start + place.scale * taken.position
        along = front - 0.5 * self._body.length
        libsumo.route.add(ROUTE, taken.route)
        _make_type(self._body)
        if taken.vehicle:
            libsumo.vehicle.remove(taken.vehicle)
        libsumo.vehicle.add(ROBOT, ROUTE, ROBOT)
        libsumo.vehicle.moveTo(ROBOT, taken.lane, taken.position)
        libsumo.vehicle.setPreviousSpeed(ROBOT, taken.speed)
        return np.array([along, self.road.lane_centre(place.number, along), 0.0, taken.speed])

    @property
    def bodies(self) -> set[tuple[float, float]]:
        """Length and width (m) of the user's vehicle types, and of whoever is there with none of its own."""
        return known_bodies()

    @property
    def vehicle_names(self) -> list[str]:
        """The names, in SUMO, of those that have come near, by number; see World."""
        return self._surroundings.vehicle_names

    @property
    def drivers(self) -> np.ndarray:
        """NaN where they are theirs, whom nobody knows; see World."""
        return self._surroundings.expected_drivers if self._is_driven_by_us else self._surroundings.drivers

    def observe(self) -> Observation:
        """Return the robot and every vehicle near it; see World.observe."""
        clocks = self._clocks
        return self._surroundings.observe(clocks.time, self._robot, self._robot_acceleration, clocks.elapsed)

    def everybody(self) -> Observation:
        """Return the robot and every vehicle on its road and the ramps beside it; see WorldWithOthers."""
        clocks = self._clocks
        return self._surroundings.everybody(clocks.time, self._robot, self._robot_acceleration, clocks.elapsed)

    def settle(self, seconds: float) -> None:
        """Do nothing: the traffic has settled around the vehicle that was taken over."""

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step; see World.step, and SumoWorld.step for the two clocks."""
        self._end.require(float(robot_state[0]) + 0.5 * self._body.length, self._clocks.time)
        if self._clocks.is_traffic_due:
            end = self._clocks.robot_at_traffic_step(robot_state, self._robot, robot_acceleration, self.road)
            self._advance_traffic(end)
        self._robot, self._robot_acceleration = np.array(robot_state), float(robot_acceleration)
        self._clocks.tick()

    def _advance_traffic(self, robot_state: np.ndarray) -> None:
        """Make a step of SUMO's, with the robot where it will be at the step's end.

        Raises:
            SimulationError: if SUMO fails.
        """
        assert self._session is not None
        robot = placement(robot_state, self._body, self.road)
        now = placement(self._robot, self._body, self.road)
        is_beside = self._surroundings.is_beside(self._robot, self._body.length, (now.lane, now.second_lane))
        try:
            self._puppet.correct_speed(float(self._robot[3]))
            if self._lane_changes is not None:
                seen, on_the_road = self.observe(), self._surroundings.is_on_the_road
                self._lane_changes.request(seen, on_the_road, self.vehicle_names, now, self._clocks.traffic_step)
            self._session.expect_moves()
            self._puppet.place(robot, is_beside)
            self._session.step()
            self._puppet.after_step(float(robot_state[3]))
            if self._drivers is not None:
                self._drivers.take_those_who_departed()
            self._surroundings.read(self._clocks.traffic_step)
        except SUMO_ERRORS as error:
            raise SimulationError(
                f"SUMO failed at {self._clocks.time:.2f} s: {' '.join(str(error).split())}"
            ) from error

    def _close_session(self) -> None:
        if self._session is not None:
            self._session.close()

    def close(self) -> None:
        """End SUMO and pass its warnings on to the log.

        Raises:
            SimulationError: if SUMO fails at that.
        """
        self._at_the_end.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self.close()
        except SimulationError as failure:
            if exception[0] is None:
                raise
            log.warning("%s", failure)  # what came first tells more


def _road_of(own: OwnConfiguration, taken: TakeOver) -> tuple[Road, SumoLanes, RoadEnd]:
    """Return the vehicle's way as a road, as long as it is one, what SUMO calls its lanes, and where it ends.

    Raises:
        NetworkError: if not even the edge that the vehicle is on is a road.
    """

    def road_of(edges: tuple[str, ...]) -> tuple[Road, SumoLanes] | NetworkError:
        try:
            road, lanes = read_network(own.network, NetworkSettings(file=str(own.network), route=edges))
        except NetworkError as error:
            return error
        assert lanes is not None  # of a route there are
        return road, lanes

    behind = taken.behind
    found = road_of((*behind, *taken.edges))
    if not isinstance(found, NetworkError):
        return (*found, _end_of(found[0], taken.obstacle))
    if isinstance(road_of((*behind, taken.edges[0])), NetworkError):
        behind = ()
    enough, too_many = 0, len(taken.edges) + 1
    best, failure = None, found
    while too_many - enough > 1:
        count = (enough + too_many) // 2
        found = road_of((*behind, *taken.edges[:count]))
        if isinstance(found, NetworkError):
            too_many, failure = count, found
        else:
            enough, best = count, found
    if best is None:
        raise failure
    log.info("the road ends early: %s", failure)
    return (*best, _end_of(best[0], taken.obstacle if enough == len(taken.edges) else "road"))


def _place_of(taken: TakeOver, lanes: SumoLanes) -> LanePlace:
    place = lanes.by_name.get(taken.lane)
    if place is None or place.beside is not None:
        raise ScenarioError(
            f"the robot would begin in lane {taken.lane!r}, which its road leaves; name another vehicle with"
            " scenario.own.ego (--ego)"
        )
    return place


def _before_sharp_bends(road: Road, robot: RobotSettings, fastest: float, start: float, end: RoadEnd) -> RoadEnd:
    """Return the road's end, or the place before it where a bend takes more than the robot keeps for bends.

    Raises:
        NetworkError: if that is where the robot starts.
    """
    sharpest = min(robot.bend_rate_max / fastest, robot.bend_acceleration_max / fastest**2)
    along = np.arange(max(start, 0.0), end.along, BENDS_LOOKED_AT)
    sharp = np.flatnonzero([abs(road.curvature_at(float(place))) > sharpest for place in along])
    if not len(sharp):
        return end
    where, radius = float(along[sharp[0]]), 1.0 / abs(road.curvature_at(float(along[sharp[0]])))
    needed = (
        f"a bend of radius {radius:.0f} m, and {1.0 / sharpest:.0f} m is what the robot keeps for bends"
        f" (robot.bend_rate_max, robot.bend_acceleration_max) at {fastest:g} m/s"
    )
    if where - start < LEAST_ROAD:
        raise NetworkError(f"where the robot takes over there is {needed}; name another vehicle with --ego")
    return RoadEnd(where, "bend that is too sharp", f"there is {needed}; lower robot.speed_max")


def _end_of(road: Road, obstacle: str | None) -> RoadEnd:
    if obstacle is None:
        return RoadEnd(road.length, "end of its vehicle's route", "take over one with a longer way (--ego)")
    if obstacle == "road":
        return RoadEnd(road.length, "end of the road", "take over a vehicle with another way (--ego)")
    return RoadEnd(road.length, obstacle, "take over a vehicle with another way (--ego)")


def _make_type(body: RobotSettings) -> None:
    """Make the robot's type: its speed is not SUMO's to limit, nor do devices of the user's types apply to it."""
    kind = libsumo.vehicletype
    kind.copy(USUAL_TYPE, ROBOT)
    kind.setVehicleClass(ROBOT, ANY_LANE)
    kind.setLength(ROBOT, body.length)
    kind.setWidth(ROBOT, body.width)
    kind.setMaxSpeed(ROBOT, 1000.0)
    kind.setSpeedFactor(ROBOT, 100.0)
    kind.setSpeedDeviation(ROBOT, 0.0)
    kind.setParameter(ROBOT, "has.rerouting.device", "false")


def _notes(
    own: OwnConfiguration,
    taken: TakeOver,
    traffic_step: float,
    end: RoadEnd,
    predicted: DriverSettings,
    is_driven_by_us: bool,
) -> str:
    """Return what was chosen, overridden and silenced, a sentence each, as TOML."""
    driver = ", ".join(
        f"{name} {value:.3g}" for name, value in zip(PARAMETER_NAMES, mean_driver(predicted), strict=True)
    )
    chosen = [
        f"the robot {'takes over ' + taken.vehicle if taken.vehicle else 'is put in'} at {taken.time:g} s, in lane"
        f" {taken.lane}, at {taken.speed:.1f} m/s",
        f"its way has {len(taken.edges)} edges, {end.along:.0f} m of road, up to the {end.reason}",
        f"the planner predicts the others as MOBIL and IDM drivers by their types, on average with {driver}",
    ]
    overridden = [f"step-length {own.step:g} -> {traffic_step:g}: cars are where they are seen"]
    if is_driven_by_us:
        overridden.append("their drivers -> IDM and MOBIL: --traffic idm-mobil asks for it")
    overridden += [
        f"{name} {given} -> {value}: {why}"
        for name, (value, why) in OVERRIDDEN.items()
        if (given := own.options.get(name, "unset")) != value
    ]
    notes = {"chosen": chosen, "overridden": overridden, "silenced": list(own.silenced)}
    return tomli_w.dumps(notes, indent=2)
