"""What a robot that straightens up and brakes is left with among cars that do their duties: a bound without a grid.

RSS's proper response, seen from the game `responsible` (`other_car`). Once the robot goes straight and brakes with at
least b_min, V(0, ·) falls no more below a margin that the duties leave: who is behind brakes as hard, so that its gap
grows; so does the gap to who is ahead, who brakes with b_max at most; who is beside stays there, or comes as near as
the side margin; and who cuts in has left its standing gap. What can go wrong goes wrong before: while the robot turns,
those behind in the lane that it moves to are not bound, and it comes nearer to who is beside.

So only the turning is looked at, instant by instant. Along the road the other car is wherever its hardest braking, or
all the acceleration that its duties leave it, takes it; across, as near as it may steer meanwhile; both at once, and as
if it did not see the robot slow down. The bound holds for many cars at once, for the robot's path is the same.
"""

import numpy as np

from hj_cosim.errors import TableError
from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.least_between import least_of_step
from hj_cosim.reachability.games.highway.other_car import (
    BESIDE,
    CUTTING_IN,
    FOLLOWING,
    IN_LANE,
    MOVING,
    OUT_OF_LANE,
    STAYING,
    STRAIGHT_AHEAD,
    Disturbance,
    kept_room,
    ramp,
)
from hj_cosim.reachability.games.highway.paths import AS_FRONT, AS_REAR, LEFT, LEFTWARDS, RIGHT, SPEED, TIME, Game, X, Y
from hj_cosim.reachability.games.highway.target import TargetFormula

_ROUNDING = 1e-6  # m/s²


@kernel
def level_of_duties(target: TargetFormula, other: Disturbance) -> float:
    """Return the margin of V(0, ·) that the duties leave a robot that goes straight, m: beside it or along the road."""
    lateral = max(target.lateral_0 + target.lateral_2 * target.gained * target.gained, 0.0)
    beside = max(other.side_margin - lateral, 0.0)
    return min(4.0 * beside * beside * beside, other.standing_gap)


@kernel
def _most_acceleration(game: Game, row: np.ndarray, gap: float, speed: float, aside: float, towards: float) -> float:
    """Return how hard a car behind may accelerate at the most, m/s².

    Args:
        game: limits and duties.
        row: of a path.
        gap: m, bumper to bumper.
        speed: m/s, its own.
        aside: m, the largest |p_y| that it may have.
        towards: m/s, of the robot towards its line.
    """
    other, most = game.other, game.other_acceleration_max
    in_lane = 1.0 - ramp(aside, IN_LANE, OUT_OF_LANE)
    staying = 1.0 - ramp(towards, STAYING, MOVING)
    crowding = 1.0 - ramp(kept_room(other, gap, speed, row[SPEED]), 0.0, FOLLOWING)
    return most - max(in_lane, staying) * crowding * (most + other.brake_min)


@kernel
def _steering_share(other: Disturbance, distance: float, width: float, room: float) -> float:
    """Return which share of its steering a car may use towards a robot's side.

    All of it far enough away, with the robot on its other side or straight behind, and where there is room to cut in.

    Args:
        other: its duties.
        distance: m, of the robot from its line, on that side.
        width: m, of the bodies.
        room: m, the most that it may have beside the distance that it keeps.
    """
    near = 1.0 - ramp(distance - width, other.side_margin, other.side_margin + BESIDE)
    return 1.0 - near * (1.0 - ramp(room, 0.0, CUTTING_IN)) * ramp(distance, 0.0, STRAIGHT_AHEAD)


