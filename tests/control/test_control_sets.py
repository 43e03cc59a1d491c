import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.control.control_sets import control_sets, intersection_polygon
from hj_cosim.control.problem.safety_problem import SafetyRows
from hj_cosim.control.safety_filter import make_filter
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings

BOX = np.array([-0.3, 0.3, -6.0, 4.0])
ROBOT = RobotSettings()


def rows_of(rows):
    p, q, c = np.array(rows, float).reshape(-1, 3).T
    return SafetyRows(np.arange(len(p)), np.zeros(len(p)), p, q, c)


def area(polygon):
    x, y = polygon.T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_without_rows_the_polygon_is_the_box_and_with_rows_that_exclude_each_other_it_is_empty():
    assert area(intersection_polygon(rows_of([]), BOX)) == pytest.approx(0.6 * 10.0)
    assert intersection_polygon(rows_of([[1.0, 0.0, -0.1], [-1.0, 0.0, -0.1]]), BOX).shape == (0, 2)


@given(
    rows=st.lists(st.tuples(st.floats(-50, 50), st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=4),
    points=st.lists(st.tuples(st.floats(-0.3, 0.3), st.floats(-6.0, 4.0)), min_size=1, max_size=10),
)
def test_the_polygon_holds_exactly_the_controls_that_meet_all_rows(rows, points):
    half_planes = rows_of(rows)
    polygon = intersection_polygon(half_planes, BOX)
    for omega, acceleration in polygon:
        assert half_planes.margins(omega, acceleration).min() >= -1e-6
    edges = np.roll(polygon, -1, axis=0) - polygon
    for point in points:
        margin = half_planes.margins(*point).min()
        to_point = np.array(point) - polygon
        left_of_all = (
            bool(len(polygon)) and (edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0]).min() >= -1e-9
        )
        if margin > 1e-6:
            assert left_of_all
        elif margin < -1e-3 and len(polygon) and area(polygon) > 1e-3:
            assert not left_of_all or margin > -1e-2


def test_the_sets_at_an_instant_hold_what_the_filters_choose_there(table, observe):
    observations = [
        observe([0.02 * 26 * k, 4.0, 0.0, 26.0], [[33.0 - 0.1 * k, 4.0, 0.0, 22.0], [3.0, 7.2, 0.0, 26.0]], 0.02 * k)
        for k in range(3)
    ]
    desired, settings = Control(0.1, 2.0), FilterSettings()
    sets = control_sets(observations, desired, settings, ROBOT, table, previous_omega=0.0)
    assert set(sets) == {"spc", "rss"}
    for kind, found in sets.items():
        filter_settings = settings.model_copy(update={"kind": kind})
        safety_filter = make_filter(filter_settings, ROBOT, table, 0.02)
        result = [safety_filter.filter(seen, desired) for seen in observations][-1]
        assert found.minimally_interventional == result.control
        assert found.desired == result.desired
        assert len(found.rows) == len(result.rows) > 0
        assert found.switching != found.desired
        if result.meetable:
            chosen = found.minimally_interventional
            assert found.rows.margins(chosen.omega, chosen.acceleration).min() >= -1e-4
