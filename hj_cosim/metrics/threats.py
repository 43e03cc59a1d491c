"""Threats at every sample: TTC, BTN and STN of the worst car ahead; 2D TTC, gap and collision with any car."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.metrics.rectangles import rectangle_distance, rectangles_overlap, time_to_overlap
from hj_cosim.recording.record import RobotTrack, ThreatTrack, TrafficTrack

BRAKE_LIMIT = 5.0  # m/s², what BTN is relative to
STEER_LIMIT = 2.5  # m/s², what STN is relative to


class PairThreat(NamedTuple):
    """The threat that one car ahead is."""

    ttc: float  # s
    braking: float  # a_long,req, m/s², at most 0
    lateral: float  # a_lat,req, m/s²


@njit(cache=True)
def required_braking(gap: float, speed: float, lead_speed: float, lead_acceleration: float) -> float:
    """Return a_long,req, the acceleration that just avoids the car ahead, m/s², at most 0 (Brännström et al. 2008).

    Args:
        gap: bumper to bumper, m, positive.
        speed, lead_speed: m/s.
        lead_acceleration: m/s², held until the lead stands.
    """
    closing = speed - lead_speed
    stopping_time = lead_speed / -lead_acceleration if lead_acceleration < 0.0 else math.inf
    if closing > 0.0 and 2.0 * gap / closing <= stopping_time:
        return min(-closing * closing / (2.0 * gap) + lead_acceleration, 0.0)
    if lead_acceleration < 0.0:
        return -speed * speed / (2.0 * (gap + lead_speed * lead_speed / (-2.0 * lead_acceleration)))
    return 0.0


@njit(cache=True)
def required_lateral(ttc: float, offset: float, lateral_closing: float, width: float) -> float:
    """Return a_lat,req, the lateral acceleration that just clears the car ahead by the time of collision, m/s².

    Args:
        ttc: s, positive.
        offset: Δy = y_o − y_r, m.
        lateral_closing: Δv_y of the same sign, m/s.
        width: W, the mean of the two widths, m.
    """
    if ttc == math.inf:
        return 0.0
    at_collision = offset + lateral_closing * ttc
    if abs(at_collision) >= width:
        return 0.0
    return min(abs(at_collision + width), abs(at_collision - width)) * 2.0 / (ttc * ttc)


@njit(cache=True)
def pair_threat(
    gap: float,
    speed: float,
    lead_speed: float,
    lead_acceleration: float,
    offset: float,
    lateral_closing: float,
    width: float,
) -> PairThreat:
    """Return what one car ahead in the robot's way threatens; arguments as required_braking and required_lateral."""
    if gap <= 0.0:
        return PairThreat(0.0, -math.inf, math.inf)
    closing = speed - lead_speed
    ttc = gap / closing if closing > 0.0 else math.inf
    return PairThreat(
        ttc,
        required_braking(gap, speed, lead_speed, lead_acceleration),
        required_lateral(ttc, offset, lateral_closing, width),
    )


