"""What the other car of the highway game is assumed to do at the worst (jitted).

There are two assumptions. `worst`, the paper's: anything within its limits, always. `responsible`, after the duties of
RSS (Shalev-Shwartz, Shammah & Shashua 2017) and the reasonably foreseeable behaviour of IEEE 2846-2022, within the
same limits:

- Who follows answers for the distance. A car behind, on a path that leaves less than `side_margin` beside the robot,
  does not accelerate into the distance that RSS asks of it, and brakes with b_min once that is violated. The response
  time is its own, `other_response_time`, and it leaves `standing_gap` besides.
- Who is beside stays there. A car does not steer into the `side_margin` next to the robot's side.
- Who cuts in leaves room: it comes nearer than that only where ahead of or behind the robot the same distance is kept.

A car ahead may brake with all it has at any moment. A robot that moves towards somebody's lane takes that room itself:
those behind are not bound until it is in the lane. Each duty sets in over some metres, so that the Hamiltonian is
continuous in the state.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, cast

import numpy as np
from numba import njit
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.errors import TableError
from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.contract import FLOATING_POINT

# The solver asks for a state at every node, in single precision and in SIMD. So the constants are of single precision,
# which leaves a double what it is, and what differs from state to state is selected rather than branched to.
_single = cast(Callable[[float], float], np.float32)
_ZERO, _HALF, _ONE = _single(0.0), _single(0.5), _single(1.0)

# m, over which the duties of who follows, who cuts in and who is beside set in.
FOLLOWING, CUTTING_IN, BESIDE = _single(4.0), _single(2.0), _single(0.5)
# m between the lines of travel: up to the first a follower is bound whatever the robot does, beyond the second only by
# a robot that does not move towards it.
IN_LANE, OUT_OF_LANE = _single(1.0), _single(1.75)
# m/s towards the other's line: up to the first a robot keeps its place, from the second on it changes lanes.
STAYING, MOVING = _single(0.2), _single(0.7)
# m of p_y, up to which the robot is partly straight ahead: there the other has it on neither side.
STRAIGHT_AHEAD = _single(0.5)

_PARAMETERS = ("other_heading_max", "other_acceleration_min", "other_acceleration_max")


# What the duties need, and the parameter of the game that it is.
_DUTIES = {
    "length": "length",
    "width": "width",
    "acceleration": "acceleration",
    "brake_min": "brake_min",
    "brake_max": "brake_max",
    "response_time": "other_response_time",
    "standing_gap": "standing_gap",
    "side_margin": "side_margin",
}


class Disturbance(NamedTuple):
    """The other car's controls w_o, as the value table assumes them; a NamedTuple, so that kernels take it."""

    heading_max: float  # θ̄, rad
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²
    responsible: bool = False  # whether it does its duties, which need what follows
    length: float = 5.0  # m, of RSS's gaps
    width: float = 2.0  # m
    acceleration: float = 3.0  # m/s², a_accel of RSS
    brake_min: float = 6.0  # m/s², b_min
    brake_max: float = 6.0  # m/s², b_max
    response_time: float = 1.0  # s, the other's
    standing_gap: float = 2.0  # m
    side_margin: float = 1.0  # m

    @classmethod
    def of_game(cls, parameters: Mapping[str, float]) -> "Disturbance":
        """Return the assumption of a highway game with these parameters, all of them.

        Raises:
            TableError: if they are the parameters of another game.
        """
        missing = [name for name in _PARAMETERS if name not in parameters]
        if missing:
            raise TableError(f"the game has no parameter {missing[0]}, which limits the other car in a highway game")
        return cls(
            heading_max=parameters["other_heading_max"],
            acceleration_min=parameters["other_acceleration_min"],
            acceleration_max=parameters["other_acceleration_max"],
            responsible=parameters.get("responsible", 0.0) != 0.0,
            **{name: parameters[of] for name, of in _DUTIES.items() if of in parameters},
        )


_OF_DUTIES = len(Disturbance._fields) - 4  # numbers


@kernel
def disturbance_from(numbers: np.ndarray) -> Disturbance:
    """Return the assumption whose numbers these are (`reachability.packing`)."""
    low, high, gain = numbers[0], numbers[1], numbers[2]
    return Disturbance(low, high, gain, numbers[3] != 0.0, *to_fixed_tuple(numbers[4:], _OF_DUTIES))


