"""The traffic in SUMO as a World: a session, the fleet of background cars, and the robot as a puppet."""

import contextlib
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np

from hj_cosim.errors import SimulationError
from hj_cosim.files import naming_the_place
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import RobotSettings, Scenario
from hj_cosim.traffic.road_end import require_road
from hj_cosim.traffic.rogues.catalogue import choose_rogues
from hj_cosim.traffic.rogues.contract import ValuesOfCars
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sources.kinds import kinds_of
from hj_cosim.traffic.sources.placement import InitialTraffic, initial_traffic
from hj_cosim.traffic.sources.scenarios import network_path
from hj_cosim.traffic.sources.streams import drawn_streams
from hj_cosim.traffic.sumo.clocks import TwoClocks
from hj_cosim.traffic.sumo.fleet import DECISION_PERIOD, DECISION_TURNS
from hj_cosim.traffic.sumo.input import ROUTE, RobotVehicle, command_line, write_routes
from hj_cosim.traffic.sumo.puppet import ROBOT, Puppet, is_ghost, placement, without_ghost
from hj_cosim.traffic.sumo.rogue_cars import RogueCars
from hj_cosim.traffic.sumo.route_puppet import RoutePuppet
from hj_cosim.traffic.sumo.session import SUMO_ERRORS, SumoSession, libsumo, log
from hj_cosim.traffic.sumo.shared_fleet import SharedFleet

TURN_TOLERANCE = 1e-6  # of a turn: a step's beginning is the turn's in spite of rounding


