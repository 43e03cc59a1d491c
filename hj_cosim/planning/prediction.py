"""What the cars around the robot will do in the next second: IDM and MOBIL, reacting to the robot.

One action of the tree is predicted from a *scene*, the robot and the cars at one instant sorted by position:

1. every car decides by MOBIL whether to change lanes; the robot's choice is not known to anyone yet, so this is
   done once for all of the robot's actions;
2. the car ahead of each car is found in one sweep from the front to the back;
3. all cars drive for the action's duration as if the robot were not there: the *shared* motion;
4. for each of the robot's actions, only the cars that its motion can reach drive again: those that follow it
   closest in a lane that it occupies, and whoever drives behind those.

Step 4 is exact, not an approximation, because car following looks ahead only: a car's motion depends on the cars
ahead of it, so the cars are moved one after the other from the front to the back, each through the whole action.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.vehicles.idm import idm_acceleration
from hj_cosim.vehicles.mobil import NOBODY, lane_change_incentive

ROBOT = 0  # the robot's number among the vehicles of a scene; the cars have 1..J

# No car brakes harder, whatever IDM asks of it; SUMO's default `emergencyDecel` of passenger cars.
HARDEST_BRAKING = 9.0  # m/s²

# What a car may be off its lane's centre line when it is no longer changing lanes.
CENTRED = 1e-3  # m

SHARED = 0
REACTING = 1


class PredictionModel(NamedTuple):
    """What the prediction depends on and no plan changes."""

    drivers: np.ndarray  # (M, 6) the mean driver, once for each vehicle (MOBIL reads a row per car)
    mobil: np.ndarray  # (3,) MOBIL's parameters
    lane_count: int
    lane_width: float  # m
    steps: int  # car-following steps in one action
    step: float  # s
    robot_lateral_speed: float  # m/s, during the robot's lane changes
    others_lateral_speed: float  # m/s, during the others'
    speed_kept: float  # share of v − v_p that is left after one step of the tracked speed
    speed_response: float  # s
    notice_reach: float  # m, drivers notice the robot in lanes whose centre line is nearer to its centre


class Scene(NamedTuple):
    """The M = J + 1 vehicles at one instant, sorted by position, the robot among them."""

    vehicle: np.ndarray  # (M,) int64, ROBOT or a car's number
    position: np.ndarray  # (M,) m along the road
    speed: np.ndarray  # (M,) m/s
    lateral: np.ndarray  # (M,) m
    lane: np.ndarray  # (M,) int64, the lane that it drives to (the robot: the lowest lane that it occupies)
    second_lane: np.ndarray  # (M,) int64, the other lane that it occupies meanwhile, else `lane` again
    length: np.ndarray  # (M,) m
    width: np.ndarray  # (M,) m


class Motion(NamedTuple):
    """How the vehicles of a scene move during one action of K steps."""

    leader: np.ndarray  # (M,) int64, place in the scene of the nearest car ahead, or NOBODY; never the robot
    follows_robot_in: np.ndarray  # (M,) int64, bit set of the lanes in which it is the nearest behind the robot
    nearest: np.ndarray  # (lanes,) int64, work space
    branch: np.ndarray  # (M,) int64, SHARED or REACTING: which motion of the next two holds
    position: np.ndarray  # (2, M, K + 1) m
    speed: np.ndarray  # (2, M, K + 1) m/s
    robot_position: np.ndarray  # (K + 1,) m
    robot_speed: np.ndarray  # (K + 1,) m/s
    robot_lateral: np.ndarray  # (K + 1,) m
    robot_lanes: np.ndarray  # (K + 1,) int64, bit sets of the lanes in which drivers notice it


def empty_scene(vehicles: int) -> Scene:
    """Return a scene with room for `vehicles`, the robot included."""
    whole, real = (lambda: np.zeros(vehicles, np.int64)), (lambda: np.zeros(vehicles))
    return Scene(whole(), real(), real(), real(), whole(), whole(), real(), real())


def empty_motion(vehicles: int, steps: int, lane_count: int) -> Motion:
    """Return a motion with room for `vehicles`, the robot included, and `steps` steps."""
    return Motion(
        leader=np.zeros(vehicles, np.int64),
        follows_robot_in=np.zeros(vehicles, np.int64),
        nearest=np.zeros(lane_count, np.int64),
        branch=np.zeros(vehicles, np.int64),
        position=np.zeros((2, vehicles, steps + 1)),
        speed=np.zeros((2, vehicles, steps + 1)),
        robot_position=np.zeros(steps + 1),
        robot_speed=np.zeros(steps + 1),
        robot_lateral=np.zeros(steps + 1),
        robot_lanes=np.zeros(steps + 1, np.int64),
    )


@njit(cache=True)
def sort_scene(scene: Scene) -> int:
    """Sort a scene by position and return the robot's place in it.

    Insertion sort: from one second to the next few cars overtake one another, so that nearly nothing moves.
    """
    position = scene.position
    for place in range(1, len(position)):
        back = place
        while back > 0 and position[back - 1] > position[back]:
            swap(scene.vehicle, back)
            swap(scene.position, back)
            swap(scene.speed, back)
            swap(scene.lateral, back)
            swap(scene.lane, back)
            swap(scene.second_lane, back)
            swap(scene.length, back)
            swap(scene.width, back)
            back -= 1
    for place in range(len(position)):
        if scene.vehicle[place] == ROBOT:
            return place
    return NOBODY


@njit(cache=True)
def swap(array: np.ndarray, place: int) -> None:
    """Exchange `array[place - 1]` and `array[place]`."""
    kept = array[place]
    array[place] = array[place - 1]
    array[place - 1] = kept


@njit(cache=True)
def change_lanes(scene: Scene, robot: int, model: PredictionModel) -> None:
    """Let each car that is not changing lanes yet begin to, where MOBIL wants it.

    One car after the other, from the back to the front, so that no two take the same gap at once.
    """
    for car in range(len(scene.lane)):
        if car == robot or scene.lane[car] != scene.second_lane[car]:
            continue
        here = scene.lane[car]
        wanted, best = here, 0.0
        for target in (here + 1, here - 1):
            if 0 <= target < model.lane_count:
                incentive = lane_change_incentive(
                    car,
                    target,
                    scene.position,
                    scene.speed,
                    scene.lane,
                    scene.second_lane,
                    scene.length,
                    model.drivers,
                    model.mobil,
                )
                if incentive > best:
                    wanted, best = target, incentive
        scene.lane[car] = wanted


@njit(cache=True)
def find_leaders(scene: Scene, robot: int, motion: Motion) -> None:
    """Find each car's nearest car ahead in the lanes that it occupies, and who is nearest behind the robot.

    One sweep from the front to the back, which remembers the last car seen in each lane.
    """
    nearest = motion.nearest
    nearest[:] = NOBODY
    behind_robot = False
    lanes_with_follower = 0
    for car in range(len(scene.lane) - 1, -1, -1):
        if car == robot:
            behind_robot = True
            continue
        lane, second = scene.lane[car], scene.second_lane[car]
        ahead, ahead_in_second = nearest[lane], nearest[second]
        if ahead == NOBODY or (ahead_in_second != NOBODY and ahead_in_second < ahead):
            ahead = ahead_in_second
        motion.leader[car] = ahead
        motion.follows_robot_in[car] = 0
        if behind_robot:
            lanes = (1 << lane) | (1 << second)
            motion.follows_robot_in[car] = lanes & ~lanes_with_follower
            lanes_with_follower |= lanes
        nearest[lane] = car
        nearest[second] = car


@njit(cache=True)
def follow(
    car: int,
    branch: int,
    follows_robot: bool,
    scene: Scene,
    robot: int,
    motion: Motion,
    drivers: np.ndarray,
    step: float,
) -> None:
    """Drive one car through the action behind its leader, and behind the robot where `follows_robot`.

    The acceleration is held through each step and the speed stops at 0 (the ballistic update).
    """
    leader = motion.leader[car]
    leader_branch = motion.branch[leader] if leader != NOBODY else SHARED
    lanes = motion.follows_robot_in[car] if follows_robot else 0
    driver = drivers[car]
    length = scene.length[car]
    position, speed = scene.position[car], scene.speed[car]
    motion.position[branch, car, 0] = position
    motion.speed[branch, car, 0] = speed
    for now in range(motion.position.shape[2] - 1):
        ahead, ahead_speed, ahead_length = math.inf, 0.0, 0.0
        if leader != NOBODY:
            ahead = motion.position[leader_branch, leader, now]
            ahead_speed = motion.speed[leader_branch, leader, now]
            ahead_length = scene.length[leader]
        if lanes & motion.robot_lanes[now] and position < motion.robot_position[now] < ahead:
            ahead = motion.robot_position[now]
            ahead_speed = motion.robot_speed[now]
            ahead_length = scene.length[robot]
        gap = ahead - position - 0.5 * (ahead_length + length)
        acceleration = max(idm_acceleration(speed, gap, ahead_speed, driver), -HARDEST_BRAKING)
        next_speed = max(speed + acceleration * step, 0.0)
        position += 0.5 * (speed + next_speed) * step
        speed = next_speed
        motion.position[branch, car, now + 1] = position
        motion.speed[branch, car, now + 1] = speed


@njit(cache=True)
def drive_without_robot(scene: Scene, robot: int, motion: Motion, model: PredictionModel) -> None:
    """Drive all cars through one action as if the robot were not there: the motion that all its actions share."""
    motion.branch[:] = SHARED
    for car in range(len(scene.lane) - 1, -1, -1):
        if car != robot:
            follow(car, SHARED, False, scene, robot, motion, model.drivers, model.step)


@njit(cache=True)
def react_to_robot(scene: Scene, robot: int, motion: Motion, model: PredictionModel) -> None:
    """Drive those cars again that the robot's motion reaches, and mark them; the others keep the shared motion."""
    occupied = 0
    for now in range(len(motion.robot_lanes)):
        occupied |= motion.robot_lanes[now]
    for car in range(len(scene.lane) - 1, -1, -1):
        if car == robot:
            continue
        leader = motion.leader[car]
        behind_robot = motion.follows_robot_in[car] & occupied != 0
        if behind_robot or (leader != NOBODY and motion.branch[leader] == REACTING):
            motion.branch[car] = REACTING
            follow(car, REACTING, True, scene, robot, motion, model.drivers, model.step)
        else:
            motion.branch[car] = SHARED


