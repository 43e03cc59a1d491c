"""The traffic in SUMO, through libsumo; the only file that calls it, knows its bit sets and the order of its calls."""

import contextlib
import io
import logging
import math
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Self

import numpy as np

with contextlib.redirect_stdout(io.StringIO()) as _libsumo_says:
    # It prints a note about the version of pyarrow, which would spoil what --json prints.
    import libsumo

from hj_cosim.errors import SimulationError
from hj_cosim.files import naming_the_place, temporary_folder
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import RobotSettings, Scenario
from hj_cosim.traffic.lane_changes import wanted_lanes
from hj_cosim.traffic.network import read_road
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sources.placement import CAR_LENGTH, CAR_WIDTH, InitialTraffic, initial_traffic
from hj_cosim.traffic.sources.scenarios import network_path
from hj_cosim.traffic.sumo.input import command_line, write_routes
from hj_cosim.vehicles.mobil import mobil_parameters

ROBOT = "robot"
# A robot that straddles two lanes is seen in one of them only; this invisible second one is seen in the other.
GHOST = "robot's ghost"

# setSpeedMode: bits 0 to 4 are the checks for safe speed, acceleration, deceleration, right of way and red lights;
# bit 5 alone leaves the speed to us.
SPEED_IS_OURS = 32
# setLaneChangeMode: two bits a reason (strategic, cooperative, speed gain, keep right), then how requests are treated.
NO_LANE_CHANGES = 0
ONLY_REQUESTED_IF_SAFE = 256
# moveToXY: exactly there, also off the lanes' centre lines and off the road.
KEEP_EXACT_POSITION = 2

DECISION_PERIOD = 1.0  # s between two lane-change decisions of a car (SPEC section 4)
DECISION_TURNS = 10  # a tenth of the cars decides every tenth of the period
# Nearer than this to a lane's centre line (m), a car is not between lanes; a step of a change moves it 0.03 m.
ON_CENTRE_LINE = 1e-3

log = logging.getLogger(__name__)
if _libsumo_says.getvalue():
    log.info("libsumo: %s", " ".join(_libsumo_says.getvalue().split()))


@contextlib.contextmanager
def _stderr_into(path: Path) -> Iterator[None]:
    """Send what this process, C++ included, writes to stderr into a file."""
    with path.open("wb") as file:
        terminal = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)


def _without_ghost(lines: Sequence[str]) -> Iterator[str]:
    """Yield SUMO's warnings with the ghost called what it stands for; those of the robot and its ghost are left out."""
    for line in lines:
        told = line.replace(GHOST, ROBOT)
        if told == line or set(re.findall(r"[Vv]ehicle '([^']*)'", told)) != {ROBOT}:
            yield told


