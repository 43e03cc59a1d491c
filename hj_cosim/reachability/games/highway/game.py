"""The paper's game: the robot and one other car on a highway (paper, eq. case study relative dynamics).

    x = (p_x, p_y, θ, v_r, v_o), positions robot − other, θ the robot's heading
    dp_x = v_r cos θ − v_o cos θ_o,  dp_y = v_r sin θ − v_o sin θ_o,  dθ = ω_r,  dv_r = a_r,  dv_o = a_o

The robot chooses (ω_r, a_r) to maximise, the other car (θ_o, a_o) to minimise the value.

The grid may be sheared: with k = `braking_shear` its first axis is ξ = p_x − k (v_o² − v_r²) instead of p_x. With
k = 1/(2 b), b the braking that RSS counts on, ξ is the distance that would be left had both cars braked to a stop.
RSS's distances move by 20 m in p_x from one node of the speeds to the next, and hardly at all in ξ. So the corner of
V0 where the two terms of its maximum meet runs along the grid, and is not smeared over the cells of two more axes.
`target`, `hamiltonian` and `dissipation`, which the solver calls, take the grid's coordinates and the slopes along
them; `flow` and `optimal_inputs` take the state. Without a shear, the default, the two are the same.
"""

import math

import numpy as np

from hj_cosim.reachability.games.contract import TWO_CARS, BrakingShear, Game, ManoeuvreBounds, state_function
from hj_cosim.reachability.games.highway.manoeuvre_cap import capped
from hj_cosim.reachability.games.highway.manoeuvres import lower_bounds, manoeuvres_of
from hj_cosim.reachability.games.highway.other_car import (
    Disturbance,
    allowed,
    available_acceleration,
    worst_heading_sine,
)
from hj_cosim.reachability.games.highway.pair import of_pair
from hj_cosim.reachability.games.highway.parameters import PARAMETERS
from hj_cosim.reachability.games.highway.rows import closed_rows
from hj_cosim.reachability.games.highway.target import TargetFormula
from hj_cosim.vehicles.rss import lateral_distance, longitudinal_distance


@state_function
def target(x, c, out):  # type: ignore[no-untyped-def]
    """V(0, x) = max(|p_x| − d_long, 4 (|p_y| − d_lat)³), distances between bumpers (paper, eq. case study V0).

    The rear car is the one with the smaller p_x. d_lat counts the robot's lateral speed v_r sin θ towards the other
    car, and none of the other car's own; the robot's body counts as turned where `turned_length` says so.
    """
    length, width, response, acceleration, brake_min, brake_max = c[6], c[7], c[8], c[9], c[10], c[11]
    lateral_acceleration, lateral_brake, margin = c[12], c[13], c[14]
    for i in range(out.shape[0]):
        p_x = x[0, i] + c[15] * (x[4, i] * x[4, i] - x[3, i] * x[3, i])
        rear, front = (x[4, i], x[3, i]) if p_x > 0.0 else (x[3, i], x[4, i])
        longitudinal = longitudinal_distance(rear, front, response, acceleration, brake_min, brake_max)
        # The robot on the left, p_y > 0, approaches the other car by moving to the right; straight ahead of it or
        # behind, either way counts as approaching. The other car counts with no lateral speed.
        leftwards = x[3, i] * math.sin(x[2, i])
        towards = abs(leftwards) if x[1, i] == 0.0 else -math.copysign(leftwards, leftwards * x[1, i])
        lateral = lateral_distance(
            towards, 0.0, response, lateral_acceleration, lateral_brake,
            response, lateral_acceleration, lateral_brake, margin,
        )  # fmt: skip
        gap_x = abs(p_x) - length - longitudinal
        turned = np.float32(0.5) * c[21] * abs(math.sin(x[2, i]))
        gap_y = abs(x[1, i]) - width - turned - lateral
        out[i] = max(gap_x, 4.0 * gap_y**3)