@njit(cache=True)
def drive_robot(
    scene: Scene, robot: int, planned_lane: int, planned_speed: float, motion: Motion, model: PredictionModel
) -> float:
    """Drive the robot through one action and return its heading at the end, rad.

    Its speed approaches v_p exponentially, as the tracking controller's a = K_2 (v_p − v) makes it; across the
    road it moves at a constant speed until it is on the planned lane's centre line.
    """
    target = planned_lane * model.lane_width
    position, speed, lateral = scene.position[robot], scene.speed[robot], scene.lateral[robot]
    motion.robot_position[0] = position
    motion.robot_speed[0] = speed
    motion.robot_lateral[0] = lateral
    motion.robot_lanes[0] = noticed_lanes(lateral, model)
    for now in range(1, len(motion.robot_lanes)):
        excess = speed - planned_speed
        position += planned_speed * model.step + excess * (1.0 - model.speed_kept) * model.speed_response
        speed = planned_speed + excess * model.speed_kept
        lateral = approach(lateral, target, model.robot_lateral_speed * model.step)
        motion.robot_position[now] = position
        motion.robot_speed[now] = speed
        motion.robot_lateral[now] = lateral
        motion.robot_lanes[now] = noticed_lanes(lateral, model)
    if lateral == target:
        return 0.0
    across = math.copysign(model.robot_lateral_speed, target - lateral)
    return math.atan2(across, max(speed, model.robot_lateral_speed))


