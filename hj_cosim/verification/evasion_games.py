"""The last resort in a game: as a drive has it, `control.spc.last_resort`, without a road to stay on (jitted)."""

import numpy as np
from numba import njit

from hj_cosim.control.problem.safety_problem import available_controls
from hj_cosim.control.spc.duty_breakers import Seen, breach_by, write_car
from hj_cosim.control.spc.escape import NO_MANOEUVRE, PASSED, keep_escape
from hj_cosim.control.spc.evasion import COLUMNS, NO_SHIFT, Held, Motion, Shift, evade
from hj_cosim.control.spc.pursuit import abilities_of
from hj_cosim.reachability.games.highway.breach import DOES_DUTIES, WILL_BREAK
from hj_cosim.verification.game import Game, gripped


@njit(cache=True)
def evaded(
    game: Game,
    robot: np.ndarray,
    others: np.ndarray,
    inputs: np.ndarray,
    asked: tuple[float, float],
    has_escape: bool,
    driven: Shift,
) -> tuple[float, float, Shift]:
    """Return what the evasion makes of a control, ω and a, and the manoeuvre that it drives.

    Args:
        game: what does not change.
        robot: (4,) p_x, p_y, θ, v.
        others: (J, 3) p_x, p_y, v of the other cars.
        inputs: (J, 2) θ_o and a_o with which they were seen last.
        asked: ω, a.
        has_escape: whether one is left after that.
        driven: the manoeuvre that gave the last control.
    """
    at, rows = Motion(robot[0], robot[1], robot[2], robot[3]), np.empty((len(others), COLUMNS))
    count, gravest, can = 0, DOES_DUTIES, abilities_of(game.other)
    for j in range(len(others)):
        x, y, speed = others[j]
        length, width = game.bodies.other_length, game.bodies.other_width
        seen = Seen(x, y, inputs[j, 0], speed, inputs[j, 1], length, width)
        breach = breach_by(game.other, robot[0] - x, robot[1] - y, at, seen)
        gravest = max(gravest, breach)
        count += write_car(game.evader, at, seen, breach != DOES_DUTIES, can, rows[count])
    if gravest == DOES_DUTIES or count == 0:
        return asked[0], asked[1], NO_SHIFT
    held, _, driven = evade(game.evader, at, rows[:count], Held(asked[0], asked[1], game.step), driven)
    box = available_controls(gripped(game.limits, robot[3], game.sideways), robot[2], robot[3], game.bounds, game.step)
    omega, acceleration = min(max(held.omega, box[0]), box[1]), min(max(held.acceleration, box[2]), box[3])
    if gravest == WILL_BREAK and has_escape:
        minded = np.ones(len(others), np.bool_)
        verdict = keep_escape(game.manoeuvres, robot, others, minded, omega, acceleration, game.step, NO_MANOEUVRE)[2]
        if verdict != PASSED:
            return asked[0], asked[1], NO_SHIFT
    return omega, acceleration, driven