class SumoWorld:
    """SUMO's IDM traffic with MOBIL lane changes of our own; one at a time in a process.

    A car between two lanes is read completely; of the others, position and speed say all.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotSettings,
        seed: int,
        step: float = 0.02,
        scenario_folder: Path | None = None,
    ):
        """Start SUMO and put everyone in place.

        Args:
            scenario: what to build.
            robot: its body.
            seed: of places, drivers, the turns of decisions, and SUMO.
            step: s.
            scenario_folder: where the scenario's file lies, to find its network beside it.

        Raises:
            NetworkError: if the network is missing or not a straight road.
            ScenarioError: if the cars do not fit.
            SimulationError: if a world is open already, or SUMO does not start.
        """
        if libsumo.isLoaded():
            raise SimulationError("a SUMO world is open in this process already; close it first")
        network = network_path(scenario.network, scenario_folder)
        self.road = read_road(network, scenario.network.edge)
        initial = initial_traffic(scenario, self.road, robot, seed)
        digits = len(str(max(len(initial.x) - 1, 0)))
        self.vehicle_names: Sequence[str] = [f"car_{number:0{digits}}" for number in range(len(initial.x))]
        self.drivers = initial.drivers
        self._robot_body = robot
        self._robot_driver = robot_driver(scenario.drivers, scenario.robot.speed)
        self._edge = scenario.network.edge
        self._step = step
        self._is_hand_made = scenario.is_hand_made
        self._check_collisions = scenario.traffic.check_collisions
        self._mobil = mobil_parameters(
            scenario.drivers.politeness, scenario.drivers.gain_threshold, scenario.drivers.safe_braking
        )
        self._at_the_end = contextlib.ExitStack()
        folder = self._at_the_end.enter_context(temporary_folder())
        self._sumo_log = folder / "sumo.log"
        self._errors = folder / "errors.log"
        self._moves_wait = False
        with contextlib.ExitStack() as unless_started:
            unless_started.callback(self.close)
            self._start(scenario.name, network, initial, seed)
            unless_started.pop_all()
        self._take_stock(initial, seed)

    def _start(self, scenario: str, network: Path, initial: InitialTraffic, seed: int) -> None:
        routes = self._sumo_log.with_name("traffic.rou.xml")
        robot = self._robot_body
        with naming_the_place(routes):
            write_routes(
                routes, self._edge, initial, self.vehicle_names, self._robot_driver, ROBOT, robot.length, robot.width,
                self.road.lane_at(initial.robot[1]),
            )  # fmt: skip
        try:
            with _stderr_into(self._errors):  # what SUMO finds wrong is told by our own error
                libsumo.start(command_line(network, routes, self._sumo_log, self._step, seed, self._check_collisions))
                libsumo.simulationStep()  # time 0: everyone is inserted, nobody has moved
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            reason = self._first_error() or " ".join(str(error).split())
            raise SimulationError(f"SUMO cannot run scenario {scenario} on {network}: {reason}") from error
        inserted = libsumo.vehicle.getIDCount() - 1
        if inserted != len(self.vehicle_names):
            raise SimulationError(
                f"SUMO inserted {inserted} of the {len(self.vehicle_names)} cars of scenario {scenario}"
                f" on {network}; its log tells why"
            )
        for name in self.vehicle_names:
            libsumo.vehicle.setLaneChangeMode(name, ONLY_REQUESTED_IF_SAFE)
        libsumo.vehicle.setLaneChangeMode(ROBOT, NO_LANE_CHANGES)
        libsumo.vehicle.setSpeedMode(ROBOT, SPEED_IS_OURS)

    def _take_stock(self, initial: InitialTraffic, seed: int) -> None:
        """Set up the arrays: a row per car on the road, and a last one for the robot."""
        count = len(self.vehicle_names)
        self._time = 0.0
        self._steps = 0
        self._turn_steps = max(round(DECISION_PERIOD / DECISION_TURNS / self._step), 1)
        turns = np.random.default_rng([seed, 2]).permutation(count) % DECISION_TURNS
        self._turn = np.append(turns, -1)  # the robot decides elsewhere
        self._names = list(self.vehicle_names)
        self._number = np.arange(count)
        self._x = np.append(initial.x, initial.robot[0])
        self._y = np.append(initial.lane * self.road.lane_width, initial.robot[1])
        self._heading = np.zeros(count + 1)
        self._speed = np.append(initial.speed, initial.robot[3])
        self._acceleration = np.zeros(count + 1)
        self._lane = np.append(initial.lane, self.road.lane_at(initial.robot[1]))
        self._target_lane = self._lane.copy()
        self._second_lane = self._lane.copy()
        self._length = np.append(np.full(count, CAR_LENGTH), self._robot_body.length)
        self._front_offset = 0.5 * self._length  # SUMO's positions are of front bumpers
        self._contact_distance = 0.5 * (self._length[:-1] + self._length[-1])  # between the robot's centre and theirs
        self._width = np.append(np.full(count, CAR_WIDTH), self._robot_body.width)
        self._all_drivers = np.vstack([self.drivers, self._robot_driver])
        self._order = np.argsort(self._x, kind="stable")
        self._changing: list[int] = []
        self._robot = initial.robot.copy()
        self._has_ghost = self._has_new_ghost = False
        self._is_beside_somebody = False  # in a lane of its own
        self._lane_in_sumo: dict[str, int] = {}  # of the vehicles that we move

    def observe(self) -> Observation:
        """Return the robot and every background car on the road; see World.observe."""
        return Observation(
            time=self._time,
            robot=self._robot,
            robot_acceleration=float(self._acceleration[-1]),
            vehicle=self._number,
            x=self._x[:-1],
            y=self._y[:-1].copy(),
            heading=self._heading[:-1].copy(),
            speed=self._speed[:-1],
            acceleration=self._acceleration[:-1],
            lane=self._lane[:-1].copy(),
            target_lane=self._target_lane[:-1].copy(),
            length=self._length[:-1],
            width=self._width[:-1],
        )

    def settle(self, seconds: float) -> None:
        """Let the traffic run with the robot following its lane, then set the clock to 0; see World.settle.

        A scene made by hand is left as it was made.
        """
        for _ in range(0 if self._is_hand_made else round(seconds / self._step)):
            state, acceleration = follow_lane(
                self.observe(), self._robot_driver, self.road, self._robot_body.length, self._step
            )
            self.step(state, acceleration)
        self._steps = 0
        self._time = 0.0

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step; see World.step.

        SUMO moves the other cars by the states of the step before, and only then puts the robot where
        moveToXY wants it: so everything is asked for before the step, and read after it.
        """
        try:
            self._request_lane_changes()
            self._moves_wait = True
            self._place_robot(robot_state)
            libsumo.simulationStep()
            self._moves_wait = False
            if self._has_new_ghost:  # it has made no way yet, and would stand in its followers' eyes
                libsumo.vehicle.setPreviousSpeed(GHOST, float(robot_state[3]))
            self._steps += 1
            self._time = self._steps * self._step
            self._read_cars(robot_state, robot_acceleration)
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed at {self._time:.2f} s: {error}") from error

    def _request_lane_changes(self) -> None:
        turn, steps_into_turn = divmod(self._steps, self._turn_steps)
        if steps_into_turn:
            return
        deciding = self._turn == turn % DECISION_TURNS
        deciding[self._changing] = False
        wanted = wanted_lanes(
            self._order,
            deciding,
            self._x,
            self._speed,
            self._lane,
            self._second_lane,
            self._length,
            self._all_drivers,
            self._mobil,
            self.road.lane_count,
        )
        for car in np.flatnonzero(wanted != self._lane):
            # A request that SUMO finds unsafe in this one step is dropped, not kept.
            libsumo.vehicle.changeLane(self._names[car], int(wanted[car]), self._step)
            self._target_lane[car] = wanted[car]
            self._changing.append(int(car))

    def _place_robot(self, state: np.ndarray) -> None:
        """Tell SUMO where the robot is to be when the step ends, in its lane and, straddling, in the next one."""
        x, y, heading, _ = state.tolist()
        road, body = self.road, self._robot_body
        lane = road.lane_at(y)
        offset = y - road.lane_centre(lane)
        # To SUMO a vehicle is where its front is, which crosses a line before the centre does.
        front = y + 0.5 * body.length * math.sin(heading)
        lane_of_front = road.lane_at(front)
        neighbour = lane_of_front if lane_of_front != lane else lane + (1 if offset > 0.0 else -1)
        reaches_over = abs(offset) + 0.5 * body.width > 0.5 * road.lane_width and 0 <= neighbour < road.lane_count
        straddles = reaches_over or lane_of_front != lane
        along = x + 0.5 * body.length * math.cos(heading)
        if along > road.length:
            raise SimulationError(
                f"the robot reached the end of the road ({road.length:.0f} m) after {self._time:.2f} s;"
                " take a longer road or a shorter simulation.duration"
            )
        self._lane[-1] = self._target_lane[-1] = lane
        self._second_lane[-1] = neighbour if straddles else lane
        self._move(ROBOT, lane_of_front, along, front, heading)
        if straddles:
            if not self._has_ghost:
                libsumo.vehicle.add(GHOST, "road", ROBOT)
                libsumo.vehicle.setLaneChangeMode(GHOST, NO_LANE_CHANGES)
                libsumo.vehicle.setSpeedMode(GHOST, SPEED_IS_OURS)
            other_lane = neighbour if lane_of_front == lane else lane
            self._move(GHOST, other_lane, along, road.lane_centre(other_lane), 0.0)
        elif self._has_ghost:
            libsumo.vehicle.remove(GHOST)
            del self._lane_in_sumo[GHOST]
        self._has_new_ghost = straddles and not self._has_ghost
        self._has_ghost = straddles

    def _move(self, name: str, lane: int, along: float, lateral: float, heading: float) -> None:
        """Put the middle of a vehicle's front bumper at a place in the road frame."""
        if self._lane_in_sumo.get(name, lane) != lane:
            # Otherwise it goes on blocking the lane that it came from.
            self._put_into_lane(name, lane)
        elif name in self._lane_in_sumo and self._is_beside_somebody:
            # SUMO keeps a lane's vehicles in the order in which they came in: had the robot passed this car, those
            # behind would follow the robot, through the car. Only from another lane is it put where it belongs.
            self._put_into_lane(name, lane + 1 if lane == 0 else lane - 1)
            self._put_into_lane(name, lane)
        self._lane_in_sumo[name] = lane
        x, y, direction = self.road.to_world(along, lateral, heading)
        angle = 90.0 - math.degrees(direction)
        libsumo.vehicle.moveToXY(name, self._edge, lane, x, y, angle, KEEP_EXACT_POSITION)

    def _put_into_lane(self, name: str, lane: int) -> None:
        """Set a vehicle into a lane of SUMO's where it is: SUMO takes its speed from the way it makes in the step."""
        libsumo.vehicle.moveTo(name, f"{self._edge}_{lane}", libsumo.vehicle.getLanePosition(name))

    def _read_cars(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        if libsumo.simulation.getArrivedNumber():
            self._forget(set(libsumo.simulation.getArrivedIDList()))
        x = np.empty(len(self._x))
        x[:-1] = np.fromiter(map(libsumo.vehicle.getLanePosition, self._names), float, len(self._names))
        x -= self._front_offset
        x[-1] = robot_state[0]
        # SUMO moves a car by its new speed times the step, so its way is its speed: one getter a car, not two.
        speed = (x - self._x) / self._step
        speed[-1] = robot_state[3]
        self._acceleration = (speed - self._speed) / self._step
        self._acceleration[-1] = robot_acceleration
        self._x, self._speed = x, speed
        self._robot = np.array(robot_state)
        self._y[-1], self._heading[-1] = robot_state[1], robot_state[2]
        if self._changing:
            self._changing = [car for car in self._changing if self._read_changing(car)]
        self._is_beside_somebody = self._has_somebody_beside_it()

    def _has_somebody_beside_it(self) -> bool:
        """Return whether a car lies alongside the robot in a lane that both are in: it hits that car, or crowds it."""
        beside = np.flatnonzero(np.abs(self._x[:-1] - self._x[-1]) < self._contact_distance)
        lanes = {int(self._lane[-1]), int(self._second_lane[-1])}
        return any(not lanes.isdisjoint((int(self._lane[car]), int(self._second_lane[car]))) for car in beside)

    def _read_changing(self, car: int) -> bool:
        """Read where a car is that was told to change lanes; return whether it is between lanes: not done or refused.

        SUMO moves a car sideways at a constant rate and turns it about its front bumper, back again in one step
        when it arrives. Its lateral position is taken for the centre's: only so is the centre's path continuous.
        """
        name = self._names[car]
        lane = libsumo.vehicle.getLaneIndex(name)
        offset = libsumo.vehicle.getLateralLanePosition(name)
        self._lane[car] = lane
        if abs(offset) < ON_CENTRE_LINE:
            self._y[car], self._heading[car] = self.road.lane_centre(lane), 0.0
            self._target_lane[car] = self._second_lane[car] = lane
            return False
        self._y[car] = self.road.lane_centre(lane) + offset
        angle = math.radians(90.0 - libsumo.vehicle.getAngle(name))
        self._heading[car] = math.remainder(angle - self.road.heading, math.tau)
        # SUMO has it in both lanes from the beginning, and frees the old one once its body has left it.
        has_crossed = lane == self._target_lane[car]
        has_left = has_crossed and abs(offset) <= 0.5 * (self.road.lane_width - self._width[car])
        self._second_lane[car] = lane if has_left else lane + (1 if offset > 0.0 else -1)
        return True

    def _forget(self, arrived: set[str]) -> None:
        """Drop the rows of cars that have reached the end of the road."""
        stays = np.array([name not in arrived for name in [*self._names, ROBOT]])
        renumbered = np.cumsum(stays) - 1
        self._changing = [int(renumbered[car]) for car in self._changing if stays[car]]
        self._names = [name for name in self._names if name not in arrived]
        self._number = self._number[stays[:-1]]
        self._contact_distance = self._contact_distance[stays[:-1]]
        self._order = renumbered[self._order[stays[self._order]]]
        for name in ("_turn", "_x", "_y", "_heading", "_speed", "_acceleration", "_lane", "_target_lane",
                     "_second_lane", "_length", "_front_offset", "_width", "_all_drivers"):  # fmt: skip
            setattr(self, name, getattr(self, name)[stays])

    def _first_error(self) -> str:
        """Return the first thing that SUMO complained of while starting, in one line; empty if there is none."""
        lines = self._errors.read_text(encoding="utf-8", errors="replace").splitlines()
        return lines[0].removeprefix("Error: ") if lines else ""

    def close(self) -> None:
        """End SUMO and pass its warnings on to the log.

        Raises:
            SimulationError: if SUMO fails at that.
        """
        with self._at_the_end:
            try:
                if libsumo.isLoaded():
                    if self._moves_wait:
                        # What moveToXY asked for outlives SUMO's end, and the next world of this process would fall
                        # over a vehicle that is gone (segmentation fault): so it is carried out first.
                        libsumo.simulationStep()
                    libsumo.close()
            except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
                raise SimulationError(f"SUMO failed at its end: {error}") from error
            if self._sumo_log.is_file():
                for line in _without_ghost(self._sumo_log.read_text(encoding="utf-8", errors="replace").splitlines()):
                    log.warning("SUMO: %s", line)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self.close()
        except SimulationError as failure:
            if exception[0] is None:
                raise
            log.warning("%s", failure)  # what came first tells more
