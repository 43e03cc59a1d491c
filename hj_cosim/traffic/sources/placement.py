"""Where the cars of a scenario stand, how fast they are, and who drives them, when the episode begins."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from hj_cosim.errors import ScenarioError
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings, Scenario
from hj_cosim.traffic.settling import robot_driver
from hj_cosim.traffic.sources.density import density, mean_length, mean_spacing, stream_speed
from hj_cosim.traffic.sources.kinds import CARS, draw_kinds, draw_people, kinds_of
from hj_cosim.vehicles.car import CAR_LENGTH
from hj_cosim.vehicles.idm import (
    DESIRED_SPEED,
    MINIMUM_GAP,
    equilibrium_speed,
    idm_acceleration,
    mean_driver,
    within_limits,
)

# What is left free behind the last car and the robot, so that nobody's rear sticks out of the road (m).
REAR_MARGIN = 50.0
# Nobody is put into a lane that ends within this (m): who starts at full speed could not leave it in time.
ENDING_SOON = 300.0
LOOKED_AT_EVERY = 100.0  # m of a road, for how many lanes it has; they count only up to 300 m before their end


@dataclass(frozen=True)
class InitialTraffic:
    """The J background cars and the robot at the start; road frame, centres, SI."""

    x: np.ndarray  # (J,) m
    lane: np.ndarray  # (J,) int
    speed: np.ndarray  # (J,) m/s
    drivers: np.ndarray  # (J, 6) IDM parameters in the order of vehicles.idm
    mobil: np.ndarray  # (J, 3) MOBIL's parameters in the order of vehicles.mobil
    length: np.ndarray  # (J,) m
    width: np.ndarray  # (J,) m
    robot: np.ndarray  # (4,) p_x, p_y, θ, v


def initial_traffic(scenario: Scenario, road: Road, robot: RobotSettings, seed: int) -> InitialTraffic:
    """Return the cars of `scenario`, drawn with `seed`.

    Distances from car to car are the mean spacing ± the jitter; the lane is drawn among those in which the
    rear one of two neighbours could drive at half the stream's speed, or is the emptiest one. Nobody starts
    faster than IDM holds at its gap or behind its leader, so that nobody has to brake at once. The foremost
    drawn car of a lane never drives faster than the stream: it stands for the traffic that goes on ahead,
    without which a jam would dissolve from its head. Cars that the scenario places by hand, and the robot among
    none but those, keep the speeds they are given.

    Raises:
        ScenarioError: if the cars do not fit on the road.
    """
    # Separate streams: a change in how places are drawn does not change who drives, and the other way round.
    places, people = (np.random.default_rng([seed, purpose]) for purpose in (0, 1))
    if scenario.robot.lane >= road.lane_count:
        raise ScenarioError(
            f"scenario {scenario.name}: robot.lane = {scenario.robot.lane}, but the road has lanes 0 to"
            f" {road.lane_count - 1}"
        )
    scenario = filled(scenario, road)
    kinds = kinds_of(scenario)
    drawn = scenario.traffic.count + scenario.traffic.count_behind
    kind = np.append(draw_kinds(kinds, drawn, np.random.default_rng([seed, 5])), np.full(len(scenario.cars), CARS))
    length, width = (np.array([getattr(kinds[each], name) for each in kind]) for name in ("length", "width"))
    length[drawn:], width[drawn:] = [car.length for car in scenario.cars], [car.width for car in scenario.cars]
    x, lane = _places(scenario, road, length[:drawn], places)
    drivers = draw_people(kinds, kind, people)
    wanted = places.uniform(scenario.traffic.speed_low, scenario.traffic.speed_high, drawn)
    _slow_the_foremost(x, lane, drivers, stream_speed(scenario, road.lane_count))
    for number, car in enumerate(scenario.cars, start=drawn):
        drivers[number, DESIRED_SPEED] = car.desired_speed or max(drivers[number, DESIRED_SPEED], car.speed)
    x = np.append(x, [car.x for car in scenario.cars])
    lane = np.append(lane, [car.lane for car in scenario.cars]).astype(np.int64)
    wanted = np.append(wanted, [car.speed for car in scenario.cars])
    start = REAR_MARGIN + max(0.0, -x.min(initial=0.0)) if road.is_straight else _start_on_route(scenario, road)
    _check_room(scenario, road, robot, length, x, lane, start)

    everyone = np.vstack([drivers, robot_driver(scenario.drivers, scenario.robot.speed)])
    everyone = within_limits(everyone, road.speed_limit(np.append(x, 0.0) + start))
    speed = _start_speeds(
        np.append(x, 0.0),
        np.append(lane, scenario.robot.lane),
        np.append(wanted, scenario.robot.speed),
        np.append(length, robot.length),
        everyone,
        given=np.append(np.arange(len(x)) >= drawn, scenario.is_hand_made),
    )
    robot_state = np.array([start, road.lane_centre(scenario.robot.lane, start), 0.0, speed[-1]])
    mobil = np.array([kinds[each].mobil for each in kind]).reshape(-1, 3)
    return InitialTraffic(x + start, lane, speed[:-1], drivers, mobil, length, width, robot_state)


def filled(scenario: Scenario, road: Road) -> Scenario:
    """Return the scenario itself; on a closed road, with as many cars as its density asks for, half of them ahead."""
    if not road.lap or scenario.is_hand_made:
        return scenario
    half = max(round(0.5 * road.lap / mean_spacing(scenario.traffic, road.lane_count)) - 1, 1)
    traffic = scenario.traffic.model_copy(update={"count": half, "count_behind": half})
    return scenario.model_copy(update={"traffic": traffic})


def _start_on_route(scenario: Scenario, road: Road) -> float:
    """Return where the robot starts, m of s: with room for those behind it, however they are drawn."""
    traffic = scenario.traffic
    fewest = min(_lanes_to_fill(road, float(along)) for along in np.arange(0.0, road.length, LOOKED_AT_EVERY))
    drawn = traffic.count_behind * mean_spacing(traffic, fewest) * (1.0 + traffic.spacing_jitter)
    return REAR_MARGIN + max(drawn, -min((car.x for car in scenario.cars), default=0.0))


@dataclass(frozen=True)
class _Way:
    """The road from the robot on, ahead or behind, as cars are drawn on it; x is the distance from the robot, m."""

    scenario: Scenario
    road: Road
    start: float  # m of s, the robot's
    direction: float  # 1 ahead, −1 behind

    def spacing(self, x: float) -> float:
        """Return the mean distance to the next car in whichever lane, m, among as many lanes as there are."""
        return mean_spacing(self.scenario.traffic, _lanes_to_fill(self.road, self.start + self.direction * x))

    def room(self, x: float, over: float) -> np.ndarray:
        """Return the room (lanes,), m, beside the cars placed by hand; −inf where there is no lane."""
        along = self.direction * x
        room = _room_beside(self.scenario, self.road.lane_count, along, over)
        return np.where(_lanes_that_last(self.road, self.start + along), room, -math.inf)


def _places(
    scenario: Scenario, road: Road, length: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return x relative to the robot (m) and the lane of every drawn car, of a length (m): ahead, then behind."""
    traffic, lane_count = scenario.traffic, road.lane_count
    start = 0.0 if road.is_straight else _start_on_route(scenario, road)
    least = _gap_at(0.5 * stream_speed(scenario, lane_count), mean_driver(scenario.drivers)) + CAR_LENGTH
    nearest = np.full(lane_count, -math.inf)
    # The robot has the room ahead that a car of the stream has on average: otherwise a close leader in its lane would
    # decide how the episode begins.
    here = _lanes_to_fill(road, start)
    nearest[scenario.robot.lane] = max(mean_spacing(traffic, here) * here - least, 0.0)
    over = 0.5 * (length - CAR_LENGTH)
    ahead = _one_direction(over[: traffic.count], _Way(scenario, road, start, 1.0), least, nearest, random)
    nearest = np.full(lane_count, math.inf)
    for x, lane, longer in zip(*ahead, over, strict=False):
        nearest[lane] = min(nearest[lane], x - longer)
    nearest[scenario.robot.lane] = 0.0
    behind = _one_direction(over[traffic.count :], _Way(scenario, road, start, -1.0), least, -nearest, random)
    return np.concatenate([ahead[0], -behind[0]]), np.concatenate([ahead[1], behind[1]])


