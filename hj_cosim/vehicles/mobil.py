"""MOBIL: minimizing overall braking induced by lane changes (Kesting, Treiber, Helbing 2007).

Written once for the background drivers and the planner's prediction; both hold their cars as arrays
sorted by position, so that a neighbour is found by walking a few places up or down the order.
"""

import math

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel
from hj_cosim.vehicles.idm import driver_of, idm_acceleration

# Columns of MOBIL's parameters, an array (3,).
POLITENESS = 0
GAIN_THRESHOLD = 1  # m/s²
SAFE_BRAKING = 2  # m/s²

NOBODY = -1


@kernel
def leader_in_lane(car: int, wanted_lane: int, lane: np.ndarray, second_lane: np.ndarray) -> int:
    """Return the nearest car ahead of `car` that occupies `wanted_lane`, or NOBODY.

    Args:
        car: index into the arrays, which are sorted by position, ascending.
        wanted_lane: the lane to look in.
        lane: (J,) int, each car's lane.
        second_lane: (J,) int, the other lane it occupies while changing, else its lane again.
    """
    for other in range(car + 1, len(lane)):
        if lane[other] == wanted_lane or second_lane[other] == wanted_lane:
            return other
    return NOBODY


@kernel
def follower_in_lane(car: int, wanted_lane: int, lane: np.ndarray, second_lane: np.ndarray) -> int:
    """Return the nearest car behind `car` that occupies `wanted_lane`, or NOBODY; arguments as leader_in_lane."""
    for other in range(car - 1, -1, -1):
        if lane[other] == wanted_lane or second_lane[other] == wanted_lane:
            return other
    return NOBODY


@kernel
def following_acceleration(
    car: int, leader: int, position: np.ndarray, speed: np.ndarray, length: np.ndarray, drivers: np.ndarray
) -> float:
    """Return IDM's acceleration of `car` behind `leader` (or NOBODY), m/s²; arguments as lane_change_incentive."""
    driver = driver_of(drivers, car)
    if leader == NOBODY:
        return idm_acceleration(speed[car], math.inf, 0.0, driver)
    gap = position[leader] - position[car] - 0.5 * (length[leader] + length[car])
    return idm_acceleration(speed[car], gap, speed[leader], driver)


@kernel
def is_safe_change(
    car: int,
    new_leader: int,
    new_follower: int,
    position: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    drivers: np.ndarray,
    safe_braking: float,
) -> bool:
    """Return whether `car` may change lanes between two others: eq. 2 of the paper.

    The new follower need not brake harder than b_safe, and the bodies do not overlap.

    Args:
        car: index into the arrays, which are as lane_change_incentive has them.
        new_leader, new_follower: likewise, in the lane that it would change to, or NOBODY.
        safe_braking: b_safe, m/s².
    """
    if new_leader != NOBODY and position[new_leader] - position[car] <= 0.5 * (length[new_leader] + length[car]):
        return False
    if new_follower == NOBODY:
        return True
    if position[car] - position[new_follower] <= 0.5 * (length[new_follower] + length[car]):
        return False
    return following_acceleration(new_follower, car, position, speed, length, drivers) >= -safe_braking


# Nine parameters: traffic and planner keep these arrays differently, and both hand them over without a copy.
@kernel
def lane_change_incentive(
    car: int,
    target_lane: int,
    position: np.ndarray,
    speed: np.ndarray,
    lane: np.ndarray,
    second_lane: np.ndarray,
    length: np.ndarray,
    drivers: np.ndarray,
    mobil: np.ndarray,
) -> float:
    """Return MOBIL's incentive of `car` for `target_lane` above its threshold; −inf where it would be unsafe.

    The incentive is ã_c − a_c + p (ã_n − a_n + ã_o − a_o) − Δa_th (eq. 6 of the paper).

    Args:
        car: index into the arrays, which are sorted by position, ascending.
        target_lane: the lane it would change to.
        position: (J,) centres along the road, m.
        speed: (J,) m/s.
        lane: (J,) int, each car's lane.
        second_lane: (J,) int, the other lane it occupies while changing, else its lane again.
        length: (J,) m.
        drivers: (J, 6) IDM parameters, in the order of vehicles.idm.
        mobil: (3,) politeness, gain threshold, safe braking.

    Returns:
        m/s²; the change is wanted where this is positive.
    """
    new_leader = leader_in_lane(car, target_lane, lane, second_lane)
    new_follower = follower_in_lane(car, target_lane, lane, second_lane)
    if not is_safe_change(car, new_leader, new_follower, position, speed, length, drivers, mobil[SAFE_BRAKING]):
        return -math.inf

    old_leader = leader_in_lane(car, lane[car], lane, second_lane)
    own_now = following_acceleration(car, old_leader, position, speed, length, drivers)
    own_after = following_acceleration(car, new_leader, position, speed, length, drivers)
    incentive = own_after - own_now - mobil[GAIN_THRESHOLD]
    if mobil[POLITENESS] > 0.0:
        others = 0.0
        if new_follower != NOBODY:
            now = following_acceleration(new_follower, new_leader, position, speed, length, drivers)
            others += following_acceleration(new_follower, car, position, speed, length, drivers) - now
        old_follower = follower_in_lane(car, lane[car], lane, second_lane)
        if old_follower != NOBODY:
            now = following_acceleration(old_follower, car, position, speed, length, drivers)
            after = following_acceleration(old_follower, old_leader, position, speed, length, drivers)
            others += after - now
        incentive += mobil[POLITENESS] * others
    return incentive


# Nine parameters: the arrays of lane_change_incentive.
@njit(cache=True)
def lane_decisions(
    deciding: np.ndarray,
    position: np.ndarray,
    speed: np.ndarray,
    lane: np.ndarray,
    second_lane: np.ndarray,
    length: np.ndarray,
    drivers: np.ndarray,
    mobil: np.ndarray,
    usable: np.ndarray,
) -> np.ndarray:
    """Return the lane that each deciding car wants to be in; its own where it stays.

    A car in the middle of a change (lane and second lane differ) goes on with it and decides nothing. The cars
    decide one after another, from the rear: two of them never want the same gap in the same instant.

    Args:
        deciding: (J,) bool, the cars whose turn it is.
        usable: (J, 2) int, the first and the last lane that each may want.
        position, speed, lane, second_lane, length, drivers: as lane_change_incentive.
        mobil: (J, 3) each driver's, likewise.

    Returns:
        (J,) int, the wanted lanes.
    """
    wanted = lane.copy()
    occupied = second_lane.copy()
    for car in range(len(position)):
        if not deciding[car] or lane[car] != second_lane[car]:
            continue
        best = 0.0
        for target in (lane[car] + 1, lane[car] - 1):  # the left first: it wins a tie
            if target < usable[car, 0] or target > usable[car, 1]:
                continue
            incentive = lane_change_incentive(car, target, position, speed, lane, occupied, length, drivers, mobil[car])
            if incentive > best:
                best = incentive
                wanted[car] = target
        occupied[car] = wanted[car]
    return wanted


def mobil_parameters(politeness: float, gain_threshold: float, safe_braking: float) -> np.ndarray:
    """Return MOBIL's parameters as the array (3,) that this module's functions take."""
    return np.array([politeness, gain_threshold, safe_braking])
