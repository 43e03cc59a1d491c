"""The background cars in SUMO: who is on the road, where they are, and when ours change lanes.

IDM is SUMO's, MOBIL ours. A car between two lanes is read completely; of the others, position and speed say all.
"""

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings
from hj_cosim.traffic.lane_changes import DrivingCars, wanted_lanes
from hj_cosim.traffic.sources.kinds import Kind, expected_drivers
from hj_cosim.traffic.sources.placement import InitialTraffic
from hj_cosim.traffic.sumo.between_steps import BetweenSteps, Motion
from hj_cosim.traffic.sumo.fleet_rows import FleetArrays
from hj_cosim.traffic.sumo.known_drivers import estimated_driver
from hj_cosim.traffic.sumo.places import EdgePlaces, Places, RoutePlaces, nearest_lap
from hj_cosim.traffic.sumo.puppet import Placement
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes
from hj_cosim.vehicles.idm import DESIRED_SPEED, PARAMETER_NAMES, within_limits

# setLaneChangeMode has two bits a reason (strategic, cooperative, speed gain, keep right), all 0 here, and then how
# requests are treated.
ONLY_REQUESTED_IF_SAFE = 256

# Where lanes end, SUMO's own changes out of them stay on: without them a car would stand at the end for good.
STRATEGIC = 1
# m; nobody wants a lane that ends within this, for SUMO would have it leave again at once.
LASTING = 1500.0

DECISION_PERIOD = 1.0  # s between two lane-change decisions of a car
DECISION_TURNS = 10  # a tenth of the cars decides every tenth of the period
NEVER_ITS_TURN = -1  # of who decides elsewhere: the robot, and cars that are not ours
# Nearer than this to a lane's centre line (m), a car is not between lanes; a step of a change moves it 0.03 m.
ON_CENTRE_LINE = 1e-3


