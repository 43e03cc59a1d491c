"""The suite for games: ours pass it, a game in a file too, and each mistake that it looks for fails in a sentence."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from test_readmes import blocks, readme

from hj_cosim.errors import ConfigurationError
from hj_cosim.locations import specifications_folder
from hj_cosim.reachability.games.catalogue import find_game, registered_games
from hj_cosim.reachability.games.contract import BrakingShear, state_function
from hj_cosim.reachability.games.highway.target import TargetFormula, target_and_gradient_at
from hj_cosim.testing import ContractError, check_game, game_extras

SPECIFICATIONS = sorted(path.stem for path in specifications_folder().glob("*.toml"))


@pytest.mark.parametrize("name", SPECIFICATIONS)
def test_our_games_pass_with_every_specification_of_theirs(name):
    check_game(name)


@pytest.mark.parametrize("name", registered_games())
def test_our_games_pass_as_they_are(name):
    check_game(find_game(name))


def test_a_game_of_ones_own_passes_by_its_file_and_by_its_specification(tmp_path, monkeypatch):
    for name, block in blocks(readme("value_tables")).items():
        (tmp_path / name).write_text(block)
    monkeypatch.chdir(tmp_path)
    check_game("walker.py")
    check_game(str(Path("my_spec.toml").resolve()))


def brake(**changed):
    """Return the game of a point that brakes, with something else in place of some of it."""
    return dataclasses.replace(find_game("double_integrator"), **changed)


def but(name, after, game="double_integrator"):
    """Return a game one of whose functions goes on with `after(arguments)` once it has answered."""
    whole = find_game(game)

    def changed(*arguments):
        getattr(whole, name)(*arguments)
        after(*arguments)

    return dataclasses.replace(whole, **{name: changed})


class Answers:
    given = 0


def count_up(x, c, out):
    Answers.given += 1
    out[:] = Answers.given


def first_alone(x, c, out):
    out[:] = abs(x[0, 0]) - c[1]


def beyond(x, c, out):
    out[:] = x[2, 0]


def half_written(x, u, d, c, out):
    out[0] = x[1]


def untyped(x, c, out):
    out[:] = nothing_of_this_name  # noqa: F821


def raises(x, c, out):
    raise KeyError("half_width")


def infinite(x, c, out):
    out[:] = np.inf


def writes_to_its_states(x, c, out):
    x[0] = 0.0
    out[:] = 0.0


def lazy_inputs(x, p, c, limits, u, d):
    u[0] = 0.0


def slopes_of_the_first(x, p, c, limits, out):
    out[:] = p[0] * x[1, 0] + c[0] * np.abs(p[1])


def downhill(x, p, c, limits, u, d):
    u[0] = -c[0] * np.sign(p[1])


def falls(x, p, c, limits, out):
    out[:] = p[0] * x[1] - c[0] * np.abs(p[1])


def uphill(x, p, c, limits, u, d):
    u[0] = c[0] * np.sign(p[1])


def rises(x, p, c, limits, out):
    out[:] = p[0] * x[1] + c[0] * np.abs(p[1])


def plausible(x, p, c, limits, out):
    find_game("double_integrator").hamiltonian(x, np.nan_to_num(p), c, limits, out)


def unlimited_pursuit(x, p, c, limits, out):
    find_game("air3d").hamiltonian(x, p, c, limits, out)
    out += 2.0 * c[3] * np.abs(p[2])


def pursuer_helps(x, p, c, limits, u, d):
    find_game("air3d").optimal_inputs(x, p, c, limits, u, d)
    d *= -1.0


def not_for_a_compiler(x, c, out):
    find_game("double_integrator").target(x, c, out)


def highway(**changed):
    """Return the game of two cars with something else in place of some of it."""
    return dataclasses.replace(find_game("highway"), **changed)


SHEARED = {**find_game("highway").parameters, "braking_shear": 1.0 / 12.0}


def unsheared(x, c, out):
    plain = c.copy()
    plain[list(SHEARED).index("braking_shear")] = 0.0
    find_game("highway").target(x, plain, out)


def a_wider_car(parameters):
    return TargetFormula.of_game({**parameters, "width": parameters["width"] + 0.1})


def gentle_cars(parameters):
    return find_game("highway").closed_rows({**parameters, "other_acceleration_min": -3.0})


def all_cars(parameters):
    closed = find_game("highway").closed_rows(parameters)
    return lambda robot, cars, values, gradients, bound: closed(robot, cars, values, gradients, math.inf)


def ten_rows(parameters):
    closed = find_game("highway").closed_rows(parameters)

    def more(*arguments):
        chosen, rows = closed(*arguments)
        return chosen, np.resize(rows, (10, rows.shape[1]))

    return more


def kept_too_high(parameters):
    closed = find_game("highway").closed_rows(parameters)

    def higher(*arguments):
        chosen, rows = closed(*arguments)
        return chosen, np.vstack([rows[:4], rows[:4] + 1.0])

    return higher


def squared_flow(x, u, d, c, out):
    out[:] = 0.0
    out[3] = u[0] ** 2


def squared_hamiltonian(x, p, c, limits, out):
    out[:] = np.maximum(p[3], 0.0)


def all_or_nothing(x, p, c, limits, u, d):
    u[0] = p[3] > 0.0


def one(x, c, out):
    out[:] = 1.0


# Two cars, of which one speeds up with the square of its control.
SQUARED = {
    "controls": ("push",), "disturbances": (), "flow": squared_flow, "hamiltonian": squared_hamiltonian,
    "optimal_inputs": all_or_nothing, "dissipation": one, "limited": (False,) * 5, "mirrored_axes": (),
    "closed_rows": None,
}  # fmt: skip

BOXES = {
    2: ((-3.0, -2.0), (4.0, 2.0)),
    3: ((-3.0, -2.0, -3.0), (4.0, 2.0, 3.0)),
    5: ((-60.0, -6.0, -0.4, 0.0, 0.0), (60.0, 6.0, 0.4, 40.0, 40.0)),
}


@pytest.mark.parametrize(
    ("game", "said"),
    [
        (brake(target=beyond), "target reaches beyond an array: index 2 .*; the game has 2 state var"),
        (brake(target=state_function(untyped)), "target raised NameError"),
        (brake(target=raises), "target raised KeyError: 'half_width'"),
        (brake(target=infinite), r"target is not finite at position = \S+, velocity = \S+"),
        (brake(target=count_up), "target answers the same states differently the second time"),
        (brake(target=first_alone), "target is .* among other states and .* alone"),
        (brake(target=writes_to_its_states), "target wrote to what it was given"),
        (brake(flow=half_written), "flow leaves row 1 of its output unwritten"),
        (brake(hamiltonian=slopes_of_the_first), "hamiltonian is .* in a slab and .* alone .*may be computed once"),
        (brake(optimal_inputs=lazy_inputs), r"hamiltonian is \S+ and p · flow at the optimal inputs \S+ at"),
        (brake(optimal_inputs=downhill, hamiltonian=falls), r"the control \(\S+\) makes p · flow \S+, more than the"),
        (
            dataclasses.replace(find_game("air3d"), optimal_inputs=pursuer_helps, hamiltonian=unlimited_pursuit),
            r"the disturbance \(\S+\) makes p · flow \S+, less than the hamiltonian",
        ),
        (but("dissipation", lambda x, c, out: out.__imul__(0.9)), "dissipation along .* and the hamiltonian rises by"),
        (but("dissipation", lambda x, c, out: out.__imul__(1.0 + (out[:1] > out[0, 0]))), "in a slab and .* alone"),
        (brake(optimal_inputs=uphill, hamiltonian=rises), "velocity is limited, and the optimal inputs lead out of it"),
        (brake(hamiltonian=plausible), "where the slope along .* is NaN; it has to be NaN"),
        (brake(mirrored_axes=(1,)), "target or hamiltonian is .* mirrored in velocity, slopes as well"),
        (brake(boundary=("periodic", "linear")), "hamiltonian is .* at the other end of the periodic axis"),
        (brake(target=not_for_a_compiler), "not_for_a_compiler does not compile: Untyped global name .find_game"),
        (highway(target=unsheared, parameters=SHEARED), "at the sheared grid's point and .* target takes the grid's"),
        (highway(shear=BrakingShear("lateral_margin")), "hamiltonian is .* and p · flow at the optimal inputs"),
        (highway(target_formula=a_wider_car), r"target_formula is \S+ and target \S+ at p_x"),
        (highway(closed_rows=gentle_cars), r"closed_rows has \S+ in row 3 and the flow gives"),
        (highway(closed_rows=all_cars), "closed_rows of a bound of 0.5 are not those"),
        (highway(closed_rows=ten_rows), "closed_rows has 10 rows a car; 4 or 8 are right"),
        (highway(closed_rows=kept_too_high), r"closed_rows has \S+ to be kept instead of V = \S+ at"),
        (highway(**SQUARED), "dv_r/dt is .* has to be affine in the controls"),
    ],
)  # fmt: skip
def test_a_game_that_breaks_the_contract_is_told_how(game, said):
    box = BOXES[game.dimension]
    with pytest.raises(ContractError, match=said):
        check_game(game, lower=box[0], upper=box[1])


def test_a_wrong_slope_of_a_formula_is_named(monkeypatch):
    def steeper(*arguments):
        value, *slopes = target_and_gradient_at(*arguments)
        return value, *(1.1 * slope for slope in slopes)

    monkeypatch.setattr(game_extras, "target_and_gradient_at", steeper)
    with pytest.raises(ContractError, match=r"target_formula's slope along p_\w is \S+ and not"):
        check_game(find_game("highway"))


def test_an_angle_in_degrees_is_named():
    with pytest.raises(ContractError, match=r"theta is an angle and its box \[-45, 45\] reaches beyond"):
        check_game(find_game("highway"), lower=(-50, -8, -45, 0, 0), upper=(50, 8, 45, 40, 40))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"lower": (1.0, 1.0), "upper": (0.0, 2.0)}, "are no box of double_integrator; a number for each of position"),
        ({"lower": (1.0,)}, "are no box of double_integrator"),
        ({"parameters": {"speed": 1.0}}, "parameters.speed: double_integrator has no such parameter"),
    ],
)
def test_what_is_asked_wrongly_of_the_suite_is_refused(wrong, said):
    with pytest.raises(ConfigurationError, match=said):
        check_game(find_game("double_integrator"), **wrong)
