"""What the cars around the robot will do in the next second: IDM and MOBIL, reacting to the robot.

One action of the tree is predicted from a *scene*, the robot and the cars at one instant sorted by position:

1. in one sweep from the front to the back, every car finds the car ahead of it and decides by MOBIL whether to
   change lanes; the robot's choice is not known to anyone yet, so this is done once for all of the robot's actions;
2. the cars that the robot's actions cannot reach drive for the action's duration: the *shared* motion;
3. for each of the robot's actions, those cars drive that its motion reaches: the ones that follow it closest in a
   lane that it occupies, and whoever drives behind those.

That 2 and 3 are exact, not an approximation, is because car following looks ahead only: a car's motion depends on
the cars ahead of it, so the cars are moved one after the other from the front to the back, each through the whole
action.

A car that sees nobody ahead keeps its speed and its lane. The tree ends at the sensing range; were the road beyond
it taken for free, the foremost cars would speed up, 9 m in 3 s in dense traffic, and those behind follow them.

The kernels take few arrays of many rows rather than many arrays: it is what Numba compiles fast.
"""

import math
from typing import NamedTuple

import numpy as np

from hj_cosim.kernels import kernel
from hj_cosim.planning.optimistic.speed_limits import NO_LIMITS, slowed
from hj_cosim.vehicles.idm import driver_of, idm_acceleration
from hj_cosim.vehicles.mobil import (
    GAIN_THRESHOLD,
    NOBODY,
    POLITENESS,
    SAFE_BRAKING,
    follower_in_lane,
    following_acceleration,
    is_safe_change,
    lane_change_incentive,
)

# Rows of a scene's state, an array (5, M): a column for each of the M vehicles, in the order of their positions.
POSITION = 0  # m along the road
SPEED = 1  # m/s
LATERAL = 2  # m
LENGTH = 3  # m
WIDTH = 4  # m

# Rows of a scene's places, an array (6, M) of int64.
VEHICLE = 0  # the vehicle's number
LANE = 1  # the lane that it drives to (the robot: the lowest lane that it occupies)
SECOND_LANE = 2  # the other lane that it occupies meanwhile, else its lane again
LEADER = 3  # the column of the nearest car ahead, or NOBODY; never the robot's
FOLLOWS_IN = 4  # bit set of the lanes in which it is the nearest behind the robot
BRANCH = 5  # which of the two motions holds, SHARED or REACTING
# Typed: plain constants are literal types to Numba, which would compile the kernels that take them once for each.
SHARED = np.int64(0)
REACTING = np.int64(1)

ROBOT = 0  # the robot's number among the vehicles of a scene; the cars have 1..J

# No car brakes harder, whatever IDM asks of it; SUMO's default `emergencyDecel` of passenger cars.
HARDEST_BRAKING = 9.0  # m/s²


class PredictionModel(NamedTuple):
    """What the prediction depends on and no plan changes."""

    # What can be expected of each vehicle's driver, its IDM parameters by its number, (M, 6); the same for all unless
    # they are told apart.
    drivers: np.ndarray
    tells_apart: bool
    mobil: np.ndarray  # (3,) MOBIL's parameters
    lane_count: int
    first_lane: int  # the lanes that there are near the robot, to which others may change
    stop_lane: int  # and the one after the last of them
    lane_width: float  # m
    steps: int  # K, car-following steps in one action
    step: float  # s
    robot_lateral_speed: float  # m/s, during the robot's lane changes, as far as its heading allows
    heading_max_sine: float  # of the largest heading towards a lane
    others_lateral_speed: float  # m/s, during the others'
    speed_kept: float  # share of v − v_p that is left after one step of the tracked speed
    speed_response: float  # s
    notice_reach: float  # m, drivers notice the robot in lanes whose centre line is nearer to its centre


class Vehicles(NamedTuple):
    """The vehicles of a scene, as car following and MOBIL read them: rows (M,) of its state and its places."""

    position: np.ndarray  # m
    speed: np.ndarray  # m/s
    lane: np.ndarray  # int64
    second_lane: np.ndarray  # int64
    length: np.ndarray  # m