class Fleet:
    """The background cars, as they were after the last step.

    Attributes:
        vehicle_names: a name for each number; see World.
    """

    def __init__(
        self,
        initial: InitialTraffic,
        names: list[str],
        robot: RobotSettings,
        robot_driver: np.ndarray,
        road: Road,
        lanes: SumoLanes | None = None,
        *,
        kinds: Sequence[Kind] = (),
        is_seen_between_steps: bool = False,
    ) -> None:
        """Take over cars that SUMO has inserted.

        Args:
            initial: where they, and the robot, are.
            names: theirs in SUMO, (J,).
            robot: its body.
            robot_driver: (6,) what the others' MOBIL takes the robot to be.
            road: the road.
            lanes: what SUMO calls its lanes, if it is a route.
            kinds: of vehicles, by which drivers are told from one another; all are cars unless given.
            is_seen_between_steps: whether the cars are observed between two steps too; SUMO has to be ballistic then.
        """
        self._places: Places = EdgePlaces(road) if lanes is None else RoutePlaces(road, lanes)
        self._kinds, self._lanes_end = kinds, lanes is not None and lanes.differ
        fastest = initial.drivers[:, DESIRED_SPEED].max(initial=robot_driver[DESIRED_SPEED])
        self._has_limits = bool(road.speed_limits(0.0, road.length)[:, 1].min() < fastest)
        self._is_seen_between_steps = is_seen_between_steps
        self._latest_step: BetweenSteps | None = None
        for name in names:
            libsumo.vehicle.setLaneChangeMode(name, ONLY_REQUESTED_IF_SAFE + STRATEGIC * self._lanes_end)
        self._road, self._known_drivers = road, initial.drivers
        self.vehicle_names, self._names = list(names), list(names)  # the second: a row's, of those on the road
        count = len(names)
        lane = np.append(initial.lane, road.lane_at(initial.robot[1], initial.robot[0]))
        self._set_rows(
            FleetArrays(
                number=np.arange(count + 1),
                turn=np.full(count + 1, NEVER_ITS_TURN),
                x=np.append(initial.x, initial.robot[0]),
                y=np.append(road.lane_centres(initial.lane, initial.x), initial.robot[1]),
                heading=np.zeros(count + 1),
                speed=np.append(initial.speed, initial.robot[3]),
                acceleration=np.zeros(count + 1),
                lane=lane,
                target_lane=lane.copy(),
                second_lane=lane.copy(),
                length=np.append(initial.length, robot.length),
                width=np.append(initial.width, robot.width),
                driver=np.vstack([initial.drivers, robot_driver]),
                mobil=np.vstack([initial.mobil, np.zeros(3)]),
            )
        )
        self._changing: list[int] = []  # rows of ours that were told to change lanes and are not done
        self._ending: list[int] = []  # rows of ours in lanes that end, out of which SUMO may take them
        self._elsewhere: list[str] = []  # vehicles in SUMO that are not to be seen from the road
        self._not_ours: list[int] = []  # rows of cars that SUMO, or a user's simulation, drives and inserts
        self._order = np.argsort(self._rows.x, kind="stable")

    def take_turns(self, random: np.random.Generator) -> None:
        """Draw when each of the cars decides about its lane."""
        count = len(self._names)
        self._rows.turn[:count] = random.permutation(count) % DECISION_TURNS

    def _set_rows(self, rows: FleetArrays) -> None:
        self._rows = rows
        self._moment: tuple[FleetArrays, Motion] | None = None
        self._front_offset = 0.5 * rows.length  # SUMO's positions are of front bumpers
        self._expected = expected_drivers(self._kinds, rows.length, rows.width, differ=self._has_limits)

    @property
    def drivers(self) -> np.ndarray:
        """The drivers by number, (len(vehicle_names), 6), NaN where they are not ours; see World."""
        unknown = np.full((len(self.vehicle_names) - len(self._known_drivers), len(PARAMETER_NAMES)), math.nan)
        return np.vstack([self._known_drivers, unknown])

    def observe(self, time: float, robot: np.ndarray, robot_acceleration: float, elapsed: float = 0.0) -> Observation:
        """Return what the robot sees.

        Args:
            time: s.
            robot: (4,) its state, in the road frame.
            robot_acceleration: m/s².
            elapsed: s since the latest step that was read began, at an instant before its end; 0 at its end.
        """
        rows = self._rows
        between = self._latest_step
        motion = self._motion() if between is None or elapsed == 0.0 else between.at(elapsed)
        cars = slice(len(motion.x))  # those that have entered in the step come last, and are there when it ends
        return Observation(
            time=time,
            robot=robot,
            robot_acceleration=robot_acceleration,
            vehicle=rows.number[cars],
            x=motion.x,
            y=motion.y,
            heading=motion.heading,
            speed=motion.speed,
            acceleration=motion.acceleration,
            lane=motion.lane,
            target_lane=rows.target_lane[cars].copy(),
            length=rows.length[cars],
            width=rows.width[cars],
            expected_driver=None if self._expected is None else self._within_limits(self._expected[cars], motion.x),
        )

    def _within_limits(self, drivers: np.ndarray, along: np.ndarray) -> np.ndarray:
        return within_limits(drivers, self._road.speed_limit(along)) if self._has_limits else drivers

    def request_lane_changes(self, turn: int, step: float) -> None:
        """Let those decide whose turn it is, and ask SUMO for the changes that they want.

        Args:
            turn: counts up, once for every tenth of the decision period.
            step: s; a request that SUMO finds unsafe in this one step is dropped, not kept.
        """
        rows = self._rows
        deciding = rows.turn == turn % DECISION_TURNS
        deciding[self._changing] = False
        minding = self._within_limits(rows.driver, rows.x)
        cars = DrivingCars(rows.x, rows.speed, rows.lane, rows.second_lane, rows.length, minding, rows.mobil)
        usable = self._road.lasting_lanes(rows.x, LASTING)
        if self._lanes_end:
            is_ending = (rows.lane < usable[:, 0]) | (rows.lane > usable[:, 1])
            self._ending = np.flatnonzero(is_ending & (rows.turn != NEVER_ITS_TURN)).tolist()
        wanted = wanted_lanes(self._order, deciding, cars, usable)
        for car in np.flatnonzero(wanted != rows.lane):
            index = self._places.index(self._names[car], int(wanted[car]))
            if index is None:
                continue  # no such lane beside that car
            libsumo.vehicle.changeLane(self._names[car], index, step)
            rows.target_lane[car] = wanted[car]
            self._changing.append(int(car))

    def correct_robot(self, state: np.ndarray, acceleration: float) -> None:
        """Take over the robot's state (4,), road frame, which was foreseen when the last step began, and its m/s²."""
        rows = self._rows
        rows.x[-1], rows.y[-1], rows.heading[-1], rows.speed[-1] = state
        rows.acceleration[-1] = acceleration

    def move_robot(self, robot: Placement) -> None:
        """Take over which lanes the robot will be in when the step ends."""
        lane = self._rows.lane, self._rows.target_lane, self._rows.second_lane
        lane[0][-1] = lane[1][-1] = robot.lane
        lane[2][-1] = robot.second_lane

    def read(
        self, robot_state: np.ndarray, robot_acceleration: float, step: float, is_car: Callable[[str], bool]
    ) -> None:
        """Read where everybody is after a step.

        Args:
            robot_state: (4,) of the robot, in the road frame.
            robot_acceleration: m/s², during the step.
            step: s.
            is_car: whether a vehicle of SUMO's is a car to be observed.
        """
        if libsumo.simulation.getArrivedNumber():
            arrived = set(libsumo.simulation.getArrivedIDList())
            self._elsewhere = [name for name in self._elsewhere if name not in arrived]
            self._forget(arrived)
        rows = self._rows
        before = (rows.number[:-1], self._motion()) if self._is_seen_between_steps else None
        x = np.empty(len(rows.x))
        x[:-1], own_speed = self._places.read(self._names, step)
        x -= self._front_offset
        x[-1] = robot_state[0]
        if self._road.lap:
            x = nearest_lap(x, self._road.lap, float(x[-1]))
        if own_speed is not None:
            speed = np.append(own_speed, 0.0)
        elif self._is_seen_between_steps:
            speed = np.append(np.fromiter(map(libsumo.vehicle.getSpeed, self._names), float, len(self._names)), 0.0)
        else:
            # SUMO moves a car by its new speed times the step, so its way is its speed: one getter a car, not two.
            speed = (x - rows.x) / step
        speed[-1] = robot_state[3]
        acceleration = (speed - rows.speed) / step
        acceleration[-1] = robot_acceleration
        rows.y[-1], rows.heading[-1] = robot_state[1], robot_state[2]
        self._rows = rows._replace(x=x, speed=speed, acceleration=acceleration)
        if own_speed is not None and np.isnan(x).any():
            self._lose(np.flatnonzero(np.isnan(x)).tolist())
        self._follow_those_in_ending_lanes()
        if self._changing:
            self._changing = [car for car in self._changing if self._read_sideways(car, step)]
        for car in self._not_ours:
            self._follow_change(car)
            self._read_sideways(car, step)
        self._correct_rows()
        if before is not None:
            self._latest_step = self._between(*before, step)
        if libsumo.simulation.getDepartedNumber():
            self._elsewhere += filter(is_car, libsumo.simulation.getDepartedIDList())
        if self._elsewhere:
            coming = [name for name in self._elsewhere if self._places.knows(name)]
            self._elsewhere = [name for name in self._elsewhere if name not in coming]
            for name in coming:
                self._admit(name, step)

    def _between(self, numbers: np.ndarray, before: Motion, step: float) -> BetweenSteps:
        """Return how the cars that are still there moved in the step that has just been read; theirs were `numbers`."""
        after = self._motion()
        if len(after.x) < len(before.x):
            stays = np.isin(numbers, self._rows.number[:-1])
            before = Motion(*(column[stays] for column in before))
        lap = self._road.lap
        if lap:  # whoever is half a lap away from the robot changes to the other side of it
            before = before._replace(x=before.x + lap * np.round((after.x - before.x) / lap))
        return BetweenSteps(before, after, step, self._road)

    def _motion(self) -> Motion:
        """Return how the cars move since the last step was read, which is copied once, whoever asks."""
        if self._moment is None or self._moment[0] is not self._rows:
            self._moment = self._rows, self._rows.motion()
        return self._moment[1]

    def is_beside_robot(self) -> bool:
        """Return whether a car lies alongside the robot in a lane that both are in: it hits that car, or crowds it."""
        return self._rows.is_beside_somebody(-1)

    def _correct_rows(self) -> None:
        """Do what is left to do when all rows have been read, and nobody has come yet."""

    def _read_sideways(self, car: int, step: float) -> bool:
        """Read a car's lane and where it is across the road; return whether it is between lanes: not done or refused.

        SUMO moves a car sideways at a constant rate and turns it about its front bumper, back again in one step
        when it arrives. Its lateral position is taken for the centre's: only so is the centre's path continuous.
        """
        name, rows, road = self._names[car], self._rows, self._road
        along = float(rows.x[car])
        lane = self._places.lane(name)
        offset = libsumo.vehicle.getLateralLanePosition(name)
        rows.lane[car] = lane
        if abs(offset) < ON_CENTRE_LINE:
            rows.y[car], rows.heading[car] = self._places.centre(name, lane, along), 0.0
            rows.target_lane[car] = rows.second_lane[car] = lane
            return False
        before, rows.y[car] = rows.y[car], self._places.centre(name, lane, along) + offset
        sideways = float(rows.y[car] - before) / step
        rows.heading[car] = self._places.heading(name, along, sideways, float(rows.speed[car]))
        # SUMO has it in both lanes from the beginning, and frees the old one once its body has left it.
        has_crossed = lane == rows.target_lane[car]
        has_left = has_crossed and abs(offset) <= 0.5 * (road.lane_width - rows.width[car])
        rows.second_lane[car] = lane if has_left else lane + (1 if offset > 0.0 else -1)
        return True

    def _follow_change(self, car: int) -> None:
        """Take a car that nobody here told to change lanes to be on its way to where it has moved in this step."""
        name, rows = self._names[car], self._rows
        lane, offset = self._places.lane(name), libsumo.vehicle.getLateralLanePosition(name)
        before = rows.y[car] - self._road.lane_centre(lane, float(rows.x[car]))
        leaves = rows.lane[car] == lane and abs(offset) > abs(before)
        rows.target_lane[car] = lane + int(np.sign(offset)) if leaves else lane

    def _follow_those_in_ending_lanes(self) -> None:
        """Notice which of ours SUMO has begun to take out of a lane that ends, and where to."""
        for car in self._ending:
            if car in self._changing:
                continue
            offset = libsumo.vehicle.getLateralLanePosition(self._names[car])
            if abs(offset) >= ON_CENTRE_LINE or self._places.lane(self._names[car]) != self._rows.lane[car]:
                self._follow_change(car)
                self._changing.append(car)

    def _lose(self, cars: list[int]) -> None:
        """Drop the rows of cars that have gone where they cannot be seen from the road; they may come back."""
        lost = [self._names[car] for car in cars]
        self._elsewhere += lost
        self._forget(lost)

    def _admit(self, name: str, step: float) -> None:
        """Add a row for a car that has entered after the beginning; a name that comes back has its number again."""
        if name not in self.vehicle_names:
            self.vehicle_names.append(name)
        vehicle, rows = libsumo.vehicle, self._rows
        lane, length = self._places.lane(name), vehicle.getLength(name)
        x = float(self._places.read([name], step)[0][0]) - 0.5 * length
        one = {"turn": NEVER_ITS_TURN, "number": self.vehicle_names.index(name), "heading": 0.0, "acceleration": 0.0}
        one |= {"x": x, "speed": vehicle.getSpeed(name), "length": length, "width": vehicle.getWidth(name)}
        one |= {"lane": lane, "target_lane": lane, "second_lane": lane, "y": self._places.centre(name, lane, x)}
        columns = {key: np.array([value]) for key, value in one.items()}
        columns |= {"driver": estimated_driver(name)[np.newaxis], "mobil": np.zeros((1, 3))}
        self._set_rows(rows.with_car(FleetArrays(**columns)))
        self._not_ours.append(len(self._names))
        self._names.append(name)
        robot = len(self._names)  # its row has moved down by one
        self._order = np.append(np.where(self._order == robot - 1, robot, self._order), robot - 1)
        self._read_sideways(robot - 1, step)

    def _forget(self, arrived: Collection[str]) -> None:
        """Drop the rows of cars that have reached the end of the road, or are out of sight."""
        stays = np.array([*(name not in arrived for name in self._names), True])
        renumbered = np.cumsum(stays) - 1
        self._changing = [int(renumbered[car]) for car in self._changing if stays[car]]
        self._ending = [int(renumbered[car]) for car in self._ending if stays[car]]
        self._not_ours = [int(renumbered[car]) for car in self._not_ours if stays[car]]
        self._names = [name for name in self._names if name not in arrived]
        self._order = renumbered[self._order[stays[self._order]]]
        self._set_rows(self._rows.only(stays))
