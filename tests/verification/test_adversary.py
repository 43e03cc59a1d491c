import dataclasses

import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.metrics.rectangles import rectangles_overlap
from hj_cosim.reachability.games.contract import SizeClass
from hj_cosim.reachability.table.store import read_specification, solve_table
from hj_cosim.settings import FilterSettings, RobotSettings, robot_and_filter
from hj_cosim.verification.adversary import DESIRED, AdversarySettings, _starts, search_adversary
from hj_cosim.verification.adversary_games import CHOSEN, CRUISE, Search, roll_out_choices
from hj_cosim.verification.bodies import Bodies, bodies_overlap
from hj_cosim.verification.guarantee import RolloutSettings, game_of

FEW = AdversarySettings(games=12, duration=3.0, segments=6, population=12, elite=4, generations=3, seed=1)
KEEPING = FilterSettings(keep_escape=True)


def search(table, spc=KEEPING, **settings):
    return search_adversary(table, dataclasses.replace(FEW, **settings), spc)


def played(table, desired, choices, start, spc=KEEPING, samples=150):
    game = game_of(table, RolloutSettings(), spc, RobotSettings())
    kind = Search(desired, samples, len(choices), 1, 1, 1, False)
    return roll_out_choices(game, kind, np.array(start), np.array(choices, float))


def test_the_same_seed_gives_the_same_report_however_many_threads(small_table):
    short = dataclasses.replace(FEW, duration=0.6)
    once = search_adversary(small_table, short, KEEPING)
    assert search_adversary(small_table, short, KEEPING, workers=1) == once
    other = search_adversary(small_table, dataclasses.replace(short, seed=2), KEEPING)
    assert dataclasses.replace(other, settings=short) != once


def test_a_search_hits_more_often_than_as_many_draws(small_table):
    fair = {"games": 40, "desired": "free", "segments": 12, "duration": 6.0}
    drawn = search(small_table, FilterSettings(), population=240, elite=6, generations=1, **fair)
    searched = search(small_table, FilterSettings(), population=40, elite=6, generations=6, **fair)
    assert drawn.rollouts == searched.rollouts
    assert searched.entered > drawn.entered > 0


def test_without_an_escape_kept_the_search_enters_more_often(small_table):
    alone = search(small_table, FilterSettings(), games=40, desired="free")
    keeping = search(small_table, games=40, desired="free")
    assert alone.entered > keeping.entered


@pytest.fixture(scope="module")
def duties_table(small_specification):
    """The coarse table of the game among cars that do their duties."""
    specification = read_specification(small_specification)
    duties = {**specification.parameters, "responsible": 1.0}
    changes = {"parameters": duties, "capped_by_manoeuvres": True}
    return solve_table(specification.model_copy(update=changes))


def test_who_evades_breaches_of_duty_is_entered_no_more_often_by_who_does_his(duties_table):
    robot, best = robot_and_filter("best")
    hunt = dataclasses.replace(FEW, games=30, desired="free", duration=4.0, segments=8, above=2.0)
    also = search_adversary(duties_table, hunt, best, robot)
    alone = search_adversary(duties_table, hunt, best.model_copy(update={"evade": False}), robot)
    assert also.entered <= alone.entered
    assert also.collided == alone.collided == 0
    assert also != alone  # it did evade


def test_a_car_that_brakes_as_chosen_is_as_far_as_the_formula_has_it(small_table):
    # No filter has anything to do 150 m apart: V is beyond the table, and the robot keeps its 20 m/s.
    start = [-150.0, 0.0, 0.0, 20.0, 20.0]
    nothing, braking = (
        played(small_table, CRUISE, [[0, 0.2, 0, 0]], start),
        played(small_table, CRUISE, [[0, -1, 0, 0]], start),
    )
    # 0.2 of −6..4 m/s² is no acceleration; −1 is −6 m/s² for 3 s, with the braking distance then in V(0, ·), too.
    assert nothing.least_target == pytest.approx(150.0 - 5.0 - 0.3 * 20.0 - 0.135 - (20.9**2 - 20.0**2) / 12.0)
    shorter = 20.0 * 3.0 - (20.0 * 3.0 - 27.0) + (20.0**2 - 2.0**2) / 12.0
    assert braking.least_target == pytest.approx(nothing.least_target - shorter)
    assert not nothing.collided


def test_a_car_that_stops_dead_ahead_is_hit_and_said_so(small_table):
    start = [-9.0, 0.0, 0.0, 30.0, 5.0]
    outcome = played(small_table, CHOSEN, [[0, -1, 0, 1]], start)
    assert outcome.collided
    assert outcome.without_escape
    assert outcome.least_target < 0.0


def test_every_desired_control_is_searched_and_reported(small_table):
    for desired in DESIRED:
        report = search(small_table, games=4, desired=desired)
        assert report.rollouts == 4 * 12 * 3
        assert 0.0 <= report.fall_median <= report.fall_p90 <= report.fall_p99 <= report.fall_max


def test_what_cannot_be_searched_is_refused(small_table, monkeypatch):
    monkeypatch.setattr("hj_cosim.verification.adversary._ROUNDS", 2)
    with pytest.raises(ConfigurationError, match="elite = 20"):
        search(small_table, elite=20)
    with pytest.raises(ConfigurationError, match="of the table have"):
        search(small_table, above=1e5, up_to=1e5 + 1)


def test_a_robot_and_a_truck_overlap_where_their_rectangles_do():
    draw = np.random.default_rng(3)
    for _ in range(2000):
        x, y, theta = draw.uniform([-14.0, -5.0, -0.5], [14.0, 5.0, 0.5])
        told = bodies_overlap(x, y, theta, Bodies(5.0, 2.0, 16.5, 2.5))
        assert told == rectangles_overlap(-x, -y, theta, 5.0, 2.0, 0.0, 16.5, 2.5)


def test_the_other_car_is_as_large_as_the_tables_size_class(small_table):
    table = dataclasses.replace(small_table, size=SizeClass("long truck", 18.0, 2.5))
    assert game_of(table, RolloutSettings(), FilterSettings(), RobotSettings()).bodies == Bodies(5.0, 2.0, 18.0, 2.5)


def test_no_game_begins_with_bodies_that_touch(small_table):
    game = game_of(small_table, RolloutSettings(step=0.05, duration=1.0), FilterSettings(), RobotSettings())
    settings = AdversarySettings(games=300, above=-2.0, up_to=2.0)
    starts, values = _starts(small_table, game, settings, np.random.default_rng(0))
    assert ((values > -2.0) & (values <= 2.0)).all()
    assert not any(rectangles_overlap(-x, -y, heading, 5.0, 2.0, 0.0, 5.0, 2.0) for x, y, heading, _, _ in starts)
    drawn = small_table.draw_states(20_000, np.random.default_rng(1))
    near = drawn[np.abs(small_table.value(drawn)) <= 2.0]
    assert any(rectangles_overlap(-x, -y, heading, 5.0, 2.0, 0.0, 5.0, 2.0) for x, y, heading, _, _ in near)
