"""The belief that a driver means harm, against Bayes by hand and by numerical integration of the forgetting."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from hj_cosim.control.belief.evidence import AT_ODD_PACE, CHANGES, KEEPS_LANE, TAKES_ROOM, evidence_of
from hj_cosim.control.belief.hypotheses import ASSUMED, forgotten, log_likelihood_ratio, updated
from hj_cosim.control.belief.watcher import Watcher
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import DriverSettings, NormalDistribution
from hj_cosim.vehicles.idm import DESIRED_SPEED, MAX_ACCELERATION, idm_acceleration, mean_driver

DRIVER = mean_driver(DriverSettings())
FAST = mean_driver(DriverSettings(desired_speed=NormalDistribution(mean=32.0, deviation=0.0)))
FAR = mean_driver(DriverSettings(time_headway=NormalDistribution(mean=5.0, deviation=0.0)))
LANE = 4.0
ROBOT = np.array([0.0, 0.0, 0.0, 20.0])


def scene(cars, acceleration, robot=ROBOT, time=0.0):
    """Return an observation of cars (x, y, heading, speed)."""
    x, y, heading, speed = np.array(cars, float).reshape(-1, 4).T
    count = len(x)
    lane = np.rint(y / LANE).astype(int)
    return Observation(
        time=time, robot=robot, robot_acceleration=0.0, vehicle=np.arange(count),
        x=x, y=y, heading=heading, speed=speed,
        acceleration=np.array(acceleration, float), lane=lane, target_lane=lane,
        length=np.full(count, 5.0), width=np.full(count, 2.0),
    )  # fmt: skip


def seen(cars, acceleration, drivers=None):
    """Return what is seen of cars whose drivers, and one in the robot's place, are as given; mean ones unless so."""
    observation = scene(cars, acceleration)
    expected = np.tile(DRIVER, (len(observation.x) + 1, 1)) if drivers is None else np.array(drivers)
    return evidence_of(ROBOT, 5.0, observation.cars, observation.acceleration, expected, LANE)


def probability(log_odds):
    return 1.0 / (1.0 + math.exp(-log_odds))


def test_one_independent_sample_is_bayes_by_hand():
    of = ASSUMED._replace(forgetting_time=1e12, prior=0.2)
    near = stats.t(df=3, scale=of.deviation).pdf(1.0)
    likelihood = {
        who: ((1 - share) * near + share / of.range_of_anything) * across[TAKES_ROOM]
        for who, share, across in (
            ("rogue", of.rogue_outliers, of.rogue_across),
            ("ordinary", of.ordinary_outliers, of.ordinary_across),
        )
    }
    posterior = 0.2 * likelihood["rogue"] / (0.2 * likelihood["rogue"] + 0.8 * likelihood["ordinary"])
    after = updated(math.log(0.2 / 0.8), 1.0, TAKES_ROOM, of.independent_after, of)
    assert probability(after) == pytest.approx(posterior, rel=1e-9)


def test_a_sample_soon_after_the_last_counts_for_the_share_that_is_new():
    of = ASSUMED._replace(forgetting_time=1e12)
    whole = log_likelihood_ratio(5.0, KEEPS_LANE, of)
    assert updated(0.0, 5.0, KEEPS_LANE, 0.25 * of.independent_after, of) == pytest.approx(0.25 * whole)
    assert updated(0.0, 5.0, KEEPS_LANE, 4.0 * of.independent_after, of) == pytest.approx(whole)


def test_unseen_belief_decays_to_the_prior_as_the_two_state_chain_does():
    belief, step, seconds = 0.9, 1e-3, 20.0
    begins, ends = ASSUMED.prior / ASSUMED.forgetting_time, (1.0 - ASSUMED.prior) / ASSUMED.forgetting_time
    for _ in range(round(seconds / step)):
        belief += step * (begins * (1.0 - belief) - ends * belief)
    assert probability(forgotten(math.log(0.9 / 0.1), seconds, ASSUMED)) == pytest.approx(belief, abs=1e-4)


@given(st.floats(-12, 12), st.floats(-20, 20), st.integers(0, 3), st.floats(0, 100))
def test_belief_stays_a_probability_and_ends_between_forgetting_and_the_full_sample(
    log_odds, residual, across, elapsed
):
    before, after = forgotten(log_odds, elapsed, ASSUMED), updated(log_odds, residual, across, elapsed, ASSUMED)
    full = before + log_likelihood_ratio(residual, across, ASSUMED)
    assert 0.0 < probability(after) < 1.0
    assert min(before, full, 12.0) - 1e-9 <= after <= max(before, full, -12.0) + 1e-9