class Allowed(NamedTuple):
    """What the other car may do in one state."""

    right: float  # the least sin θ_o
    left: float  # the greatest
    least: float  # of a_o, m/s²
    most: float


@njit(cache=True, forceinline=True, fastmath=FLOATING_POINT)
def ramp(value: float, none: float, full: float) -> float:
    """Return 0 at `none`, 1 at `full`, linear between, constant beyond."""
    share = (value - none) / (full - none)
    share = _ZERO if share < _ZERO else share
    return _ONE if share > _ONE else share


@njit(cache=True, forceinline=True, fastmath=FLOATING_POINT)
def kept_room(other: Disturbance, gap: float, rear: float, front: float) -> float:
    """Return what is left of a gap (m, bumper to bumper) beside the distance that the other car keeps."""
    after = rear + other.response_time * other.acceleration
    distance = (
        _HALF * (rear + after) * other.response_time
        + after * after * (_HALF / other.brake_min)
        - front * front * (_HALF / other.brake_max)
    )
    return gap - other.standing_gap - (distance if distance > _ZERO else _ZERO)


@njit(cache=True, forceinline=True, fastmath=FLOATING_POINT)
def allowed(other: Disturbance, p_x: float, p_y: float, leftwards: float, v_r: float, v_o: float) -> Allowed:
    """Return what the other car may do in a state of the game.

    Whoever judges the other car's inputs asks here: Hamiltonian, optimal inputs, half-planes, rollouts and adversary.

    Args:
        other: the assumption.
        p_x, p_y: robot − other, m.
        leftwards: v_r sin θ of the robot, m/s.
        v_r, v_o: m/s.
    """
    does_duties = _ONE if other.responsible else _ZERO
    behind = p_x > _ZERO  # the other one is
    rear = v_o if behind else v_r
    front = v_r if behind else v_o
    room = kept_room(other, abs(p_x) - other.length, rear, front)
    beside = abs(p_y)
    near = _ONE - ramp(beside - other.width, other.side_margin, other.side_margin + BESIDE)
    towards = -leftwards if p_y > _ZERO else leftwards
    in_lane = _ONE - ramp(beside, IN_LANE, OUT_OF_LANE)
    staying = near * (_ONE - ramp(towards, STAYING, MOVING))
    following = (in_lane if in_lane > staying else staying) * (_ONE - ramp(room, _ZERO, FOLLOWING))
    bound = does_duties * (following if behind else _ZERO)
    withheld = does_duties * near * (_ONE - ramp(room, _ZERO, CUTTING_IN))
    sine, most = np.sin(other.heading_max), other.acceleration_max
    return Allowed(
        -sine * (_ONE - withheld * ramp(-p_y, _ZERO, STRAIGHT_AHEAD)),
        sine * (_ONE - withheld * ramp(p_y, _ZERO, STRAIGHT_AHEAD)),
        other.acceleration_min,
        most - bound * (most + other.brake_min),
    )


@kernel
def worst_heading_sine(limits: Allowed, along: float, across: float) -> float:
    """Return sin θ_o of the heading within its limits that makes along · cos θ_o + across · sin θ_o the greatest."""
    length = math.hypot(along, across)
    if along > 0.0 and limits.right * length <= across <= limits.left * length:
        return across / length
    at_right = along * math.sqrt(1.0 - limits.right * limits.right) + across * limits.right
    at_left = along * math.sqrt(1.0 - limits.left * limits.left) + across * limits.left
    return limits.right if at_right > at_left else limits.left


@njit(cache=True, forceinline=True, fastmath=FLOATING_POINT)
def available_acceleration(limits: Allowed, v_o: float, slowest: float, fastest: float) -> tuple[float, float]:
    """Return the least and greatest a_o, m/s², that keep v_o within its limits, m/s; a car that stands stays there."""
    least = _ZERO if (v_o <= slowest) & (limits.least < _ZERO) else limits.least
    most = _ZERO if (v_o >= fastest) & (limits.most > _ZERO) else limits.most
    return least, most if most > least else least
