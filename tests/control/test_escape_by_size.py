"""The escape among vehicles of several sizes is that of each one's own game."""

import dataclasses

import numpy as np
import pytest
from filter_in_loop import FilterInLoop

from hj_cosim.control.spc.escape import NO_MANOEUVRE, keep_escape, manoeuvres_for
from hj_cosim.reachability.table.size_classes import CAR, SIZE_CLASSES
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.settings import FilterSettings, robot_and_filter

ROBOT, STEP = robot_and_filter("best")[0], 0.02


def scenes(count, seed):
    """Yield robots, others (J, 3), and controls that are asked for."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        robot = np.array([0.0, 4.0, random.uniform(-0.1, 0.1), random.uniform(15.0, 28.0)])
        cars = int(random.integers(1, 5))
        others = np.column_stack(
            [random.uniform(-50.0, 60.0, cars), random.choice([0.0, 4.0, 8.0], cars), random.uniform(12.0, 28.0, cars)]
        )
        yield robot, others, (random.uniform(-0.2, 0.2), random.uniform(-6.0, 4.0))


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_among_one_class_it_is_that_of_its_game_alone(sized_table, kind):
    alone = dataclasses.replace(sized_table.by_size[kind], larger=())
    all_classes, alone = manoeuvres_for(sized_table, ROBOT), manoeuvres_for(alone, ROBOT)
    verdicts = set()
    for robot, others, asked in scenes(60, seed=kind):
        in_k = np.ones(len(others), bool)
        expected = keep_escape(alone, robot, others, in_k, *asked, STEP, NO_MANOEUVRE)
        with_class = np.column_stack([others, np.full(len(others), float(kind))])
        assert keep_escape(all_classes, robot, with_class, in_k, *asked, STEP, NO_MANOEUVRE) == expected
        verdicts.add(expected[2])
    assert len(verdicts) == 3


def test_among_several_it_escapes_from_no_more_than_each_class_alone(sized_table):
    manoeuvres, differ = manoeuvres_for(sized_table, ROBOT), 0
    for robot, others, asked in scenes(80, seed=7):
        in_k, verdicts = np.ones(len(others), bool), []
        for sizes in (np.zeros(len(others)), np.arange(len(others)) % 3, np.full(len(others), 2.0)):
            rows = np.column_stack([others, sizes])
            verdicts.append(keep_escape(manoeuvres, robot, rows, in_k, *asked, STEP, NO_MANOEUVRE)[2])
        assert verdicts[0] <= verdicts[1] <= verdicts[2]  # from longer ones it is harder
        differ += verdicts[0] != verdicts[2]
    assert differ > 3


def drawn(bodies, seed):
    random, count = np.random.default_rng(seed), 12
    lane = random.integers(0, 4, count)
    length, width = np.array(bodies).T[:, np.arange(count) % len(bodies)].copy()
    return Observation(
        0.0, np.array([0.0, 4.0, 0.02, 24.0]), 0.0, np.arange(count), np.sort(random.uniform(-60.0, 80.0, count)),
        4.0 * lane, np.zeros(count), random.uniform(20.0, 25.0, count), np.zeros(count), lane, lane, length, width,
    )  # fmt: skip


def test_the_filter_among_trucks_alone_is_that_of_their_table(sized_table):
    """Written from the other side: a table that is solved for trucks, told that what it meets are its cars."""
    robot, best = robot_and_filter("best")
    settings = best.model_copy(update={"keep_escape": True})
    truck = dataclasses.replace(sized_table.by_size[2], size=CAR)
    mixed, alone = FilterInLoop(settings, sized_table, robot), FilterInLoop(settings, truck, robot)
    changed = 0
    for seed in range(40):
        seen = drawn([(16.5, 2.5), (18.0, 2.5)], seed)
        as_its_cars = dataclasses.replace(seen, length=np.full(12, 5.0), width=np.full(12, 2.0))
        desired = Control(0.02, 2.0)
        one, other = mixed.filter(seen, desired), alone.filter(as_its_cars, desired)
        assert one.control == other.control
        assert one.constraints == other.constraints
        changed += one.control != desired
    assert changed > 5


def test_among_cars_alone_the_filter_does_what_it_does_without_larger_tables(small_table, sized_table):
    settings = FilterSettings(keep_escape=True)
    one, other = FilterInLoop(settings, small_table), FilterInLoop(settings, sized_table)
    for seed in range(40):
        seen = drawn([(5.0, 2.0), (4.2, 1.7)], seed)
        assert one.filter(seen, Control(0.02, 2.0)).control == other.filter(seen, Control(0.02, 2.0)).control
    assert [each.size for each in sized_table.by_size] == list(SIZE_CLASSES)