@given(st.floats(0, 15), st.floats(0, 15))
def test_a_larger_residual_is_never_less_suspicious(one, other):
    low, high = sorted((one, other))
    less, more = (log_likelihood_ratio(r, KEEPS_LANE, ASSUMED) for r in (low, high))
    assert less <= more + 1e-12
    assert log_likelihood_ratio(-high, KEEPS_LANE, ASSUMED) == more


def test_what_is_not_a_number_leaves_the_belief():
    assert updated(1.0, math.nan, KEEPS_LANE, 0.1, ASSUMED) == forgotten(1.0, 0.1, ASSUMED)


def test_residual_is_beside_idm_behind_the_nearest_in_the_lane_the_robot_included():
    cars = [(-30.0, 0.0, 0.0, 22.0), (40.0, 0.0, 0.0, 18.0), (10.0, LANE, 0.0, 25.0)]
    residual, _ = seen(cars, [0.5, -0.3, 0.0])
    expected = [
        0.5 - idm_acceleration(22.0, 25.0, 20.0, DRIVER),  # the robot is ahead of it
        -0.3 - idm_acceleration(18.0, math.inf, 0.0, DRIVER),
        -idm_acceleration(25.0, math.inf, 0.0, DRIVER),  # all others are in another lane
    ]
    assert residual == pytest.approx(expected)


def test_residual_is_beside_what_is_expected_of_the_cars_own_driver():
    cars = [(40.0, 0.0, 0.0, 20.0), (60.0, LANE, 0.0, 20.0)]
    residual, _ = seen(cars, [0.0, 0.0], [FAST, DRIVER, DRIVER])
    assert residual == pytest.approx([-idm_acceleration(20.0, math.inf, 0.0, each) for each in (FAST, DRIVER)])


def test_room_is_taken_by_what_is_expected_of_who_is_behind():
    moves_over = (40.0, LANE, math.asin(-1.0 / 20.0), 20.0)  # to where the other one is behind
    for driver, what in ((DRIVER, CHANGES), (FAR, TAKES_ROOM)):
        _, across = seen([moves_over, (2.0, 0.0, 0.0, 20.0)], [0.0, 0.0], [DRIVER, driver, DRIVER])
        assert across[0] == what
        _, across = seen([moves_over], [0.0], [DRIVER, driver])  # the robot is
        assert across[0] == what


@pytest.mark.parametrize(
    ("ahead", "sideways", "what"),
    [
        (60.0, 0.0, KEEPS_LANE),
        (60.0, -1.0, CHANGES),  # into the robot's lane, far ahead
        (60.0, -0.4, AT_ODD_PACE),
        (60.0, -2.0, AT_ODD_PACE),
        (8.0, -1.0, TAKES_ROOM),  # 3 m ahead of the robot's front
        (8.0, 1.0, CHANGES),  # away from it
        (2.0, -1.0, TAKES_ROOM),  # beside it
        (-2.0, -1.0, TAKES_ROOM),  # beside it, and nobody is behind
        (-60.0, -1.0, CHANGES),
    ],
)
def test_motion_across_the_road_is_told_by_pace_and_by_whose_room_it_takes(ahead, sideways, what):
    _, across = seen([(ahead, LANE, math.asin(sideways / 20.0), 20.0)], [0.0])
    assert across[0] == what


def drive(watcher, cars, acceleration, seconds, begin=0.0):
    for step in range(round(seconds / 0.02)):
        watcher.see(scene(cars, acceleration, time=begin + 0.02 * step))


def test_who_brakes_for_nothing_becomes_suspected_and_who_drives_by_idm_does_not():
    cars = [(40.0, 0.0, 0.0, 20.0), (60.0, LANE, 0.0, 20.0)]
    free = idm_acceleration(20.0, math.inf, 0.0, DRIVER)
    watcher = Watcher(5.0, LANE, DriverSettings())
    drive(watcher, cars, [-6.0, free], 5.0)
    both = np.arange(2)
    assert watcher.suspected(both).tolist() == [True, False]
    assert watcher.belief(both)[1] < ASSUMED.prior


