"""A car that comes at the robot, as the evasion fears of one that breaks a duty (jitted).

It steers to where the robot is, as far and as fast as the game's other car can; behind, it goes on gaining or losing
speed as it does now, and level with the robot it keeps level. So a robot that only moves aside is followed, and what
escapes from it escapes from whoever does less; yet nobody is feared who would have to be at two places at once.
"""

import math
from typing import NamedTuple

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.other_car import Disturbance

HOMING = 2.0  # 1/s, of the way across that is left
TURN_RATE = 0.3  # rad/s, the fastest change of its heading
_SLOWEST = 1.0  # m/s, below which the way across is not divided by the speed


class Abilities(NamedTuple):
    """What a car can do; the game's other car's limits, whatever its duties."""

    heading_max: float  # rad
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²


class Pursuer(NamedTuple):
    """A car at an instant."""

    x: float  # m
    y: float  # m
    heading: float  # rad
    speed: float  # m/s


class Target(NamedTuple):
    """The robot, as a pursuer sees it."""

    ahead: float  # m, from centre to centre
    aside: float  # m
    level: float  # m between the centres along the road, within which the bodies are beside each other
    speed: float  # m/s


@kernel
def abilities_of(other: Disturbance) -> Abilities:
    """Return what a car of a game can do."""
    return Abilities(other.heading_max, other.acceleration_min, other.acceleration_max)


@kernel
def pursued(car: Pursuer, can: Abilities, gain: float, target: Target, step: float) -> Pursuer:
    """Return a pursuer a step later; `gain` is how it gains or loses speed while it is not level, m/s²."""
    if abs(target.ahead) < target.level:
        gain = (target.speed - car.speed) / step
    gain = min(max(gain, can.acceleration_min), can.acceleration_max)
    across = HOMING * target.aside / max(car.speed, _SLOWEST)
    wanted = min(max(across, -can.heading_max), can.heading_max)
    heading = car.heading + min(max(wanted - car.heading, -TURN_RATE * step), TURN_RATE * step)
    later = max(car.speed + gain * step, 0.0)
    way = 0.5 * (car.speed + later) * step
    return Pursuer(car.x + way, car.y + way * math.sin(0.5 * (car.heading + heading)), heading, later)