@kernel
def guaranteed_by_duties(
    game: Game, path: np.ndarray, first: int, speed: float, p_x: float, p_y: float, floor: float
) -> float:
    """Return the least of V(0, ·), m, that a path leaves at its instants, and after it, braking straight on.

    Args:
        game: of the manoeuvres.
        path: (instants, COLUMNS) of `write_path`, which ends when the robot is straight.
        first: the instant from which on it counts.
        speed: m/s, of the other car.
        p_x, p_y: m, robot − other, at the beginning.
        floor: m; once nothing above it is possible, the search is given up and what was found so far is returned.
    """
    target, other = game.target, game.other
    fastest = slowest = min(max(speed, 0.0), game.other_speed_max)
    most = least = weaved = 0.0  # m, of the other car's way along the road, and at most to the side
    to_left = to_right = 0.0  # m, by how much it may have come nearer to a robot on its left, on its right
    left = right = level_of_duties(target, other)
    before, across_before = 0.0, (0.0, 0.0)
    for instant in range(len(path)):
        row = path[instant]
        x, y = p_x + row[X], p_y + row[Y]
        if instant >= first:
            from_behind = target.rear_0 + fastest * (target.rear_1 + fastest * target.rear_2) - row[AS_FRONT]
            to_the_front = row[AS_REAR] - slowest * (target.front_1 + slowest * target.front_2)
            if x > most:
                along = x - most - target.length - max(from_behind, 0.0)
            elif x < least:
                along = least - x - target.length - max(to_the_front, 0.0)
            else:
                along = -target.length - max(max(from_behind, to_the_front), 0.0)
            across = y - to_left - row[LEFT], -y - to_right - row[RIGHT]
            if instant == first:
                before, across_before = along, across
            left = least_of_step((before, along), (across_before[0], across[0]), left)
            right = least_of_step((before, along), (across_before[1], across[1]), right)
            before, across_before = along, across
            if max(left, right) <= floor:
                break
        if instant + 1 < len(path):
            step = path[instant + 1, TIME] - row[TIME]
            sideways = fastest * game.other_sideways * step
            behind = kept_room(other, x - least - target.length, slowest, row[SPEED])
            ahead = kept_room(other, most - x - target.length, row[SPEED], fastest)
            room = behind if x > most else (ahead if x < least else max(behind, ahead))
            to_left += sideways * _steering_share(other, y - to_left, target.width, room)
            to_right += sideways * _steering_share(other, -y - to_right, target.width, room)
            weaved += sideways
            gain = game.other_acceleration_max
            if x > most:
                towards = -row[LEFTWARDS] if y > 0.0 else row[LEFTWARDS]
                gain = _most_acceleration(game, row, x - most - target.length, fastest, abs(y) + weaved, towards)
            faster = min(max(fastest + gain * step, 0.0), game.other_speed_max)
            slower = max(slowest + game.other_acceleration_min * step, 0.0)
            most += 0.5 * (fastest + faster) * step
            least += 0.5 * (slowest + slower) * step * game.other_forward
            fastest, slowest = faster, slower
    return max(left, right)


def require_hold(game: Game, acceleration_min: float) -> None:
    """Refuse a game in which braking straight on does not keep the gaps.

    Args:
        game: with what V(0, ·) and the duties count on.
        acceleration_min: m/s², of the robot.

    Raises:
        TableError: if somebody brakes less than V(0, ·) counts on behind, or more ahead, or V(0, ·) counts on no
            braking at all.
    """
    if game.target.rear_2 == 0.0 or game.target.front_2 == 0.0:
        raise TableError(
            "among cars that do their duties braking keeps RSS's gaps, and no time to collision; solve the game with"
            " responsible = 0, or set filter.keep_escape=false and capped_by_manoeuvres = false"
        )
    behind, ahead = 0.5 / game.target.rear_2, 0.5 / game.target.front_2
    for who, brakes, limit, is_enough in (
        ("a robot", -acceleration_min, behind, -acceleration_min >= behind - _ROUNDING),
        ("a car behind", game.other.brake_min, behind, game.other.brake_min >= behind - _ROUNDING),
        ("a car ahead", -game.other.acceleration_min, ahead, -game.other.acceleration_min <= ahead + _ROUNDING),
    ):
        if not is_enough:
            raise TableError(
                f"{who} that brakes with {brakes:g} m/s², where V(0, ·) counts on {limit:g} m/s², leaves no gap that"
                " braking keeps; set filter.keep_escape=false to drive without an escape"
            )
