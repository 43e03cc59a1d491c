"""Simulates a robot under safety-preserving control among other cars, many times: the jitted part of the guarantee.

Jitted, because a rollout is 500 look-ups with gradient and as many problems; the problem is solved by enumeration,
which is exact (`enumeration.least_cost_control`).
"""

import math

import numpy as np
from numba import njit

from hj_cosim.control.problem.enumeration import least_cost_control
from hj_cosim.control.problem.safety_problem import available_controls
from hj_cosim.control.spc.approach import NOT_NEEDED, begun_row
from hj_cosim.control.spc.escape import NO_ESCAPE, NO_MANOEUVRE, is_to_be_looked_at, keep_escape
from hj_cosim.control.spc.evasion import NO_SHIFT
from hj_cosim.reachability.games.highway.other_car import Disturbance, allowed, worst_heading_sine
from hj_cosim.reachability.games.highway.rows import write_row
from hj_cosim.reachability.table.lookup import shift_of_grid, smooth_gradient_at, value_and_gradient_at
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for
from hj_cosim.vehicles.idm import idm_acceleration
from hj_cosim.verification.bodies import bodies_overlap
from hj_cosim.verification.evasion_games import evaded
from hj_cosim.verification.game import Game, bent, curvature_at, game_step, gripped

RANDOM_HOLD = 25  # steps for which a random desire lasts
CRUISE, RANDOM, COLLIDE = 0, 1, 2  # desires


@njit(cache=True)
def _worst_inputs(gradient: np.ndarray, state: np.ndarray, other: Disturbance) -> tuple[float, float]:
    """Return (θ_o, a_o) that lower V most."""
    may = allowed(other, state[0], state[1], state[3] * math.sin(state[2]), state[3], state[4])
    heading = math.asin(worst_heading_sine(may, gradient[0], gradient[1]))
    return heading, may.least if gradient[4] > 0.0 else may.most


@njit(cache=True)
def _gradient_within(game: Game, state: np.ndarray, gradient: np.ndarray) -> float:
    """Return V, and write ∇V; beyond the table V is +inf, and the gradient that of the nearest place on its edge."""
    grid = game.table.grid
    low, cells = grid.lower, grid.shape
    rear = low[0] + shift_of_grid(grid, state[3], state[4])
    x = min(max(state[0], rear), rear + (cells[0] - 1) / grid.inverse_spacing[0])
    y = min(max(state[1], low[1]), low[1] + (cells[1] - 1) / grid.inverse_spacing[1])
    value = value_and_gradient_at(game.table.flat, grid, x, y, state[2], state[3], state[4], gradient)
    return value if x == state[0] and y == state[1] else math.inf


@njit(cache=True)
def world_pose(
    curvature: float, ahead: float, lateral: float, other_lateral: float, theta: float
) -> tuple[float, float, float]:
    """Return where the robot is in the world, from another car that goes along the road: x, y (m) and heading (rad).

    Args:
        curvature: of the road at d = 0 between the two, 1/m.
        ahead: m of s from the other car to the robot.
        lateral, other_lateral: d of the robot and of the other car, m.
        theta: heading of the robot against the road at its own s, rad.
    """
    if curvature == 0.0:
        return ahead, lateral - other_lateral, theta
    turned = curvature * ahead
    inwards = 2.0 / curvature * math.sin(0.5 * turned) ** 2  # how far the road at d = 0 has come to the left
    return (
        (1.0 / curvature - lateral) * math.sin(turned),
        inwards + lateral * math.cos(turned) - other_lateral,
        turned + theta,
    )