@state_function
def flow(x, u, d, c, out):  # type: ignore[no-untyped-def]
    """dx/dt for u = (ω_r, a_r), d = (θ_o, a_o)."""
    for i in range(out.shape[1]):
        out[0, i] = x[3, i] * math.cos(x[2, i]) - x[4, i] * math.cos(d[0, i])
        out[1, i] = x[3, i] * math.sin(x[2, i]) - x[4, i] * math.sin(d[0, i])
        out[2, i] = u[0, i]
        out[3, i] = u[1, i]
        out[4, i] = d[1, i]


@state_function
def hamiltonian(x, p, c, limits, out):  # type: ignore[no-untyped-def]
    """max over (ω_r, a_r), min over (θ_o, a_o) of p · dx/dt in closed form.

    The other car's heading maximises p_x cos θ_o + p_y sin θ_o within what is allowed: it points along (p_x, p_y) where
    that lies within the bounds, which makes the norm, and else along the nearer bound. On a sheared grid,
    dξ = dp_x − 2 k (v_o a_o − v_r a_r), so that the accelerations' slopes take a share of ξ's.
    """
    heading, v_r = x[2, 0], x[3, 0]  # shared by the nodes of a slab
    # At a limit of the state the input that would cross it is not available.
    zero, one = np.float32(0.0), np.float32(1.0)
    turning_max = _turning_max(c, v_r)
    omega_low = zero if heading <= limits[0, 2] else -turning_max
    omega_high = zero if heading >= limits[1, 2] else turning_max
    robot_low = zero if v_r <= limits[0, 3] else c[1]
    robot_high = zero if v_r >= limits[1, 3] else c[2]
    twice_shear = np.float32(2.0) * c[15]
    robot_share = twice_shear * v_r
    forward, leftward = np.float32(v_r * math.cos(heading)), np.float32(v_r * math.sin(heading))
    assumed = _disturbance(c)
    for i in range(out.shape[0]):
        p_x, p_y, v_o = p[0, i], p[1, i], x[4, i]
        along = x[0, i] + c[15] * (v_o * v_o - v_r * v_r)
        may = allowed(assumed, along, x[1, i], leftward, v_r, v_o)
        # Branches as selects, so that the loop runs in SIMD.
        left, right = may.left, may.right
        at_left, at_right = p_x * np.sqrt(one - left * left), p_x * np.sqrt(one - right * right)
        at_bound = max(at_left + p_y * left, at_right + p_y * right)
        length = np.sqrt(p_x * p_x + p_y * p_y)
        other = length if (p_x > zero) & (p_y <= left * length) & (p_y >= right * length) else at_bound
        turning = omega_high * p[2, i] if p[2, i] > zero else omega_low * p[2, i]
        by_robot = p[3, i] + robot_share * p_x
        robot = robot_high * by_robot if by_robot > zero else robot_low * by_robot
        by_other = p[4, i] - twice_shear * v_o * p_x
        least, most = available_acceleration(may, v_o, limits[0, 4], limits[1, 4])
        other_speed = least * by_other if by_other > zero else most * by_other
        out[i] = forward * p_x + leftward * p_y - v_o * other + turning + robot + other_speed


@state_function
def _turning_max(c, v_r):  # type: ignore[no-untyped-def]
    """The largest |ω_r| at a speed: the robot's limit, and what its tyres hold."""
    return min(c[0], c[16] / max(v_r, np.float32(1e-3)))


@state_function
def _disturbance(c):  # type: ignore[no-untyped-def]
    """What the other car is assumed to do, of the parameters."""
    return Disturbance(c[3], c[4], c[5], c[17] != 0.0, c[6], c[7], c[9], c[10], c[11], c[18], c[19], c[20])