@njit(cache=True)
def approach(value: float, target: float, distance: float) -> float:
    """Return `value` moved towards `target` by `distance`, or `target` where that is nearer."""
    if abs(target - value) <= distance:
        return target
    return value + math.copysign(distance, target - value)


@njit(cache=True)
def noticed_lanes(lateral: float, model: PredictionModel) -> int:
    """Return the bit set of the lanes in which drivers notice a robot whose centre is at `lateral`."""
    lanes = 0
    for lane in range(model.lane_count):
        if abs(lateral - lane * model.lane_width) < model.notice_reach:
            lanes |= 1 << lane
    return lanes


@njit(cache=True)
def robot_crashes(scene: Scene, robot: int, motion: Motion, model: PredictionModel) -> bool:
    """Return whether the robot's body touches a car's at any instant of the action.

    Between two steps both move on straight lines, so the instants at which they overlap along and across the road
    are two intervals in closed form, and they touch if these meet.
    """
    for car in range(len(scene.lane)):
        if car == robot:
            continue
        branch = motion.branch[car]
        reach = 0.5 * (scene.length[car] + scene.length[robot])
        breadth = 0.5 * (scene.width[car] + scene.width[robot])
        centre = scene.lane[car] * model.lane_width
        for now in range(model.steps):
            along = motion.position[branch, car, now] - motion.robot_position[now]
            next_along = motion.position[branch, car, now + 1] - motion.robot_position[now + 1]
            if min(along, next_along) >= reach or max(along, next_along) <= -reach:
                continue
            moved = model.others_lateral_speed * model.step
            across = approach(scene.lateral[car], centre, moved * now) - motion.robot_lateral[now]
            next_across = approach(scene.lateral[car], centre, moved * (now + 1)) - motion.robot_lateral[now + 1]
            if overlap_between(along, next_along, reach, across, next_across, breadth):
                return True
    return False


@njit(cache=True)
def overlap_between(
    along: float, next_along: float, reach: float, across: float, next_across: float, breadth: float
) -> bool:
    """Return whether |along| < reach and |across| < breadth at one instant while both go linearly to their next."""
    enter_along, leave_along = instants_within(along, next_along, reach)
    enter_across, leave_across = instants_within(across, next_across, breadth)
    return max(enter_along, enter_across) < min(leave_along, leave_across)


@njit(cache=True)
def instants_within(offset: float, next_offset: float, reach: float) -> tuple[float, float]:
    """Return the part of [0, 1] in which |offset| < reach while it goes linearly to `next_offset`; (1, 0) if none."""
    change = next_offset - offset
    if change == 0.0:
        return (0.0, 1.0) if abs(offset) < reach else (1.0, 0.0)
    first, last = (-reach - offset) / change, (reach - offset) / change
    return max(min(first, last), 0.0), min(max(first, last), 1.0)