def _lanes_that_last(road: Road, along: float) -> np.ndarray:
    """Return (lanes,) bool: which lanes exist at s, and go on for a while."""
    lasts = np.zeros(road.lane_count, bool)
    for lane in road.lanes_at(along):
        lasts[lane] = road.lane_end(lane, along) - along > ENDING_SOON
    return lasts


def _lanes_to_fill(road: Road, along: float) -> int:
    """Return how many lanes cars are drawn into at s: those that last, or one."""
    return max(int(np.count_nonzero(_lanes_that_last(road, along))), 1)


def _room_beside(scenario: Scenario, lane_count: int, x: float, over: float) -> np.ndarray:
    """Return (lanes,) m: how far a drawn car at x is from whom the scenario has placed by hand; `over` as below."""
    room = np.full(lane_count, math.inf)
    for car in scenario.cars:
        if car.lane < lane_count:  # `_check_room` refuses the others
            room[car.lane] = min(room[car.lane], abs(x - car.x) - over - 0.5 * (car.length - CAR_LENGTH))
    return room


def _one_direction(
    over: np.ndarray, way: _Way, least: float, nearest: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (m) from the robot, growing, and lanes.

    Args:
        over: (count,) by how much half of each is longer than half of a car, m.
        way: where they are drawn.
        least: m, from car to car in a lane.
        nearest: (lanes,) who stands there already, m.
        random: draws.
    """
    jitter = way.scenario.traffic.spacing_jitter
    shares = random.uniform(1.0 - jitter, 1.0 + jitter, len(over))
    distances, lanes = np.empty(len(over)), np.empty(len(over), dtype=np.int64)
    distance, last = 0.0, nearest.copy()
    for car, share in enumerate(shares):
        distance += way.spacing(distance) * share
        room = np.minimum(distance - over[car] - last, way.room(distance, over[car]))
        open_lanes = np.flatnonzero(room >= least)
        lane = random.choice(open_lanes) if len(open_lanes) else np.argmax(room)
        distances[car], lanes[car] = distance, lane
        last[lane] = distance + over[car]
    return distances, lanes


def _gap_at(speed: float, driver: np.ndarray) -> float:
    """Return the gap (m) at which `speed` is IDM's equilibrium speed, by bisection."""
    low, high = 0.0, 1000.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        if equilibrium_speed(middle, driver) < speed:
            low = middle
        else:
            high = middle
    return high


def _slow_the_foremost(x: np.ndarray, lane: np.ndarray, drivers: np.ndarray, speed: float) -> None:
    """Let the foremost of the drawn cars in each lane want no more than `speed` (m/s); changes `drivers`."""
    for number in np.unique(lane):
        members = np.flatnonzero(lane == number)
        foremost = members[np.argmax(x[members])]
        drivers[foremost, DESIRED_SPEED] = min(drivers[foremost, DESIRED_SPEED], max(speed, 0.1))


def _start_speeds(
    x: np.ndarray, lane: np.ndarray, wanted: np.ndarray, length: np.ndarray, drivers: np.ndarray, given: np.ndarray
) -> np.ndarray:
    """Return everyone's start speed (m/s), from the front to the back; `given` ones keep what they want."""
    speed = np.minimum(wanted, drivers[:, DESIRED_SPEED])
    order = np.argsort(-x)
    leader_of_lane: dict[int, int] = {}
    for car in order:
        leader = leader_of_lane.get(int(lane[car]))
        leader_of_lane[int(lane[car])] = car
        if leader is not None and not given[car]:
            gap = x[leader] - x[car] - 0.5 * (length[leader] + length[car])
            held = equilibrium_speed(gap, drivers[car])
            speed[car] = min(speed[car], held, _speed_without_braking(gap, speed[leader], drivers[car]))
    return speed


def _speed_without_braking(gap: float, lead_speed: float, driver: np.ndarray) -> float:
    """Return the highest speed (m/s) at which IDM does not brake behind a leader of `lead_speed`, by bisection."""
    low, high = 0.0, driver[DESIRED_SPEED]
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if idm_acceleration(middle, gap, lead_speed, driver) > 0.0:
            low = middle
        else:
            high = middle
    return low


def _check_room(
    scenario: Scenario,
    road: Road,
    robot: RobotSettings,
    length: np.ndarray,
    x: np.ndarray,
    lane: np.ndarray,
    start: float,
) -> None:
    """Refuse cars that overlap, stand closer than their minimum gap, or stand beside the road."""
    if len(lane) and lane.max() >= road.lane_count:
        raise ScenarioError(
            f"scenario {scenario.name}: a car is in lane {lane.max()}, but the road has lanes 0 to"
            f" {road.lane_count - 1}"
        )
    drawn = len(x) - len(scenario.cars)
    needed = start + max(x.max(initial=0.0), 0.0) + REAR_MARGIN
    if needed > road.length:
        raise ScenarioError(
            f"scenario {scenario.name}: its {len(x)} cars take {needed:.0f} m, but the road is {road.length:.0f} m"
            " long; take fewer cars, a higher density or a longer road"
        )
    centres, lanes = np.append(x, 0.0), np.append(lane, scenario.robot.lane)
    lengths = np.append(length, robot.length)
    minimum_gap = mean_driver(scenario.drivers)[MINIMUM_GAP]
    order = np.lexsort((centres, lanes))
    for rear, front in itertools.pairwise(order):
        gap = centres[front] - centres[rear] - 0.5 * (lengths[front] + lengths[rear])
        if lanes[rear] != lanes[front]:
            continue
        if gap <= 0.0:
            raise ScenarioError(
                f"scenario {scenario.name}: cars overlap in lane {lanes[rear]} at x = {centres[rear]:.1f} and"
                f" {centres[front]:.1f} m; place them at least {0.5 * (lengths[front] + lengths[rear]):.1f} m apart"
                if rear >= drawn or front >= drawn
                else _too_dense(scenario, road)
            )
        if gap < 0.5 * minimum_gap and rear < drawn and front < drawn:
            raise ScenarioError(_too_dense(scenario, road))


def _too_dense(scenario: Scenario, road: Road) -> str:
    here = density(scenario.traffic, road.lane_count)
    most = 1000.0 / (mean_length(scenario) + scenario.drivers.minimum_gap.mean)
    return (
        f"scenario {scenario.name}: {here:.0f} cars per km and lane do not fit (standing still, {most:.0f} do);"
        " lower traffic.density or raise traffic.spacing_factor"
    )
