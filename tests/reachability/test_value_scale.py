import numpy as np
import pytest

from hj_cosim.reachability.table.value_scale import cube_root, scaled, steepness, unscaled


def test_the_cube_root_is_numpys() -> None:
    generator = np.random.default_rng(20)
    numbers = np.concatenate([generator.uniform(0.1, 500.0, 5000), 10.0 ** generator.uniform(-3.0, 12.0, 5000)])
    assert [cube_root(number) for number in numbers] == pytest.approx(np.cbrt(numbers), rel=1e-13)


def test_the_scale_is_odd_increasing_and_its_own_inverses_inverse() -> None:
    values = np.concatenate([-np.geomspace(1e5, 1e-6, 400), [0.0], np.geomspace(1e-6, 1e5, 400)])
    on_scale = np.array([scaled(value) for value in values])
    assert (np.diff(on_scale) > 0.0).all()
    assert on_scale == pytest.approx(-on_scale[::-1])
    assert [unscaled(each) for each in on_scale] == pytest.approx(values, rel=1e-9, abs=1e-12)


def test_the_cubic_of_a_gap_is_the_gap_again_where_it_is_long() -> None:
    assert scaled(4.0 * 20.0**3) == pytest.approx(20.0 - 0.5, abs=1e-3)


def test_the_steepness_is_the_slope_of_the_way_back() -> None:
    for each in np.linspace(-8.0, 8.0, 33) + 0.1:
        slope = (unscaled(each + 1e-5) - unscaled(each - 1e-5)) / 2e-5
        assert steepness(each) == pytest.approx(slope, rel=1e-6)