class Scene(NamedTuple):
    """Work space: the M = J + 1 vehicles at one instant and how they move during one action of K steps."""

    state: np.ndarray  # (5, M), rows POSITION...WIDTH
    place: np.ndarray  # (6, M) int64, rows VEHICLE...BRANCH
    motion: np.ndarray  # (2, 2, M, K + 1): SHARED or REACTING; POSITION or SPEED; vehicle; instant
    robot_motion: np.ndarray  # (3, K + 1), rows POSITION, SPEED, LATERAL
    robot_lanes: np.ndarray  # (K + 1,) int64, bit sets of the lanes in which drivers notice the robot
    nearest: np.ndarray  # (2, lanes) int64, the vehicle and the car (not the robot) seen last in each lane
    drivers: np.ndarray  # (M, 6) the model's, in the order of the scene, as MOBIL reads them
    limits: np.ndarray  # (L, 2) where speed limits begin, m ahead of the robot at the root, and they, m/s


def empty_scene(vehicles: int, steps: int, lane_count: int) -> Scene:
    """Return a scene with room for `vehicles`, the robot included, and `steps` steps."""
    return Scene(
        state=np.zeros((5, vehicles)),
        place=np.zeros((6, vehicles), np.int64),
        motion=np.zeros((2, 2, vehicles, steps + 1)),
        robot_motion=np.zeros((3, steps + 1)),
        robot_lanes=np.zeros(steps + 1, np.int64),
        nearest=np.zeros((2, lane_count), np.int64),
        drivers=np.zeros((vehicles, 6)),
        limits=NO_LIMITS,
    )


@kernel
def sort_by_position(state: np.ndarray, place: np.ndarray) -> int:
    """Sort a scene's vehicles by position and return the robot's column.

    Insertion sort: from one second to the next few cars overtake one another, so that nearly nothing moves.
    """
    robot = 0
    for column in range(state.shape[1]):
        here = column
        while here > 0 and state[POSITION, here - 1] > state[POSITION, here]:
            for row in range(state.shape[0]):
                state[row, here - 1], state[row, here] = state[row, here], state[row, here - 1]
            for row in range(LEADER):
                place[row, here - 1], place[row, here] = place[row, here], place[row, here - 1]
            here -= 1
    for column in range(state.shape[1]):
        if place[VEHICLE, column] == ROBOT:
            robot = column
    return robot


@kernel
def order_drivers(scene: Scene, model: PredictionModel) -> None:
    """Lay the drivers out as the scene's vehicles are; where all are the same, once is enough."""
    for column in range(len(scene.drivers)):
        vehicle = scene.place[VEHICLE, column]
        for parameter in range(6):
            scene.drivers[column, parameter] = model.drivers[vehicle, parameter]


@kernel
def decide_and_find_leaders(scene: Scene, robot: int, model: PredictionModel) -> None:
    """Let the cars decide on their lanes, and find the nearest car ahead of each, and who is nearest behind the robot.

    One sweep from the front to the back remembers the last vehicle seen in each lane. A car that begins to change
    lanes is in both for those behind it, so that no two take the same gap at once.
    """
    lane, second_lane = scene.place[LANE], scene.place[SECOND_LANE]
    everybody = Vehicles(scene.state[POSITION], scene.state[SPEED], lane, second_lane, scene.state[LENGTH])
    leader, follows_in = scene.place[LEADER], scene.place[FOLLOWS_IN]
    vehicles, cars = scene.nearest[0], scene.nearest[1]
    vehicles[:] = NOBODY
    cars[:] = NOBODY
    taken = 0  # the lanes in which the nearest car behind the robot has been found
    for car in range(len(lane) - 1, -1, -1):
        if car != robot:
            if lane[car] == second_lane[car] and vehicles[lane[car]] != NOBODY:
                lane[car] = wanted_lane(car, vehicles, everybody, scene, model)
            ahead, other_ahead = cars[lane[car]], cars[second_lane[car]]
            leader[car] = other_ahead if ahead == NOBODY or NOBODY < other_ahead < ahead else ahead
            follows_in[car] = 0
            if car < robot:
                lanes = (1 << lane[car]) | (1 << second_lane[car])
                follows_in[car] = lanes & ~taken
                taken |= lanes
            cars[lane[car]] = car
            cars[second_lane[car]] = car
        vehicles[lane[car]] = car
        vehicles[second_lane[car]] = car


