"""Evading who breaks a duty: the last that is left where V counts on duties that somebody does not do.

V among cars that do their duties promises nothing of one that steers into the robot's side or does not brake behind it,
and the escape, straight on and braking, may be the wrong one. Such a car is seen (`games.highway.breach`). All cars are
taken to go on as they do, and who breaks a duty to do that or to come at the robot (`pursuit`). A control passes if
after it some manoeuvre keeps the bodies apart; if none does, that one is driven which does so best, or longest. So it
acts at the last moment, when nothing else is left.

A manoeuvre shifts the robot across the road, as fast as it can and be straight again, at one acceleration. First comes
that it runs into nobody whom it has to answer for, those ahead and those who do their duties, and leaves room to brake
behind those ahead; then that nobody runs into it. Nothing is guaranteed here: nobody has to go on as he does.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.control.spc.pursuit import Abilities, Pursuer, Target, pursued
from hj_cosim.kernels import kernel
from hj_cosim.settings import RobotSettings

HORIZON, STEP = 3.0, 0.1  # s
_INSTANTS = round(HORIZON / STEP)
# m between the bodies that a manoeuvre must leave for a control to pass, and while one is driven already.
SPARE, SPARE_DRIVEN = 0.2, 0.6
ROOM_ENOUGH = 1.0  # m; more is no better
SHIFT_HEADING = 0.3  # rad, the most that a shift turns to
_SHARE_OF_TURNING = 0.8  # of the turning that there is, which a shift counts on to be straight in the end
GAINING = 1.0  # s, for which a manoeuvre accelerates
_BETTER = 0.35  # of an outcome, by which another manoeuvre has to be better than the one that is driven
_SHIFTS = (0.0, 1.0, -1.0, 2.0, -2.0, 3.6, -3.6)  # m
_SLOWEST = 0.1  # m/s, below which a turn has no radius
PASSED, EVADED, CAUGHT = 0, 1, 2  # verdicts
# Columns of a car: m, m, m/s, m/s², and m/s across the road; half its extents along and across, m; whether the robot
# answers for running into it; whether it may come at the robot, its heading, rad, and its limits, rad and m/s²; and a
# pursuer's place, heading and speed, which are written anew for every manoeuvre.
X, Y, SPEED, ACCELERATION, ACROSS, HALF_ALONG, HALF_ACROSS, ANSWERED = range(8)
PURSUES, HEADING, HEADING_MAX, ACCELERATION_MIN, ACCELERATION_MAX = range(8, 13)
_PURSUER = 13
COLUMNS = _PURSUER + len(Pursuer._fields)


class Evader(NamedTuple):
    """The robot's body, what it can do, and where its centre stays across the road."""

    length: float  # m
    width: float  # m
    omega_max: float  # rad/s
    sideways: float  # m/s², the most |v ω| that its tyres hold
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²
    speed_max: float  # m/s
    lowest: float  # m
    highest: float  # m

    @classmethod
    def of(cls, robot: RobotSettings, lowest: float, highest: float) -> "Evader":
        """Return a robot that stays between two offsets across the road, m."""
        return cls(
            robot.length,
            robot.width,
            robot.omega_max,
            robot.lateral_acceleration_max,
            robot.acceleration_min,
            robot.acceleration_max,
            robot.speed_max,
            lowest,
            highest,
        )


class Shift(NamedTuple):
    """A manoeuvre: to a place across the road, at an acceleration; no place, NaN, is none."""

    lateral: float  # m
    acceleration: float  # m/s²


class Held(NamedTuple):
    """A control that is held before a manoeuvre begins."""

    omega: float  # rad/s
    acceleration: float  # m/s²
    time: float  # s, may be 0


class Motion(NamedTuple):
    """The robot at an instant."""

    x: float  # m
    y: float  # m
    heading: float  # rad
    speed: float  # m/s


class Footprint(NamedTuple):
    """Half of what its body, turned as it is, takes along and across the road, m."""

    along: float
    across: float


NO_SHIFT = Shift(math.nan, 0.0)
_AT_ONCE = Held(0.0, 0.0, 0.0)


