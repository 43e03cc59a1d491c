"""V(0, ·) of the highway game at one state, with its slopes: what look-ups need besides the table (jitted).

The same formula as `systems.highway.target`, which the solver takes, with everything that the parameters settle
worked out beforehand: look-ups evaluate it for every car.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.kernels import kernel

_PARAMETERS = (
    "length",
    "width",
    "response_time",
    "acceleration",
    "brake_min",
    "brake_max",
    "lateral_acceleration",
    "lateral_brake",
    "lateral_margin",
    "turned_length",
)


class TargetFormula(NamedTuple):
    """V(0, x) = max(|p_x| − length − d_long, 4 (|p_y| − width − sticking |sin θ| − d_lat)³), as polynomials.

    d_long = [rear_0 + rear_1 v_rear + rear_2 v_rear² − front_1 v_front − front_2 v_front²]_+
    d_lat  = [lateral_0 + response s + lateral_2 [s + gained]_+²]_+, s the robot's speed towards the other car's side
    """

    length: float  # m
    width: float
    rear_0: float  # m
    rear_1: float  # s
    rear_2: float  # s²/m
    front_2: float
    lateral_0: float  # m, the other car's travel included
    response: float  # s
    gained: float  # m/s, in the response time
    lateral_2: float  # s²/m
    sticking: float  # m, half of what the robot's body is long: by so much times |sin θ| it reaches to either side
    front_1: float  # s; 0 by RSS

    # Ten parameters: the formula's own, by the names that the game has for them.
    @classmethod
    def of(
        cls,
        length: float,
        width: float,
        response_time: float,
        acceleration: float,
        brake_min: float,
        brake_max: float,
        lateral_acceleration: float,
        lateral_brake: float,
        lateral_margin: float,
        turned_length: float,
    ) -> "TargetFormula":
        """Return the formula for the parameters of `systems.highway`."""
        gained = response_time * acceleration
        sideways = response_time * lateral_acceleration
        half_travel = 0.5 * sideways * response_time
        return cls(
            length=length,
            width=width,
            rear_0=0.5 * gained * response_time + gained**2 / (2.0 * brake_min),
            rear_1=response_time + gained / brake_min,
            rear_2=1.0 / (2.0 * brake_min),
            front_2=1.0 / (2.0 * brake_max),
            lateral_0=2.0 * half_travel + sideways**2 / (2.0 * lateral_brake) + lateral_margin,
            response=response_time,
            gained=sideways,
            lateral_2=1.0 / (2.0 * lateral_brake),
            sticking=0.5 * turned_length,
            front_1=0.0,
        )

    @classmethod
    def of_game(cls, parameters: Mapping[str, float]) -> "TargetFormula":
        """Return the formula for all parameters of a highway game, which may be more than it needs.

        A game that has `time_to_collision` (`time_to_collision`) keeps that instead of RSS's distance along the road.
        """
        formula = cls.of(**{name: parameters[name] for name in _PARAMETERS})
        if "time_to_collision" not in parameters:
            return formula
        time, gap = parameters["time_to_collision"], parameters["gap_at_collision"]
        return formula._replace(rear_0=gap, rear_1=time, rear_2=0.0, front_1=time, front_2=0.0)


FORMULA_NUMBERS = len(TargetFormula._fields)


@kernel
def formula_from(numbers: np.ndarray) -> TargetFormula:
    """Return the formula whose FORMULA_NUMBERS these are (`reachability.packing`)."""
    return TargetFormula(*to_fixed_tuple(numbers, FORMULA_NUMBERS))


@kernel
def _longitudinal_gap(formula: TargetFormula, p_x: float, v_r: float, v_o: float) -> tuple[float, float]:
    """Return |p_x| − length − d_long, and d_long; the rear car is the one with the smaller p_x."""
    ahead = p_x > 0.0
    rear, front = (v_o if ahead else v_r), (v_r if ahead else v_o)
    distance = formula.rear_0 + rear * (formula.rear_1 + rear * formula.rear_2)
    distance -= front * (formula.front_1 + front * formula.front_2)
    distance = max(distance, 0.0)
    return abs(p_x) - formula.length - distance, distance


@kernel
def _lateral_distance(formula: TargetFormula, towards: float) -> float:
    after_response = max(towards + formula.gained, 0.0)
    return max(
        formula.lateral_0 + formula.response * towards + formula.lateral_2 * after_response * after_response, 0.0
    )


@kernel
def _side_of(p_y: float, leftwards: float) -> float:
    """Return 1 if the robot is on the left of the other car, else −1; at p_y = 0 the side that it moves away from."""
    if p_y == 0.0:
        return -1.0 if leftwards > 0.0 else 1.0
    return 1.0 if p_y > 0.0 else -1.0


@kernel
def target_at(formula: TargetFormula, p_x: float, p_y: float, theta: float, v_r: float, v_o: float) -> float:
    """Return V(0, x), m."""
    gap_x, _ = _longitudinal_gap(formula, p_x, v_r, v_o)
    beside = abs(p_y) - formula.width
    if gap_x >= 4.0 * beside * beside * beside:  # whatever d_lat is: spares the sine
        return gap_x
    sin = math.sin(theta)
    leftwards = v_r * sin
    gap_y = beside - formula.sticking * abs(sin) - _lateral_distance(formula, -_side_of(p_y, leftwards) * leftwards)
    return max(gap_x, 4.0 * gap_y * gap_y * gap_y)


class Term(NamedTuple):
    """One of the two distances of V(0, ·), m, and its slopes, per state unit."""

    value: float
    by_x: float
    by_y: float
    by_theta: float
    by_r: float
    by_o: float


@kernel
def _lateral_term(formula: TargetFormula, p_y: float, theta: float, v_r: float) -> Term:
    """Return 4 (|p_y| − width − …)³; at p_y = 0 of the side that the robot moves away from, flat where [·]_+ begins."""
    sin = math.sin(theta)
    leftwards = v_r * sin
    side = _side_of(p_y, leftwards)
    towards = -side * leftwards
    lateral = _lateral_distance(formula, towards)
    gap = abs(p_y) - formula.width - formula.sticking * abs(sin) - lateral
    steep = 12.0 * gap * gap
    rise = side * steep * (formula.response + 2.0 * formula.lateral_2 * max(towards + formula.gained, 0.0))
    by_leftwards = rise if lateral > 0.0 else 0.0
    turning = -steep * formula.sticking * (math.copysign(1.0, sin) if sin != 0.0 else 0.0)
    by_theta = (by_leftwards * v_r + turning) * math.cos(theta)
    return Term(4.0 * gap * gap * gap, 0.0, steep * side, by_theta, by_leftwards * sin, 0.0)


@kernel
def _longitudinal_term(formula: TargetFormula, p_x: float, v_r: float, v_o: float) -> Term:
    """Return |p_x| − length − d_long; at p_x = 0 of a robot behind, flat where [·]_+ begins."""
    gap, longitudinal = _longitudinal_gap(formula, p_x, v_r, v_o)
    ahead = p_x > 0.0
    rear, front = (v_o if ahead else v_r), (v_r if ahead else v_o)
    grows = 1.0 if longitudinal > 0.0 else 0.0
    by_rear = -grows * (formula.rear_1 + 2.0 * formula.rear_2 * rear)
    by_front = grows * (formula.front_1 + 2.0 * formula.front_2 * front)
    if ahead:
        return Term(gap, 1.0, 0.0, 0.0, by_front, by_rear)
    return Term(gap, -1.0, 0.0, 0.0, by_rear, by_front)


@kernel
def terms_at(formula: TargetFormula, p_x: float, p_y: float, theta: float, v_r: float, v_o: float) -> tuple[Term, Term]:
    """Return both terms of V(0, x), the greater one, which it is, first."""
    along, across = _longitudinal_term(formula, p_x, v_r, v_o), _lateral_term(formula, p_y, theta, v_r)
    return (along, across) if along.value >= across.value else (across, along)


@kernel
def target_and_gradient_at(
    formula: TargetFormula, p_x: float, p_y: float, theta: float, v_r: float, v_o: float
) -> Term:
    """Return V(0, x) and its five slopes: those of the term along the road where both are equal."""
    along = _longitudinal_term(formula, p_x, v_r, v_o)
    beside = abs(p_y) - formula.width
    if along.value >= 4.0 * beside * beside * beside:  # whatever d_lat is: spares the sine
        return along
    across = _lateral_term(formula, p_y, theta, v_r)
    return along if along.value >= across.value else across
