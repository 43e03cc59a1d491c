"""IDM against the formula of its paper, written out once more, and against what it promises."""

import math

import numpy as np
import pytest

from hj_cosim.vehicles.idm import equilibrium_speed, idm_acceleration

DRIVER = np.array([30.0, 3.0, 5.0, 1.5, 5.0, 4.0])


def by_the_paper(v: float, s: float, dv: float, driver: np.ndarray) -> float:
    """Return v' of Treiber, Hennecke, Helbing (2000), eqs. 2 and 3, with s_1 = 0."""
    v0, a, b, time, s0, delta = driver
    s_star = s0 + max(0.0, time * v + v * dv / (2.0 * math.sqrt(a * b)))
    return a * (1.0 - (v / v0) ** delta - (s_star / s) ** 2)


@pytest.mark.parametrize("exponent", [4.0, 2.5])
def test_it_is_the_papers_formula(exponent):
    random = np.random.default_rng(1)
    driver = DRIVER.copy()
    driver[5] = exponent
    for speed, gap, lead_speed in random.uniform([0.0, 0.2, 0.0], [40.0, 200.0, 40.0], (200, 3)):
        expected = by_the_paper(speed, gap, speed - lead_speed, driver)
        assert idm_acceleration(speed, gap, lead_speed, driver) == pytest.approx(expected, rel=1e-12)


def test_an_endless_gap_is_a_free_road():
    assert idm_acceleration(20.0, math.inf, 0.0, DRIVER) == pytest.approx(by_the_paper(20.0, 1e12, 0.0, DRIVER))


def test_touching_cars_brake_hard_but_finitely():
    assert -1e6 < idm_acceleration(20.0, 0.0, 20.0, DRIVER) < -1e3
    assert idm_acceleration(20.0, -3.0, 20.0, DRIVER) == idm_acceleration(20.0, 0.0, 20.0, DRIVER)


@pytest.mark.parametrize("gap", [6.0, 20.0, 60.0, 300.0])
def test_nobody_accelerates_or_brakes_at_the_equilibrium_speed(gap):
    speed = equilibrium_speed(gap, DRIVER)
    assert idm_acceleration(speed, gap, speed, DRIVER) == pytest.approx(0.0, abs=1e-5)


def test_the_equilibrium_speed_grows_from_rest_at_the_minimum_gap_to_the_desired_speed():
    speeds = [equilibrium_speed(gap, DRIVER) for gap in (0.0, 4.9, 5.1, 10.0, 50.0, 500.0, math.inf)]
    assert speeds[:2] == [0.0, 0.0]
    assert np.all(np.diff(speeds[1:]) > 0.0)
    assert speeds[-1] == pytest.approx(30.0, abs=1e-5)


def test_a_platoon_comes_to_rest_behind_a_standing_car_without_touching_it():
    position, speed = np.array([0.0, -30.0, -60.0]), np.full(3, 20.0)
    for _ in range(3000):
        lead_position, lead_speed = np.append(100.0, position[:-1]), np.append(0.0, speed[:-1])
        gaps = lead_position - position - 5.0
        assert gaps.min() > 0.0
        acceleration = [idm_acceleration(v, s, u, DRIVER) for v, s, u in zip(speed, gaps, lead_speed, strict=True)]
        speed = np.maximum(speed + 0.02 * np.array(acceleration), 0.0)
        position = position + 0.02 * speed
    np.testing.assert_allclose(gaps, 5.0, atol=0.6)