@kernel
def shifting_omega(evader: Evader, shift: Shift, at: Motion, step: float) -> float:
    """Return ω, rad/s, over the next step of a shift: to where it leads as fast as it can still be straight there."""
    most = min(evader.omega_max, evader.sideways / max(at.speed, _SLOWEST))
    rest = shift.lateral - at.y
    across = math.sqrt(2.0 * _SHARE_OF_TURNING * most * at.speed * abs(rest))
    aim = math.asin(min(across / max(at.speed, _SLOWEST), math.sin(SHIFT_HEADING)))
    return min(max((math.copysign(aim, rest) - at.heading) / step, -most), most)


@kernel
def _moved(evader: Evader, at: Motion, omega: float, acceleration: float, step: float) -> Motion:
    """Return the robot a step later."""
    speed = min(max(at.speed + acceleration * step, 0.0), evader.speed_max)
    way, direction = 0.5 * (at.speed + speed) * step, at.heading + 0.5 * omega * step
    return Motion(at.x + way * math.cos(direction), at.y + way * math.sin(direction), at.heading + omega * step, speed)


@kernel
def _footprint(evader: Evader, heading: float) -> Footprint:
    """Return the robot's footprint at a heading."""
    sin, cos = abs(math.sin(heading)), math.cos(heading)
    return Footprint(0.5 * (evader.length * cos + evader.width * sin), 0.5 * (evader.width * cos + evader.length * sin))


@kernel
def _room(evader: Evader, at: Motion, footprint: Footprint, time: float, car: np.ndarray) -> float:
    """Return what is between the robot and where a car is at a time if it goes on, m; at most 0 where they touch.

    Behind one that it answers for, what it needs to stop in that one's stead counts as taken.
    """
    moving = min(time, -car[SPEED] / car[ACCELERATION]) if car[ACCELERATION] < 0.0 else time
    along = car[X] + (car[SPEED] + 0.5 * car[ACCELERATION] * moving) * moving - at.x
    across = car[Y] + car[ACROSS] * time - at.y
    lengthwise = abs(along) - footprint.along - car[HALF_ALONG]
    sideways = abs(across) - footprint.across - car[HALF_ACROSS]
    if car[ANSWERED] > 0.0 and along > 0.0:
        ahead = max(car[SPEED] + car[ACCELERATION] * moving, 0.0)
        lengthwise -= max(at.speed * at.speed - ahead * ahead, 0.0) / (-2.0 * evader.acceleration_min)
    return max(lengthwise, sideways)


@kernel
def _begin_pursuit(car: np.ndarray) -> None:
    """Write into a car's row where it is now."""
    car[_PURSUER], car[_PURSUER + 1], car[_PURSUER + 2], car[_PURSUER + 3] = car[X], car[Y], car[HEADING], car[SPEED]


@kernel
def _pursue(at: Motion, footprint: Footprint, car: np.ndarray, step: float) -> None:
    """Write into a car's row where it is a step later if it comes at the robot."""
    pursuer = Pursuer(car[_PURSUER], car[_PURSUER + 1], car[_PURSUER + 2], car[_PURSUER + 3])
    can = Abilities(car[HEADING_MAX], car[ACCELERATION_MIN], car[ACCELERATION_MAX])
    target = Target(at.x - pursuer.x, at.y - pursuer.y, footprint.along + car[HALF_ALONG], at.speed)
    later = pursued(pursuer, can, car[ACCELERATION], target, step)
    car[_PURSUER], car[_PURSUER + 1], car[_PURSUER + 2], car[_PURSUER + 3] = later


@kernel
def _room_from_pursuer(at: Motion, footprint: Footprint, car: np.ndarray) -> float:
    """Return what is between the robot and a car that comes at it, m; at most 0 where they touch."""
    lengthwise = abs(car[_PURSUER] - at.x) - footprint.along - car[HALF_ALONG]
    return max(lengthwise, abs(car[_PURSUER + 1] - at.y) - footprint.across - car[HALF_ACROSS])


