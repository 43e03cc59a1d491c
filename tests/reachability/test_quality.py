import dataclasses

import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.reachability.table.slices import value_slice
from hj_cosim.reachability.table.store import solve_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import TableSpecification
from hj_cosim.verification.table_games import play, states_near_zero
from hj_cosim.verification.table_quality import check_table, finer_specifications


def test_a_finer_table_keeps_its_promises_better(braking: TableSpecification) -> None:
    fine_grid = braking.grid.model_copy(update={"shape": (241, 161)})
    coarse = solve_table(braking)
    fine = solve_table(braking.model_copy(update={"grid": fine_grid, "scheme": "weno5"}))
    starts = states_near_zero(fine, 300, 0.5, np.random.default_rng(0))
    shortfalls = [np.abs(play(table, starts, duration=1.0).shortfall).mean() for table in (coarse, fine)]
    assert shortfalls[1] < shortfalls[0]
    assert play(fine, starts, duration=1.0).shortfall.max() < 0.1


def test_a_player_that_does_nothing_breaks_the_promise(braking: TableSpecification) -> None:
    table = solve_table(braking)
    starts = np.array([[1.0, -0.9]])  # towards the wall, in time to brake
    idle = play(table, starts, duration=1.0, control=lambda states: np.zeros((len(states), 1)))
    assert idle.shortfall[0] > 0.2
    assert play(table, starts, duration=1.0).shortfall[0] < 0.1


def test_check_reports_every_measure(braking: TableSpecification) -> None:
    quality = check_table(solve_table(braking), rollouts=200, states=2000, seconds=60.0)
    assert [refinement.what for refinement in quality.refinements] == ["weno5", "all axes"]
    assert quality.rollouts == 200
    assert 0.0 < quality.unsafe_share < 1.0
    assert set(quality.unsafe_on_faces) == {"position low", "position high"}
    assert quality.shortfall_p99 <= quality.shortfall_worst
    assert quality.no_escape_share is None


def test_check_tells_how_often_a_table_calls_safe_what_no_manoeuvre_escapes_from(
    small_table: ValueTable, capped_table: ValueTable
) -> None:
    bare, careful = (
        check_table(table, rollouts=10, states=20_000, seconds=0.0).no_escape_share
        for table in (small_table, capped_table)
    )
    assert 0.01 < bare < 0.5
    assert careful < 0.2 * bare


def test_the_margin_that_check_names_makes_the_table_conservative(braking: TableSpecification) -> None:
    table = solve_table(braking)
    needed = check_table(table, rollouts=10, states=20_000, seconds=60.0).refinements[0].margin_needed
    careful = solve_table(braking.model_copy(update={"margin": needed}))
    again = check_table(careful, rollouts=10, states=20_000, seconds=60.0).refinements[0]
    assert again.called_safe_wrongly <= 0.001


def test_what_is_too_dear_to_refine_at_once_is_refined_axis_by_axis(braking: TableSpecification) -> None:
    table = solve_table(braking)
    seconds = table.report.seconds
    assert [what for what, _ in finer_specifications(table, 12.9 * seconds)] == ["weno5", "position"]


def test_the_papers_slice_is_more_dangerous_ahead_of_the_faster_car(small_table: ValueTable) -> None:
    drawn = value_slice(small_table)
    assert drawn.held == {"theta": 0.0, "v_r": 10.0, "v_o": 20.0}
    assert drawn.values.shape == (201, 201)
    middle = drawn.values[100]
    assert np.interp(30.0, drawn.x, middle) < np.interp(-30.0, drawn.x, middle)
    assert np.mean(drawn.values <= 0.0) > np.mean(drawn.target <= 0.0)


def test_a_slice_over_unknown_or_held_states_is_refused(small_table: ValueTable) -> None:
    with pytest.raises(ConfigurationError, match="no state of highway"):
        value_slice(small_table, over=("p_x", "speed"))
    with pytest.raises(ConfigurationError, match="not held"):
        value_slice(small_table, {"p_x": 3.0})


def test_a_table_that_is_nowhere_near_zero_is_refused_and_says_what_v_is(braking: TableSpecification) -> None:
    table = solve_table(braking)
    everywhere_safe = dataclasses.replace(table, values=table.values + np.float32(100.0))
    with pytest.raises(TableError, match=r"no state of the table has \|V\| <= 1: V is from 9\d"):
        check_table(everywhere_safe, rollouts=20, states=2000, seconds=0.0)


def test_where_no_random_state_is_near_zero_all_are_compared_with_a_finer_table(braking: TableSpecification) -> None:
    table = solve_table(braking)
    far = dataclasses.replace(table, values=np.where(np.abs(table.values) > 0.05, table.values * 100.0, table.values))
    quality = check_table(far, rollouts=20, states=5, seconds=60.0)
    assert all(refinement.change_median > 5.0 for refinement in quality.refinements)