@kernel
def wanted_lane(car: int, ahead: np.ndarray, vehicles: Vehicles, scene: Scene, model: PredictionModel) -> int:
    """Return the lane that a car drives to by MOBIL, its own where it stays.

    What a car itself would gain is seen from the vehicles ahead alone. Without politeness that is the incentive, so
    that who is behind is only looked for in lanes that are worth it.

    Args:
        car: its column.
        ahead: (lanes,) the nearest vehicle ahead of it in each lane.
        vehicles: of the scene.
        scene: with the drivers in order.
        model: the lanes, and the drivers' parameters.
    """
    mobil = model.mobil
    position, speed, lane, second_lane, length = vehicles
    here, wanted, best = lane[car], lane[car], 0.0
    now = following_acceleration(car, ahead[here], position, speed, length, scene.drivers)
    for target in (here + 1, here - 1):  # the left first: it wins a tie
        if target < model.first_lane or target >= model.stop_lane:
            continue
        if mobil[POLITENESS] == 0.0:
            after = following_acceleration(car, ahead[target], position, speed, length, scene.drivers)
            incentive = after - now - mobil[GAIN_THRESHOLD]
            behind = follower_in_lane(car, target, lane, second_lane) if incentive > best else NOBODY
            if incentive <= best or not is_safe_change(
                car, ahead[target], behind, position, speed, length, scene.drivers, mobil[SAFE_BRAKING]
            ):
                continue
        else:
            incentive = lane_change_incentive(
                car, target, position, speed, lane, second_lane, length, scene.drivers, mobil
            )
        if incentive > best:
            wanted, best = target, incentive
    return wanted


@kernel
def follow(
    car: int,
    branch: int,
    leader_branch: int,
    robot_gap: float,
    lanes: int,
    scene: Scene,
    driver: tuple[float, ...],
    step: float,
) -> None:
    """Drive one car through the action behind its leader, or behind the robot while that is nearer.

    The acceleration is held through each step and the speed stops at 0 (the ballistic update).

    Args:
        car: its column in the scene.
        branch: the motion to write, SHARED or REACTING.
        leader_branch: the motion in which its leader drives.
        robot_gap: half the lengths of the car and the robot, m.
        lanes: bit set of the lanes in which it follows the robot; 0 for none.
        scene: whose motion is written.
        driver: IDM parameters.
        step: s.
    """
    state, motion = scene.state, scene.motion
    leader = scene.place[LEADER, car]
    leader_gap = 0.5 * (state[LENGTH, leader] + state[LENGTH, car])  # not read where there is no leader
    position, speed = state[POSITION, car], state[SPEED, car]
    motion[branch, POSITION, car, 0] = position
    motion[branch, SPEED, car, 0] = speed
    for now in range(motion.shape[3] - 1):
        gap, ahead_speed = math.inf, 0.0
        if leader != NOBODY:
            gap = motion[leader_branch, POSITION, leader, now] - position - leader_gap
            ahead_speed = motion[leader_branch, SPEED, leader, now]
        if lanes & scene.robot_lanes[now]:
            to_robot = scene.robot_motion[POSITION, now] - position
            if to_robot > 0.0 and to_robot - robot_gap < gap:
                gap, ahead_speed = to_robot - robot_gap, scene.robot_motion[SPEED, now]
        acceleration = 0.0
        if gap < math.inf:
            acceleration = max(idm_acceleration(speed, gap, ahead_speed, driver), -HARDEST_BRAKING)
        if len(scene.limits) > 0:
            front = position + 0.5 * state[LENGTH, car]
            acceleration = max(slowed(acceleration, front, speed, driver, scene.limits), -HARDEST_BRAKING)
        next_speed = max(speed + acceleration * step, 0.0)
        position += 0.5 * (speed + next_speed) * step
        speed = next_speed
        motion[branch, POSITION, car, now + 1] = position
        motion[branch, SPEED, car, now + 1] = speed


