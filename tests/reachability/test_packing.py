import numpy as np

from hj_cosim.reachability.games.highway.other_car import disturbance_from
from hj_cosim.reachability.games.highway.paths import game_from
from hj_cosim.reachability.games.highway.target import formula_from
from hj_cosim.reachability.packing import packed
from hj_cosim.reachability.table.lookup import value_and_gradient_at
from hj_cosim.reachability.table.stack import grid_in


def numbered(kind: type, flags: tuple[str, ...] = ()):
    """Return a NamedTuple of which no two numbers are the same, so that none can stand in another's place."""
    return kind(*(True if name in flags else 1.5 + index for index, name in enumerate(kind._fields)))


def test_numbers_come_in_the_order_of_the_fields_and_arrays_are_left_out():
    assert packed((1.0, (2.0, True), np.ones(3), (3,))).tolist() == [1.0, 2.0, 1.0, 3.0]


def test_a_formula_an_assumption_and_a_game_come_back_as_they_were(small_table):
    target, game = small_table.arrays.grid.target, small_table.manoeuvres().game
    other = game.other
    formula = numbered(type(target))
    assumption = numbered(type(other), ("responsible",))
    assert formula_from(packed(formula)) == formula
    assert disturbance_from(packed(assumption)) == assumption
    assert disturbance_from(packed(assumption._replace(responsible=False))) == assumption._replace(responsible=False)
    whole = numbered(type(game))._replace(target=formula, other=assumption)
    assert game_from(packed(whole)) == whole


def test_a_table_comes_back_as_it_was(small_table):
    flat, numbers = small_table.stack
    again = grid_in(numbers, 0)
    assert again == small_table.arrays.grid
    one, other = np.empty(5), np.empty(5)
    state = (-20.0, 1.5, 0.05, 25.0, 20.0)
    assert value_and_gradient_at(flat, again, *state, one) == value_and_gradient_at(*small_table.arrays, *state, other)
    assert np.array_equal(one, other)
