import dataclasses
import math

import numpy as np
import pytest
from bent_roads import WIDTH, circle

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.verification.bodies import Bodies, where_bodies_overlap
from hj_cosim.verification.filter_games import where_bodies_overlap_in_world, world_pose
from hj_cosim.verification.game import bent, curvature_at
from hj_cosim.verification.guarantee import CAUSES, RolloutSettings, game_of, measure_guarantee

FEW = RolloutSettings(rollouts=60, duration=2.0, seed=1)


def report(table, filter_settings=None, **settings):
    return measure_guarantee(table, dataclasses.replace(FEW, **settings), filter_settings, workers=1)


def test_where_the_table_is_exact_and_the_rows_can_be_met_v_falls_by_no_more_than_the_time_step_explains(safe_table):
    coarse = report(safe_table)
    assert coarse.unmet_percent == 0.0
    # |dV/dt| <= 40 m/s while the desired speed is kept: one step's fall through ε. Below it, dV/dt >= 0 at the start
    # of every step and changes at 10 m/s² at most.
    one_step, held = 40.0 * FEW.step, 0.5 * 10.0 * FEW.step * FEW.duration
    assert 0.0 < coarse.fall_max <= one_step + held
    fine = report(safe_table, step=FEW.step / 4)
    assert fine.fall_max <= (one_step + held) / 4
    assert fine.fall_max < coarse.fall_max


def test_a_table_without_the_game_lets_the_adversary_in_and_a_driver_that_keeps_its_lane_hardly(table):
    adversary, driver = report(table), report(table, others="driver")
    assert adversary.entered > 10
    assert driver.entered < 0.5 * adversary.entered


def test_who_does_not_do_the_duties_that_the_table_counts_on_enters_more_often(table):
    parameters = {"responsible": 1.0, "brake_min": 6.0}
    specification = table.specification.model_copy(update={"parameters": parameters})
    dutiful = dataclasses.replace(table, specification=specification)
    keeping = FilterSettings(keep_escape=True)
    within, rogue = (report(dutiful, keeping, others=others, duration=4.0) for others in ("adversary", "rogue"))
    assert rogue.entered > within.entered + 5
    assert rogue.rollouts == within.rollouts
    evading = report(dutiful, keeping.model_copy(update={"evade": True}), others="rogue", duration=4.0)
    assert evading.collided < rogue.collided


def test_every_entry_has_a_cause_and_no_more_collide_unturned_than_turned(table):
    found = report(table, desire="collide")
    assert set(found.causes) == set(CAUSES)
    assert sum(found.causes.values()) == found.entered
    assert found.entered_percent == pytest.approx(100.0 * found.entered / 60)
    assert found.collided_unturned <= found.collided
    assert found.fall_median <= found.fall_p99 <= found.fall_p999 <= found.fall_max


def test_the_same_seed_gives_the_same_report_however_many_threads(table):
    again = measure_guarantee(table, dataclasses.replace(FEW, desire="random"), workers=2)
    assert again == report(table, desire="random")
    assert again != report(table, desire="random", seed=2)


def test_several_cars_the_bicycle_and_the_switching_scheme_roll_out_too(table):
    found = report(table, FilterSettings(scheme="sw"), cars=3, model="bicycle", rollouts=20, duration=1.0)
    assert 0 < found.rollouts <= 20


@pytest.mark.parametrize(("lateral", "half_wave"), [(7.0, math.inf), (-7.0, math.inf), (7.0, 100.0)])
def test_who_goes_round_a_bend_is_as_far_along_the_road_as_the_circle_says(table, lateral, half_wave):
    settings = dataclasses.replace(FEW, curvature=1.0 / 300.0, half_wave=half_wave)
    game = game_of(table, settings, FilterSettings(), RobotSettings())
    s, length = 0.0, 2.0 * math.pi * (300.0 - lateral)
    if half_wave < math.inf:  # out and back again: over a whole wave the bends cancel, up to second order
        length = 20.0 * half_wave
    for _ in range(20_000):
        s = bent(game, s, s + length / 20_000, lateral)
    assert s == pytest.approx(2.0 * math.pi * 300.0 if half_wave == math.inf else length, rel=1e-3)
    straight = game_of(table, FEW, FilterSettings(), RobotSettings())
    assert bent(straight, 3.0, 3.7, lateral) == 3.7