@state_function
def dissipation(x, c, out):  # type: ignore[no-untyped-def]
    """Tight bounds: dp_x over cos θ_o in [cos θ̄, 1], dp_y over sin θ_o in ± sin θ̄, and the inputs' magnitudes.

    On a sheared grid dξ over the accelerations, too.
    """
    heading, v_r, heading_max = x[2, 0], x[3, 0], c[3]  # the first two are shared by the nodes of a slab
    forward, sideways = np.float32(v_r * math.cos(heading)), np.float32(abs(v_r * math.sin(heading)))
    cos_bound, sin_bound = np.float32(math.cos(heading_max)), np.float32(math.sin(heading_max))
    turning, robot, other = _turning_max(c, v_r), max(-c[1], c[2]), max(-c[4], c[5])
    twice_shear = np.float32(2.0) * c[15]
    fastest, slowest = forward + twice_shear * v_r * c[2], forward + twice_shear * v_r * c[1]
    for i in range(out.shape[1]):
        v_o = x[4, i]
        closest, farthest = v_o * (cos_bound + twice_shear * c[4]), v_o * (np.float32(1.0) + twice_shear * c[5])
        out[0, i] = max(abs(fastest - closest), abs(slowest - farthest))
        out[1, i] = sideways + v_o * sin_bound
        out[2, i] = turning
        out[3, i] = robot
        out[4, i] = other


@state_function
def optimal_inputs(x, p, c, limits, u, d):  # type: ignore[no-untyped-def]
    """The inputs that attain the Hamiltonian; where an input does not matter it is 0."""
    assumed = _disturbance(c)
    for i in range(u.shape[1]):
        heading, v_r, v_o = x[2, i], x[3, i], x[4, i]
        turning_max = _turning_max(c, v_r)
        u[0, i] = _box_maximiser(p[2, i], heading, limits[0, 2], limits[1, 2], -turning_max, turning_max)
        u[1, i] = _box_maximiser(p[3, i], v_r, limits[0, 3], limits[1, 3], c[1], c[2])
        may = allowed(assumed, x[0, i], x[1, i], v_r * math.sin(heading), v_r, v_o)
        d[0, i] = 0.0 if p[0, i] == 0.0 and p[1, i] == 0.0 else math.asin(worst_heading_sine(may, p[0, i], p[1, i]))
        least, most = available_acceleration(may, v_o, limits[0, 4], limits[1, 4])
        by_other = p[4, i]
        d[1, i] = least if by_other > 0.0 else (most if by_other < 0.0 else min(max(0.0, least), most))


@state_function
def _box_maximiser(slope, state, state_low, state_high, low, high):  # type: ignore[no-untyped-def]
    """The input in [low, high] that maximises slope · input, without leaving [state_low, state_high]."""
    if slope > 0.0:
        return high if state < state_high else np.float32(0.0)
    if slope < 0.0:
        return low if state > state_low else np.float32(0.0)
    return np.float32(0.0)


game = Game(
    name="highway",
    state=TWO_CARS,
    controls=("omega_r", "a_r"),
    disturbances=("theta_o", "a_o"),
    parameters=PARAMETERS,
    target=target,
    flow=flow,
    hamiltonian=hamiltonian,
    dissipation=dissipation,
    optimal_inputs=optimal_inputs,
    boundary=("linear",) * 5,
    outside=("safe", "safe", "clamp", "clamp", "clamp"),
    limited=(False, False, True, True, True),
    slab_axes=(4, 0),
    mirrored_axes=(1, 2),
    angles=("theta",),
    # The paper's figure of the value function: both cars parallel, the robot at 10 m/s, the other at 20 m/s.
    drawn_at={"theta": 0.0, "v_r": 10.0, "v_o": 20.0},
    shear=BrakingShear("braking_shear"),
    target_formula=TargetFormula.of_game,
    closed_rows=closed_rows,
    manoeuvres=ManoeuvreBounds(of_game=manoeuvres_of, lower_bounds=lower_bounds, capped=capped),
    of_pair=of_pair,
)