# The hot loops go sample by sample and car by car: most pairs are dismissed by one comparison, which no
# array expression can do, and nothing of shape (T, J) is allocated. Eleven parameters: plain arrays, as they are.
@njit(cache=True)
def _worst_threats(
    robot: np.ndarray,
    robot_length: float,
    robot_width: float,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
    acceleration: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> np.ndarray:
    """Return (T, 3): the smallest TTC, the hardest required braking, the largest required lateral acceleration."""
    samples, cars = x.shape
    worst = np.empty((samples, 3))
    for t in range(samples):
        ttc, braking, lateral = math.inf, 0.0, 0.0
        robot_x, robot_y, robot_speed = robot[t, 0], robot[t, 1], robot[t, 3]
        robot_lateral_speed = robot_speed * math.sin(robot[t, 2])
        for j in range(cars):
            mean_width = 0.5 * (robot_width + width[j])
            offset = y[t, j] - robot_y
            if not present[t, j] or x[t, j] <= robot_x or abs(offset) >= mean_width:
                continue
            gap = x[t, j] - robot_x - 0.5 * (robot_length + length[j])
            lateral_closing = speed[t, j] * math.sin(heading[t, j]) - robot_lateral_speed
            pair = pair_threat(gap, robot_speed, speed[t, j], acceleration[t, j], offset, lateral_closing, mean_width)
            ttc = min(ttc, pair.ttc)
            braking = min(braking, pair.braking)
            lateral = max(lateral, pair.lateral)
        worst[t, 0], worst[t, 1], worst[t, 2] = ttc, braking, lateral
    return worst


@njit(cache=True)
def _nearest_along(present: np.ndarray, x: np.ndarray, robot_x: float) -> int:
    """Return which of the cars present is nearest along the road; -1 if there is none."""
    found, least = -1, math.inf
    for j in range(len(x)):
        if present[j] and abs(x[j] - robot_x) < least:
            found, least = j, abs(x[j] - robot_x)
    return found


# Nine parameters: the plain arrays of _worst_threats, so that a pass reads only those that it needs.
@njit(cache=True)
def _nearest_bodies(
    robot: np.ndarray,
    robot_length: float,
    robot_width: float,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (T,), the distance from the robot's body to the nearest car's (m; +inf without cars), and (T,) overlap."""
    samples, cars = x.shape
    nearest = np.full(samples, math.inf)
    overlap = np.zeros(samples, np.bool_)
    robot_radius = 0.5 * math.hypot(robot_length, robot_width)
    for t in range(samples):
        # Who is nearest along the road comes first: with the others one comparison is enough then.
        first = _nearest_along(present[t], x[t], robot[t, 0])
        for place in range(-1, cars):
            j = first if place < 0 else place
            if j < 0 or place == first or not present[t, j]:
                continue
            dx, dy = x[t, j] - robot[t, 0], y[t, j] - robot[t, 1]
            reach = nearest[t] + robot_radius + 0.5 * math.hypot(length[j], width[j])
            if abs(dx) >= reach or abs(dy) >= reach:
                continue
            angle, other = robot[t, 2], heading[t, j]
            if rectangles_overlap(dx, dy, angle, robot_length, robot_width, other, length[j], width[j]):
                nearest[t], overlap[t] = 0.0, True
                break
            distance = rectangle_distance(dx, dy, angle, robot_length, robot_width, other, length[j], width[j])
            nearest[t] = min(nearest[t], distance)
    return nearest, overlap


# Ten parameters: the plain arrays of _worst_threats, so that a pass reads only those that it needs.
@njit(cache=True)
def _smallest_times_to_overlap(
    robot: np.ndarray,
    robot_length: float,
    robot_width: float,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> np.ndarray:
    """Return (T,) the time until the robot's body overlaps any car's, both at constant velocity, s; +inf if never."""
    samples, cars = x.shape
    smallest = np.full(samples, math.inf)
    for t in range(samples):
        angle = robot[t, 2]
        robot_vx, robot_vy = robot[t, 3] * math.cos(angle), robot[t, 3] * math.sin(angle)
        for j in range(cars):
            if not present[t, j]:
                continue
            other = heading[t, j]
            dx, dy = x[t, j] - robot[t, 0], y[t, j] - robot[t, 1]
            vx, vy = speed[t, j] * math.cos(other) - robot_vx, speed[t, j] * math.sin(other) - robot_vy
            # Who is farther along the road than the bodies reach is never met if it comes no nearer, and later than
            # another one if it comes near too slowly.
            apart = abs(dx) - (robot_length + robot_width + length[j] + width[j])
            if apart > 0.0 and (dx * vx >= 0.0 or apart > abs(vx) * smallest[t]):
                continue
            smallest[t] = min(
                smallest[t],
                time_to_overlap(
                    dx,
                    dy,
                    vx,
                    vy,
                    angle,
                    robot_length,
                    robot_width,
                    other,
                    length[j],
                    width[j],
                ),
            )
    return smallest


@njit(cache=True)
def touching(
    robot: np.ndarray,
    robot_length: float,
    robot_width: float,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> np.ndarray:
    """Return (J,), whether the robot's body overlaps each car's, at one instant.

    Args:
        robot: (4,) p_x, p_y (m), θ (rad), v.
        robot_length, robot_width: m.
        x, y, heading, length, width: (J,) of the cars that are present; m, rad.
    """
    overlap = np.zeros(len(x), np.bool_)
    for j in range(len(x)):
        dx, dy = x[j] - robot[0], y[j] - robot[1]
        if abs(dx) <= 0.5 * (robot_length + robot_width + length[j] + width[j]):
            overlap[j] = rectangles_overlap(
                dx, dy, robot[2], robot_length, robot_width, heading[j], length[j], width[j]
            )
    return overlap


def threat_track(
    robot: RobotTrack,
    traffic: TrafficTrack,
    robot_length: float,
    robot_width: float,
    brake_limit: float = BRAKE_LIMIT,
    steer_limit: float = STEER_LIMIT,
) -> ThreatTrack:
    """Return the threat metrics of a run at every sample.

    TTC, BTN and STN (Brännström et al. 2008) are over the cars whose centre is ahead of the robot's and whose lateral
    extent overlaps the robot's, the worst of them; 2D TTC, min_gap and collision are over all cars, by their oriented
    rectangles.

    Args:
        robot: T samples.
        traffic: T samples, J cars.
        robot_length, robot_width: m.
        brake_limit, steer_limit: m/s², what BTN and STN are relative to.
    """
    states = np.column_stack([robot.x, robot.y, robot.heading, robot.speed])
    body = (robot_length, robot_width)
    found = [_threats(states[piece.samples], *body, piece.traffic) for piece in traffic.pieces()]
    worst, nearest, overlap, overlap_in = (np.concatenate(column) for column in zip(*found, strict=True))
    return ThreatTrack(
        ttc=worst[:, 0],
        btn=np.abs(worst[:, 1]) / brake_limit,
        stn=worst[:, 2] / steer_limit,
        min_gap=nearest,
        collision=overlap,
        ttc_2d=overlap_in,
    )


def _threats(
    states: np.ndarray, robot_length: float, robot_width: float, traffic: TrafficTrack
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the worst threats (T, 3), the least gap (T,), m, whether bodies overlap, and in how many s they will."""
    cars = (traffic.present, traffic.x, traffic.y, traffic.heading)
    sizes = (traffic.length, traffic.width)
    worst = _worst_threats(states, robot_length, robot_width, *cars, traffic.speed, traffic.acceleration, *sizes)
    nearest, overlap = _nearest_bodies(states, robot_length, robot_width, *cars, *sizes)
    overlap_in = _smallest_times_to_overlap(states, robot_length, robot_width, *cars, traffic.speed, *sizes)
    return worst, nearest, overlap, overlap_in