@njit(cache=True)
def where_bodies_overlap_in_world(game: Game, states: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return at which states they do on the road as it bends, (n,) bool.

    Between two bodies that are near enough to touch, a road has one curvature to some millimetres.

    Args:
        game: its road and bodies.
        states: (n, 5) relative states, in the road frame.
        places: (n, 2) s and d of the robot, m.
    """
    found = np.zeros(len(states), np.bool_)
    reach = sum(game.bodies)
    for i in range(len(states)):
        ahead, lateral = states[i, 0], places[i, 1]
        if abs(ahead) < reach:
            curvature = curvature_at(game, places[i, 0] - 0.5 * ahead)
            x, y, heading = world_pose(curvature, ahead, lateral, lateral - states[i, 1], states[i, 2])
            found[i] = bodies_overlap(x, y, heading, game.bodies)
    return found


@njit(cache=True)
def _desired_control(
    game: Game, desire: int, sample: int, heading: float, slope: np.ndarray, random: np.ndarray
) -> tuple[float, float]:
    """Return (ω, a) that the filter is asked for; `slope` is (∂V/∂θ, ∂V/∂v) of the least V."""
    limits = game.limits
    if desire == CRUISE:
        return min(max(-game.k_theta * heading, limits[0]), limits[1]), 0.0
    if desire == RANDOM:
        return random[sample // RANDOM_HOLD, 0], random[sample // RANDOM_HOLD, 1]
    return (limits[0] if slope[0] > 0.0 else limits[1]), (limits[2] if slope[1] > 0.0 else limits[3])


# Ten parameters: the last three are arrays to write into, so that a chunk of games allocates nothing.
@njit(cache=True, nogil=True)
def _roll_out(
    game: Game,
    desire: int,
    bicycle: bool,
    adversarial: bool,
    robot: np.ndarray,
    others: np.ndarray,
    random: np.ndarray,
    states: np.ndarray,
    values: np.ndarray,
    slack: np.ndarray,
) -> None:
    """Simulate one rollout.

    Args:
        game: what does not change.
        desire, bicycle, adversarial: of RolloutSettings.
        robot: (4,) p_x, p_y, θ, v; overwritten.
        others: (cars, 3) x, y, v_o; overwritten.
        random: (holds, 2) random desires (ω, a), each held for RANDOM_HOLD steps.
        states: (samples + 1, cars, 7) float32, written: relative states, and s and d of the robot.
        values: (samples + 1, cars) float32, written: V.
        slack: (samples,) float32, written: t of the control; NaN where K is empty.
    """
    cars, samples = others.shape[0], slack.shape[0]
    gradients = np.empty((cars, 5))
    p, q, c = np.empty(cars), np.empty(cars), np.empty(cars)
    looked_at, in_k = np.empty(cars, np.int64), np.empty(cars, np.bool_)
    relative, steepest, row, looked_up = np.empty(5), np.zeros(2), np.empty(8), np.empty(cars)
    slopes = np.empty(5)
    cruising = others[:, 2].copy()
    previous_omega, driven, evading, has_escape = 0.0, NO_MANOEUVRE, NO_SHIFT, True
    inputs = np.zeros((cars, 2))  # at first all go straight on
    for sample in range(samples + 1):
        count, near, least = 0, 0, math.inf
        limits = gripped(game.limits, robot[3], game.sideways)
        for j in range(cars):
            relative[0], relative[1] = robot[0] - others[j, 0], robot[1] - others[j, 1]
            relative[2], relative[3], relative[4] = robot[2], robot[3], others[j, 2]
            value = _gradient_within(game, relative, gradients[j])
            for axis in range(5):  # `states[sample, j, :5] = relative` would take 2 s more to compile
                states[sample, j, axis] = relative[axis]
            states[sample, j, 5], states[sample, j, 6] = robot[0], robot[1]
            values[sample, j], looked_up[j] = value, value
            if j == 0 or value < least:
                least = value
                steepest[0], steepest[1] = gradients[j, 2], gradients[j, 3]
            in_k[j] = value <= game.epsilon
            if is_to_be_looked_at(game.extent, value, relative[0], relative[1], relative[3], relative[4]):
                looked_at[near] = j
                near += 1
        if sample == samples:
            break
        omega, acceleration = _desired_control(game, desire, sample, robot[2], steepest, random)
        box = available_controls(limits, robot[2], robot[3], game.bounds, game.step)
        omega = min(max(omega, box[0]), box[1])
        acceleration = min(max(acceleration, box[2]), box[3])
        for j in range(cars):
            if in_k[j] or (game.approach > 0.0 and values[sample, j] < math.inf):
                relative[0], relative[1] = robot[0] - others[j, 0], robot[1] - others[j, 1]
                relative[2], relative[3], relative[4] = robot[2], robot[3], others[j, 2]
                for axis in range(5):
                    slopes[axis] = gradients[j, axis]  # the worst inputs go by the table's own
                if game.smooth:
                    smooth_gradient_at(
                        game.table.flat,
                        game.table.grid,
                        relative[0],
                        relative[1],
                        relative[2],
                        relative[3],
                        relative[4],
                        slopes,
                    )
                write_row(game.table.grid.target, game.other, relative, looked_up[j], slopes, row)
                begins = begun_row(row, game.epsilon, game.recovery, game.approach, box, omega, acceleration)
                if begins != NOT_NEEDED:
                    p[count], q[count], c[count] = row[begins + 1], row[begins + 2], row[begins + 3]
                    count += 1
        slack[sample] = np.nan
        if count > 0:
            wanted = previous_omega if game.slack_is_free else omega
            omega, acceleration, slack[sample] = least_cost_control(
                p[:count], q[:count], c[:count], wanted, acceleration, game.weights, game.slack_is_free, box
            )
        if near > 0 and len(game.manoeuvres.heading) > 0:
            among = looked_at[:near]
            omega, acceleration, verdict, driven = keep_escape(
                game.manoeuvres, robot, others[among], in_k[among], omega, acceleration, game.step, driven
            )
            omega = min(max(omega, box[0]), box[1])
            acceleration = min(max(acceleration, box[2]), box[3])
            has_escape = verdict != NO_ESCAPE
        if game.evades:
            asked = (omega, acceleration)
            omega, acceleration, evading = evaded(game, robot, others, inputs, asked, has_escape, evading)
            if not math.isnan(evading.lateral):
                driven = NO_MANOEUVRE
        previous_omega = omega
        for j in range(cars):
            if adversarial:
                relative[0], relative[1] = robot[0] - others[j, 0], robot[1] - others[j, 1]
                relative[2], relative[3], relative[4] = robot[2], robot[3], others[j, 2]
                heading, other_acceleration = _worst_inputs(gradients[j], relative, game.played)
            else:
                ahead = robot[0] - others[j, 0]
                in_lane = ahead > 0.0 and abs(robot[1] - others[j, 1]) < 0.5 * (
                    game.bodies.width + game.bodies.other_width
                )
                gap = ahead - 0.5 * (game.bodies.length + game.bodies.other_length) if in_lane else math.inf
                game.driver[0] = max(cruising[j], 1.0)  # IDM's desired speed: its own at the start
                heading = 0.0
                other_acceleration = max(
                    idm_acceleration(others[j, 2], gap, robot[3], game.driver), game.other.acceleration_min
                )
            inputs[j, 0], inputs[j, 1] = heading, other_acceleration
            end = min(max(others[j, 2] + other_acceleration * game.step, 0.0), game.other_speed_max)
            way = 0.5 * (others[j, 2] + end) * game.step
            others[j, 0] = bent(game, others[j, 0], others[j, 0] + way * math.cos(heading), others[j, 1])
            others[j, 1] += way * math.sin(heading)
            others[j, 2] = end
        came_from, was_at = robot[0], robot[1]
        if bicycle:
            steering = steering_for(omega, robot[3], game.wheelbase)
            moved = bicycle_step(robot, steering, acceleration, game.wheelbase, game.bounds[3], game.step)
            for axis in range(4):
                robot[axis] = moved[axis]
        else:
            game_step(robot, omega, acceleration, game.bounds[3], game.step)
        robot[0] = bent(game, came_from, robot[0], 0.5 * (was_at + robot[1]))


# Ten parameters: those of _roll_out.
def roll_out_all(
    game: Game,
    desire: int,
    bicycle: bool,
    adversarial: bool,
    robots: np.ndarray,
    others: np.ndarray,
    random: np.ndarray,
    states: np.ndarray,
    values: np.ndarray,
    slack: np.ndarray,
) -> None:
    """Simulate n rollouts; every array has n rows of what _roll_out takes. Python calls them: each takes a while."""
    for i in range(len(robots)):
        _roll_out(game, desire, bicycle, adversarial, robots[i], others[i], random[i], states[i], values[i], slack[i])