def test_suspicion_ends_below_its_beginning():
    cars, free = [(40.0, 0.0, 0.0, 20.0)], idm_acceleration(20.0, math.inf, 0.0, DRIVER)
    watcher, one = Watcher(5.0, LANE, DriverSettings()), np.arange(1)
    drive(watcher, cars, [-6.0], 5.0)
    beliefs = []
    for step in range(3000):
        watcher.see(scene(cars, [free], time=5.0 + 0.1 * step))
        if not watcher.suspected(one)[0]:
            break
        beliefs.append(watcher.belief(one)[0])
    assert watcher.belief(one)[0] < 0.5 <= beliefs[-1]
    assert min(beliefs) < 0.8  # still suspected where nobody becomes so


def test_looks_are_ten_a_second_whatever_the_filters_step():
    cars = [(40.0, 0.0, 0.0, 20.0)]
    fine, coarse = Watcher(5.0, LANE, DriverSettings()), Watcher(5.0, LANE, DriverSettings())
    drive(fine, cars, [-6.0], 2.0)
    for step in range(20):
        coarse.see(scene(cars, [-6.0], time=0.1 * step))
    assert fine.belief(np.arange(1)) == pytest.approx(coarse.belief(np.arange(1)), rel=1e-6)


def test_a_car_keeps_its_belief_whatever_its_place_in_the_arrays():
    watcher = Watcher(5.0, LANE, DriverSettings())
    cars = [(40.0, 0.0, 0.0, 20.0), (60.0, LANE, 0.0, 20.0)]
    free = idm_acceleration(20.0, math.inf, 0.0, DRIVER)
    for step in range(50):
        observation = scene(cars, [-6.0, free], time=0.1 * step)
        if step % 2:
            columns = (
                "vehicle",
                "x",
                "y",
                "heading",
                "speed",
                "acceleration",
                "lane",
                "target_lane",
                "length",
                "width",
            )
            observation = replace(observation, **{name: getattr(observation, name)[::-1].copy() for name in columns})
        watcher.see(observation)
    assert watcher.suspected(np.arange(2)).tolist() == [True, False]


def test_drivers_who_drive_as_their_scenario_has_them_are_not_suspected():
    cars = [(40.0, 0.0, 0.0, 20.0), (60.0, LANE, 0.0, 20.0)]
    acceleration, both = [idm_acceleration(20.0, math.inf, 0.0, FAST)] * 2, np.arange(2)
    fast = DriverSettings(desired_speed=NormalDistribution(mean=32.0, deviation=1.5))
    usual, told = Watcher(5.0, LANE, DriverSettings()), Watcher(5.0, LANE, fast)
    drive(usual, cars, acceleration, 20.0)
    drive(told, cars, acceleration, 20.0)
    assert (told.belief(both) < ASSUMED.prior).all()
    assert (usual.belief(both) > told.belief(both)).all()


def test_drivers_told_apart_by_their_vehicles_are_believed_each_by_what_is_expected_of_it():
    cars, acceleration = [(40.0, 0.0, 0.0, 20.0), (60.0, LANE, 0.0, 20.0)], [-6.0, -6.0]
    slow = FAST.copy()
    slow[DESIRED_SPEED] = 20.0 * (1.0 + 6.0 / slow[MAX_ACCELERATION]) ** -0.25  # so that it brakes with 6 m/s²
    watcher = Watcher(5.0, LANE, DriverSettings())
    for step in range(50):
        observation = scene(cars, acceleration, time=0.1 * step)
        watcher.see(replace(observation, expected_driver=np.array([slow, DRIVER])))
    assert watcher.suspected(np.arange(2)).tolist() == [False, True]
    assert watcher.belief(np.arange(1))[0] < ASSUMED.prior


def test_a_car_that_enters_between_two_looks_is_believed_as_the_prior_says():
    watcher = Watcher(5.0, LANE, DriverSettings())
    watcher.see(scene([(40.0, 0.0, 0.0, 20.0)], [0.0], time=0.0))
    for entered in (2, 50):  # with and without room for them
        observation = scene([(40.0 * (j + 1), 0.0, 0.0, 20.0) for j in range(entered)], [0.0] * entered, time=0.04)
        watcher.see(observation)
        assert watcher.belief(observation.vehicle)[1:] == pytest.approx(ASSUMED.prior)
        assert not watcher.suspected(observation.vehicle).any()


def test_of_cars_that_nobody_has_looked_at_the_prior_is_believed():
    watcher = Watcher(5.0, LANE, DriverSettings(), ASSUMED._replace(prior=0.2))
    assert watcher.belief(np.arange(3)) == pytest.approx(0.2)
    assert not watcher.suspected(np.arange(40)).any()
