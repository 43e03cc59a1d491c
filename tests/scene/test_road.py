"""The road frame, checked against rotations written out with complex numbers."""

import numpy as np
import pytest

from hj_cosim.scene.road import Road


def test_a_road_along_x_from_the_origin_is_the_identity():
    road = Road(lane_count=4)
    x, y, heading = np.array([3.0, 900.0]), np.array([-1.0, 12.5]), np.array([0.1, -0.2])
    for there in (road.to_world(x, y, heading), road.from_world(x, y, heading)):
        np.testing.assert_array_equal(there, [x, y, heading])


def test_world_and_road_coordinates_agree_with_a_rotation_of_the_complex_plane():
    road = Road(lane_count=3, origin_x=100.0, origin_y=-50.0, heading=2.3)
    random = np.random.default_rng(0)
    along, lateral, heading = random.uniform(-100, 100, (3, 50))
    x, y, world_heading = road.to_world(along, lateral, heading)
    np.testing.assert_allclose(x + 1j * y, (100 - 50j) + (along + 1j * lateral) * np.exp(2.3j), atol=1e-12)
    np.testing.assert_allclose(world_heading, heading + 2.3)
    np.testing.assert_allclose(road.from_world(x, y, world_heading), [along, lateral, heading], atol=1e-12)


@pytest.mark.parametrize(
    ("lateral", "lane"), [(-9.0, 0), (-1.9, 0), (1.74, 0), (1.76, 1), (3.5, 1), (7.0, 2), (8.7, 2), (99.0, 2)]
)
def test_a_lateral_offset_belongs_to_the_nearest_lane_of_the_road(lateral, lane):
    road = Road(lane_count=3, lane_width=3.5)
    assert road.lane_at(lateral) == lane
    assert road.lane_centre(lane) == 3.5 * lane