@kernel
def drive_cars(scene: Scene, robot: int, occupied: int, branch: int, model: PredictionModel) -> None:
    """Drive the cars of one branch through the action, from the front to the back, and mark which branch each is in.

    Args:
        scene: with its leaders found; its motion is written.
        robot: its column.
        occupied: bit set of the lanes in which the robot is noticed: those that are occupied now for SHARED, those
            that are occupied at any instant of the action for REACTING.
        branch: which cars drive; those of the other branch are only marked.
        model: the prediction's.
    """
    place = scene.place
    # Whoever is ahead of the robot does not react to it, and has been marked when the shared motion was driven.
    first = place.shape[1] - 1 if branch == SHARED else robot - 1
    for car in range(first, -1, -1):
        if car == robot:
            continue
        leader_branch = SHARED
        if place[LEADER, car] != NOBODY:
            leader_branch = place[BRANCH, place[LEADER, car]]
        lanes = place[FOLLOWS_IN, car] & occupied
        place[BRANCH, car] = REACTING if lanes != 0 or leader_branch == REACTING else SHARED
        if place[BRANCH, car] == branch:
            robot_gap = 0.5 * (scene.state[LENGTH, car] + scene.state[LENGTH, robot])
            follow(car, branch, leader_branch, robot_gap, lanes, scene, driver_of(scene.drivers, car), model.step)


@kernel
def drive_robot(
    scene: Scene, robot: int, planned_lane: int, planned_speed: float, model: PredictionModel
) -> tuple[int, float]:
    """Drive the robot through one action.

    Its speed approaches v_p exponentially, as the tracking controller's a = K_2 (v_p − v) makes it; across the
    road it moves at a constant speed until it is on the planned lane's centre line, or, while it is too slow for that,
    at the largest heading at which it is steered towards a lane.

    Returns:
        The bit set of the lanes in which it is noticed meanwhile, and its heading at the end, rad.
    """
    target = planned_lane * model.lane_width
    position, speed, lateral = scene.state[POSITION, robot], scene.state[SPEED, robot], scene.state[LATERAL, robot]
    occupied = 0
    for now in range(model.steps + 1):
        scene.robot_motion[POSITION, now] = position
        scene.robot_motion[SPEED, now] = speed
        scene.robot_motion[LATERAL, now] = lateral
        scene.robot_lanes[now] = noticed_lanes(lateral, model)
        occupied |= scene.robot_lanes[now]
        excess = speed - planned_speed
        way = planned_speed * model.step + excess * (1.0 - model.speed_kept) * model.speed_response
        position += way
        speed = planned_speed + excess * model.speed_kept
        lateral = approach(lateral, target, min(model.robot_lateral_speed * model.step, way * model.heading_max_sine))
    across = target - scene.robot_motion[LATERAL, model.steps]
    if across == 0.0:
        return occupied, 0.0
    sideways = min(model.robot_lateral_speed, speed * model.heading_max_sine)
    return occupied, math.atan2(math.copysign(sideways, across), speed)


@kernel
def approach(value: float, target: float, distance: float) -> float:
    """Return `value` moved towards `target` by `distance`, or `target` where that is nearer."""
    return min(max(target, value - distance), value + distance)


@kernel
def noticed_lanes(lateral: float, model: PredictionModel) -> int:
    """Return the bit set of the lanes in which drivers notice a robot whose centre is at `lateral` (m)."""
    lanes = 0
    for lane in range(model.lane_count):
        if abs(lateral - lane * model.lane_width) < model.notice_reach:
            lanes |= 1 << lane
    return lanes
