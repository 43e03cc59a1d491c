"""Tables by size class: which there are, and that everybody who asks about a car gets that of its class."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.errors import TableError
from hj_cosim.reachability.table.cars import car_values, rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.size_classes import SIZE_CLASSES, class_of, classes_met
from hj_cosim.reachability.table.sized import kept_tables, load_tables, read_tables, with_classes
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import robot_and_filter

CAR, VAN, LONG_TRUCK = SIZE_CLASSES
ROBOT = robot_and_filter("best")[0]
BODIES = [(4.5, 1.8), (5.0, 2.0), (7.1, 2.4), (12.0, 2.5), (16.5, 2.5), (18.0, 2.5)]
CLASS_OF_BODY = [0, 0, 1, 1, 2, 2]


def scene_of(bodies: list[tuple[float, float]], seed: int = 0) -> Observation:
    """Return a robot among vehicles of these bodies, near enough to have values."""
    random, count = np.random.default_rng(seed), len(bodies)
    lane, zeros = np.zeros(count, np.int64), np.zeros(count)
    length, width = np.array(bodies, float).reshape(-1, 2).T.copy()
    return Observation(
        0.0, np.array([100.0, 4.0, 0.03, 24.0]), 0.0, np.arange(count), random.uniform(60.0, 140.0, count),
        random.choice([0.0, 4.0, 8.0], count), zeros, random.uniform(18.0, 26.0, count), zeros, lane, lane,
        length, width,
    )  # fmt: skip


def states(seen: Observation) -> np.ndarray:
    x, y, heading, speed = seen.robot
    count = len(seen.x)
    return np.column_stack([x - seen.x, y - seen.y, np.full(count, heading), np.full(count, speed), seen.speed])


@pytest.mark.parametrize(
    ("length", "width", "kind"),
    [*((*body, kind) for body, kind in zip(BODIES, CLASS_OF_BODY, strict=True)), (2.2, 0.9, 0), (4.5, 2.1, 1),
     (5.1, 1.8, 1), (12.0, 2.6, 1), (12.5, 2.0, 2), (25.0, 2.55, 2)],
)  # fmt: skip
def test_a_body_is_of_the_smallest_class_that_it_fits_into(length, width, kind):
    assert class_of(np.array([[size.length, size.width] for size in SIZE_CLASSES]), length, width) == kind


def test_only_classes_that_are_met_have_tables(small_specification: Path, sized_table: ValueTable):
    assert classes_met([]) == (CAR,)
    assert classes_met([(16.5, 2.5), (4.0, 1.8)]) == (CAR, LONG_TRUCK)
    name = str(small_specification)
    assert [kept.size for kept in kept_tables(name, ROBOT, (CAR,))] == [CAR]
    kept = kept_tables(name, ROBOT, (CAR, LONG_TRUCK))
    assert [one.size for one in kept] == [CAR, LONG_TRUCK]
    assert kept[1].path != kept[0].path
    assert kept[1].is_solved
    table = load_tables(name, (CAR, LONG_TRUCK), robot=ROBOT)
    assert [each.size for each in table.by_size] == [CAR, LONG_TRUCK]
    read = read_tables(kept)
    assert all(
        np.array_equal(one.values, other.values) and one.size == other.size
        for one, other in zip(read.by_size, table.by_size, strict=True)
    )


def test_a_class_that_turns_out_to_be_met_is_added_in_its_place(small_specification: Path, sized_table: ValueTable):
    name = str(small_specification)
    table = load_tables(name, (CAR, LONG_TRUCK), robot=ROBOT)
    assert with_classes(table, name, (CAR, LONG_TRUCK), robot=ROBOT) is table
    more = with_classes(table, name, (VAN,), robot=ROBOT)
    assert [each.size for each in more.by_size] == list(SIZE_CLASSES)
    assert more.larger[1] is table.larger[0]


def test_a_table_that_no_robot_can_use_is_refused_before_it_is_solved():
    with pytest.raises(TableError, match="double_integrator has the state position, velocity; planning and filtering"):
        load_tables("double_integrator", (CAR,), robot=ROBOT, announce=lambda said: pytest.fail(said))


def test_a_game_that_says_nothing_about_sizes_has_one_table_for_all(tmp_path):
    (tmp_path / "air.toml").write_text(
        'dynamics = "air3d"\nhorizon = 0.1\nscheme = "first_order"\n[grid]\nlower = [-6.0, -10.0, 0.0]\n'
        "upper = [20.0, 10.0, 6.283185307179586]\nshape = [9, 9, 8]\n"
    )
    assert len(kept_tables(str(tmp_path / "air.toml"), ROBOT, SIZE_CLASSES)) == 1


def test_every_car_has_the_value_and_the_slopes_of_its_class(sized_table: ValueTable):
    seen = scene_of(BODIES * 20)
    values, at = car_values(sized_table, seen), states(seen)
    smooth = smooth_gradients(sized_table, seen, values)
    for kind, table in enumerate(sized_table.by_size):
        of_class = np.array(CLASS_OF_BODY * 20) == kind
        value, gradient = table.value_and_gradient(at[of_class])
        np.testing.assert_allclose(values.value[of_class], value, rtol=1e-6)
        np.testing.assert_allclose(values.gradient[of_class], gradient, rtol=1e-5, atol=1e-6)
        # The same as if there were this class alone.
        alone = dataclasses.replace(
            seen, **{name: getattr(seen, name)[of_class] for name in ("vehicle", "x", "y", "heading", "speed")},
            length=np.full(of_class.sum(), 5.0), width=np.full(of_class.sum(), 2.0),
        )  # fmt: skip
        only = dataclasses.replace(table, size=CAR)
        np.testing.assert_array_equal(smooth[of_class], smooth_gradients(only, alone, car_values(only, alone)))
    assert values.least == values.value.min() == values.value[values.nearest]


def test_rows_are_those_of_the_flow_of_each_cars_own_game(sized_table: ValueTable):
    without = [dataclasses.replace(t, game=dataclasses.replace(t.game, closed_rows=None)) for t in sized_table.by_size]
    from_flow = dataclasses.replace(without[0], larger=tuple(without[1:]))
    seen = scene_of(BODIES * 20, seed=1)
    values = car_values(sized_table, seen)
    cars, rows = rows_of_cars(sized_table, seen, values.value, values.gradient, 50.0)
    others, planes = rows_of_cars(from_flow, seen, values.value, values.gradient, 50.0)
    assert np.array_equal(cars, others)
    assert len(set(np.array(CLASS_OF_BODY * 20)[cars])) == 3
    np.testing.assert_allclose(rows[:4], planes, rtol=1e-4, atol=1e-4)


def test_a_truck_is_nearer_than_a_car_at_its_place_by_what_is_longer_of_it(sized_table: ValueTable):
    truck, car = scene_of([(18.0, 2.5)]), scene_of([(5.0, 2.0)])
    ahead = {"x": np.array([150.0]), "y": np.array([4.0]), "speed": np.array([20.0])}
    values = [
        float(
            car_values(sized_table, dataclasses.replace(each, robot=np.array([100.0, 4.0, 0.0, 22.0]), **ahead)).least
        )
        for each in (truck, car)
    ]
    # In the robot's own lane V is V(0, ·), which counts from bumper to bumper, up to what the coarse grids make of it.
    assert values[1] - values[0] == pytest.approx(6.5, abs=1.0)


def test_among_cars_alone_tables_of_larger_classes_change_nothing(sized_table: ValueTable):
    small_table = dataclasses.replace(sized_table, larger=())
    seen = scene_of([(4.8, 1.9)] * 60, seed=2)
    alone, sized = car_values(small_table, seen), car_values(sized_table, seen)
    assert np.array_equal(alone.value, sized.value)
    assert np.array_equal(alone.gradient, sized.gradient)
    assert (alone.least, alone.nearest) == (sized.least, sized.nearest)
    own, other = (rows_of_cars(t, seen, alone.value, alone.gradient, 9.0) for t in (small_table, sized_table))
    assert np.array_equal(own[0], other[0])
    assert np.array_equal(own[1], other[1])


def test_a_body_whose_class_has_no_table_is_judged_by_the_largest_that_there_is(
    small_specification: Path, sized_table: ValueTable
):
    vans = dataclasses.replace(load_table(str(small_specification), robot=ROBOT), larger=(sized_table.larger[0],))
    seen = scene_of([(16.5, 2.5)])
    beside = dataclasses.replace(seen, x=np.array([101.0]), y=np.array([8.0]), speed=np.array([24.0]))
    x, y, heading, speed = beside.robot
    least = min(
        float(sized_table.larger[0].value([x - 101.0 - a, y - 8.0, heading, speed, 24.0])[0])
        for a in np.linspace(-2.25, 2.25, 91)
    )
    assert float(car_values(vans, beside).least) == pytest.approx(least, abs=0.05)