def test_an_s_goes_from_one_bend_to_the_other_by_clothoids(table):
    game = game_of(
        table, dataclasses.replace(FEW, curvature=1.0 / 300.0, half_wave=200.0), FilterSettings(), RobotSettings()
    )
    at = [curvature_at(game, along) * 300.0 for along in (0.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0, -50.0)]
    assert at == pytest.approx([1.0, 0.5, 0.0, -0.5, -1.0, 0.0, 1.0, 0.5], abs=1e-12)  # in s, curvature is straight


@pytest.mark.parametrize("radius", [300.0, -300.0])
def test_the_robot_seen_from_another_car_is_where_a_road_of_that_radius_has_it(radius):
    road = circle(radius)  # its curve is d = 2 WIDTH
    for ahead, lateral, other, theta in [(40.0, 3.0, -1.0, 0.1), (-60.0, -2.0, 4.0, -0.2), (4.0, 1.0, 3.5, 0.0)]:
        x, y, heading = road.to_world(500.0 + ahead, 2.0 * WIDTH + lateral, theta)
        from_x, from_y, direction = road.to_world(500.0, 2.0 * WIDTH + other, 0.0)
        cos, sin = math.cos(direction), math.sin(direction)
        expected = (
            (x - from_x) * cos + (y - from_y) * sin,
            (y - from_y) * cos - (x - from_x) * sin,
            math.remainder(heading - direction, math.tau),
        )
        assert world_pose(1.0 / radius, ahead, lateral, other, theta) == pytest.approx(expected, abs=2e-3)
    assert world_pose(0.0, 40.0, 3.0, -1.0, 0.1) == (40.0, 4.0, 0.1)


def test_bodies_overlap_in_the_world_as_on_a_straight_road_but_for_what_the_bend_turns_them(table):
    random = np.random.default_rng(0)
    states = random.uniform((-7.0, -3.5, -0.2, 0.0, 0.0), (7.0, 3.5, 0.2, 40.0, 40.0), (4000, 5))
    places = np.column_stack([random.uniform(0.0, 500.0, 4000), random.uniform(-8.0, 8.0, 4000)])
    straight, bend = (
        where_bodies_overlap_in_world(
            game_of(table, dataclasses.replace(FEW, curvature=curvature), FilterSettings(), RobotSettings()),
            states,
            places,
        )
        for curvature in (0.0, 1.0 / 300.0)
    )
    in_road_frame = where_bodies_overlap(states, Bodies(5.0, 2.0, 5.0, 2.0))
    assert straight.tolist() == in_road_frame.tolist()
    differ = np.flatnonzero(bend != straight)
    assert 0 < len(differ) < 0.05 * len(states)
    # A metre of s is up to 3 % longer or shorter here, and 7 m ahead the road has gone 8 cm aside.
    clear = where_bodies_overlap(states, Bodies(5.6, 2.6, 5.6, 2.6)) == where_bodies_overlap(
        states, Bodies(4.4, 1.4, 4.4, 1.4)
    )
    assert not clear[differ].any()


def test_on_a_gentle_bend_v_falls_hardly_further(safe_table):
    straight, bend = report(safe_table), report(safe_table, curvature=1.0 / 500.0)
    assert bend != straight
    assert bend.fall_max < straight.fall_max + 0.3


def test_an_epsilon_that_no_state_has_is_an_error(safe_table):
    with pytest.raises(ConfigurationError, match="no state of the table"):
        report(safe_table, FilterSettings(epsilon=1e5), rollouts=2)


def test_rows_that_cannot_be_met_count_where_cars_are_in_k_not_where_v_is_still_above_epsilon(table):
    """Everything begins above ε: in the first step nobody is in K, though rows hold how fast V approaches ε."""
    approaching = FilterSettings(approach=0.5)
    first, second = (report(table, approaching, duration=steps * FEW.step, desire="collide") for steps in (1, 25))
    assert first.unmet_percent == 0.0
    assert second.unmet_percent > 20.0