class SumoWorld:
    """SUMO's IDM traffic with MOBIL lane changes of our own, a World; one at a time in a process.

    The cars of the scenario are all there from the beginning. Others that enter SUMO later are observed too; they
    change lanes as SUMO has them, and nobody knows their drivers.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotSettings,
        seed: int,
        step: float = 0.02,
        scenario_folder: Path | None = None,
        traffic_step: float | None = None,
        values: ValuesOfCars | None = None,
    ):
        """Start SUMO and put everyone in place.

        Args:
            scenario: what to build.
            robot: its body.
            seed: of places, drivers, the turns of decisions, and SUMO.
            step: s, the robot's.
            scenario_folder: where the scenario's file lies, to find its network beside it.
            traffic_step: s, SUMO's, a multiple of the robot's; the same unless given.
            values: the robot's V of all cars, for rogues that ask for it.

        Raises:
            NetworkError: if the network is missing or not a straight road.
            ScenarioError: if the cars do not fit.
            SimulationError: if a world is open already, or SUMO does not start.
        """
        self._clocks = TwoClocks(step, step if traffic_step is None else traffic_step)
        self._body = robot
        self._is_hand_made = scenario.is_hand_made
        self._robot_driver = robot_driver(scenario.drivers, scenario.robot.speed)
        self._turns_taken = 0
        self._session = SumoSession(without_ghost)
        with contextlib.ExitStack() as unless_built:
            unless_built.callback(self._session.close)
            network = network_path(scenario.network, scenario_folder)
            self.road, self._lanes = read_network(network, scenario.network)
            initial = initial_traffic(scenario, self.road, robot, seed)
            names = self._start(scenario, network, initial, seed)
            self._robot, self._robot_acceleration = initial.robot.copy(), 0.0
            is_finer = self._clocks.ratio > 1  # the robot's clock than SUMO's
            self._fleet = SharedFleet(
                initial,
                names,
                robot,
                self._robot_driver,
                self.road,
                self._lanes,
                kinds=kinds_of(scenario),
                is_seen_between_steps=is_finer,
            )
            self._fleet.take_turns(np.random.default_rng([seed, 2]))
            edge = scenario.network.edge
            self._puppet = self._made_puppet(edge)
            chosen = choose_rogues(scenario, len(names) - len(scenario.cars), seed)
            self._rogues = RogueCars(
                chosen, self._fleet, partial(self._made_puppet, edge), self.road, robot, scenario.rogues, values
            )
            unless_built.pop_all()

    def _start(self, scenario: Scenario, network: Path, initial: InitialTraffic, seed: int) -> list[str]:
        """Start SUMO with the cars and the robot at their places, and return the cars' names."""
        digits = len(str(max(len(initial.x) - 1, 0)))
        names = [f"car_{number:0{digits}}" for number in range(len(initial.x))]
        x, y = initial.robot[:2]
        robot = RobotVehicle(ROBOT, self._body.length, self._body.width, self.road.lane_at(y, x), self._robot_driver)
        routes = self._session.folder / "traffic.rou.xml"
        with naming_the_place(routes):
            if self._lanes is None:
                write_routes(routes, scenario.network.edge, initial, names, robot)
            else:
                streams = drawn_streams(scenario, seed)
                departure = self._lanes.departure
                write_routes(routes, self._lanes.route, initial, names, robot, departure, streams, minds_limits=True)
        warnings, looks = self._session.warnings_file, scenario.traffic.check_collisions
        words = command_line(network, routes, warnings, self._clocks.traffic_step, seed, looks)
        if self._clocks.ratio > 1:
            words += ["--step-method.ballistic", "true"]
        self._session.start(words, f"scenario {scenario.name} on {network}")
        inserted = libsumo.vehicle.getIDCount() - 1
        if inserted != len(names):
            raise SimulationError(
                f"SUMO inserted {inserted} of the {len(names)} cars of scenario {scenario.name} on {network};"
                " its log tells why"
            )
        return names

    def _made_puppet(self, edge: str, name: str = ROBOT) -> Puppet:
        if self._lanes is None:
            return Puppet(self.road, edge, ROUTE, name)
        return RoutePuppet(self.road, self._lanes, ROUTE, name)

    @property
    def rogues(self) -> Mapping[str, str]:
        """What the rogues among the cars do, by their names; see WorldWithRogues."""
        return self._rogues.roles

    @property
    def vehicle_names(self) -> list[str]:
        """The cars' names in SUMO, by number; see World."""
        return self._fleet.vehicle_names

    @property
    def drivers(self) -> np.ndarray:
        """The cars' IDM parameters, by number; see World."""
        return self._fleet.drivers

    def observe(self) -> Observation:
        """Return the robot and every background car on the road; see World.observe."""
        clocks = self._clocks
        return self._fleet.observe(clocks.time, self._robot, self._robot_acceleration, clocks.elapsed)

    def settle(self, seconds: float) -> None:
        """Let the traffic run with the robot following its lane, then set the clock to 0; see World.settle.

        A scene made by hand is left as it was made. The robot has the traffic's clock meanwhile.
        """
        for _ in range(0 if self._is_hand_made else round(seconds / self._clocks.traffic_step)):
            state, acceleration = follow_lane(
                self.observe(), self._robot_driver, self.road, self._body.length, self._clocks.traffic_step
            )
            require_road(self.road, placement(state, self._body, self.road).along, self._clocks.time)
            self._advance_traffic(state, acceleration, rogues_begin=False)
            self._robot, self._robot_acceleration = state, acceleration
            self._clocks.tick_of_traffic()
        self._clocks.reset()
        self._turns_taken = 0

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step; see World.step.

        SUMO's own step, which may be several of the robot's, is made when the first of these is: all that others do in
        it, they do by what they see at its beginning. Where the robot will be at its end is foreseen.
        """
        front = float(robot_state[0]) + 0.5 * self._body.length * math.cos(robot_state[2])
        require_road(self.road, front, self._clocks.time)
        if self._clocks.is_traffic_due:
            end = self._clocks.robot_at_traffic_step(robot_state, self._robot, robot_acceleration, self.road)
            self._advance_traffic(end, robot_acceleration)
        self._robot, self._robot_acceleration = np.array(robot_state), float(robot_acceleration)
        self._clocks.tick()

    def _advance_traffic(
        self, robot_state: np.ndarray, robot_acceleration: float, *, rogues_begin: bool = True
    ) -> None:
        """Make a step of SUMO's, with the robot where it will be at the step's end.

        SUMO moves the other cars by the states of the step before, and only then puts the robot where
        moveToXY wants it: so everything is asked for before the step, and read after it.

        Raises:
            SimulationError: if SUMO fails.
        """
        robot = placement(robot_state, self._body, self.road)
        try:
            if self._clocks.ratio > 1:
                self._fleet.correct_robot(self._robot, self._robot_acceleration)
                self._puppet.correct_speed(float(self._robot[3]))
            is_beside_somebody = self._fleet.is_beside_robot()
            self._request_lane_changes()
            self._session.expect_moves()
            if rogues_begin and self._rogues.roles:
                self._rogues.place(self.observe(), self._clocks.traffic_step)
            self._puppet.place(robot, is_beside_somebody)
            self._session.step()
            self._puppet.after_step(float(robot_state[3]))
            self._rogues.after_step()
            self._fleet.move_robot(robot)
            self._fleet.read(robot_state, robot_acceleration, self._clocks.traffic_step, _is_car)
        except SUMO_ERRORS as error:
            raise SimulationError(f"SUMO failed at {self._clocks.time:.2f} s: {error}") from error

    def _request_lane_changes(self) -> None:
        """Let those change lanes who have decided to since the last step; a turn is a tenth of a decision's period."""
        turns_due = math.floor(self._clocks.time * DECISION_TURNS / DECISION_PERIOD + TURN_TOLERANCE) + 1
        for turn in range(self._turns_taken, turns_due):
            self._fleet.request_lane_changes(turn, self._clocks.traffic_step)
        self._turns_taken = turns_due

    def close(self) -> None:
        """End SUMO and pass its warnings on to the log.

        Raises:
            SimulationError: if SUMO fails at that.
        """
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self.close()
        except SimulationError as failure:
            if exception[0] is None:
                raise
            log.warning("%s", failure)  # what came first tells more


def _is_car(vehicle: str) -> bool:
    """Return whether a vehicle of SUMO's is somebody else than the robot."""
    return vehicle != ROBOT and not is_ghost(vehicle)