@kernel
def outcome(evader: Evader, start: Motion, held: Held, shift: Shift, cars: np.ndarray, floor: float) -> float:
    """Return how a manoeuvre ends; the higher, the better.

    Until when nobody is run into whom the robot answers for, s, at most HORIZON; if to the end, HORIZON and until when
    nobody runs into it, likewise; if nobody does, twice HORIZON and what is left between the bodies, m.

    Args:
        evader: the robot.
        start: where it is.
        held: the control that comes first.
        shift: the manoeuvre.
        cars: (n, COLUMNS) of `write_car`.
        floor: once nothing above it is possible, something that is not above it is returned.
    """
    at, time, spare, touched = start, 0.0, ROOM_ENOUGH, math.inf
    footprint = _footprint(evader, at.heading)
    for j in range(len(cars)):
        _begin_pursuit(cars[j])
    for instant in range(-1, _INSTANTS):
        if instant < 0:
            omega, acceleration, step = held.omega, held.acceleration, held.time
        else:
            omega, step = shifting_omega(evader, shift, at, STEP), STEP
            acceleration = 0.0 if shift.acceleration > 0.0 and time > GAINING else shift.acceleration
        for j in range(len(cars)):
            if cars[j, PURSUES] > 0.0 and step > 0.0:
                _pursue(at, footprint, cars[j], step)
        at, time = _moved(evader, at, omega, acceleration, step), time + step
        footprint = _footprint(evader, at.heading)
        for j in range(len(cars)):
            room = _room(evader, at, footprint, time, cars[j])
            if room <= 0.0 and cars[j, ANSWERED] > 0.0:
                return min(time, HORIZON)
            if cars[j, PURSUES] > 0.0:
                room = min(room, _room_from_pursuer(at, footprint, cars[j]))
            spare = min(spare, room)
        if spare <= 0.0:
            touched = min(touched, time, HORIZON)
        if (2.0 * HORIZON + spare if spare > 0.0 else HORIZON + touched) <= floor:
            break
    return 2.0 * HORIZON + spare if spare > 0.0 else HORIZON + touched


@kernel
def _preferred(found: float) -> float:
    """Return the outcome of the manoeuvre that is driven as it counts among others': a little better, of its kind."""
    kind_ends = HORIZON if found <= HORIZON else 2.0 * HORIZON if found <= 2.0 * HORIZON else math.inf
    return min(found + _BETTER, kind_ends)


@kernel
def _shift(evader: Evader, start: Motion, which: int) -> Shift:
    """Return one of the shifts that there are from a place, those first that brake, and of these straight on."""
    gain, aside = divmod(which, len(_SHIFTS))
    least, most = evader.acceleration_min, evader.acceleration_max
    acceleration = (least, 0.5 * least, 0.0, 0.5 * most, most)[gain]
    return Shift(min(max(start.y + _SHIFTS[aside], evader.lowest), evader.highest), acceleration)


_COUNT = 5 * len(_SHIFTS)


@njit(cache=True)
def evade(evader: Evader, start: Motion, cars: np.ndarray, asked: Held, driven: Shift) -> tuple[Held, int, Shift]:
    """Return the control to apply: the one asked for if after it nothing need happen, or else a manoeuvre's.

    Args:
        evader: the robot.
        start: where it is.
        cars: (n, COLUMNS) of `write_car`.
        asked: the control asked for, and for how long it is held.
        driven: the manoeuvre that gave the last control, NO_SHIFT if none did.

    Returns:
        The control; the verdict, which is PASSED, EVADED, or CAUGHT if the manoeuvre is the best there is and does not
        keep the bodies apart; and the manoeuvre that is driven now, NO_SHIFT if the control passed.
    """
    driving = not math.isnan(driven.lateral)
    enough = 2.0 * HORIZON + (SPARE_DRIVEN if driving else SPARE)
    if driving and outcome(evader, start, asked, driven, cars, enough) > enough:
        return asked, PASSED, NO_SHIFT
    for turn in range(_COUNT):  # those first that neither brake nor gain: mostly one of them is enough
        shift = _shift(evader, start, (turn + 2 * len(_SHIFTS)) % _COUNT)
        if outcome(evader, start, asked, shift, cars, enough) > enough:
            return asked, PASSED, NO_SHIFT
    best, most = NO_SHIFT, -1.0
    if driving:
        best, most = driven, _preferred(outcome(evader, start, _AT_ONCE, driven, cars, -1.0))
    for which in range(_COUNT):
        shift = _shift(evader, start, which)
        found = outcome(evader, start, _AT_ONCE, shift, cars, most)
        if found > most:
            best, most = shift, found
    control = Held(shifting_omega(evader, best, start, asked.time), best.acceleration, asked.time)
    return control, EVADED if most > 2.0 * HORIZON else CAUGHT, best
