"""The colours of the figures, as colour-blind readers and grey printers have them."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from hj_cosim.analysis.figures import stacks, style

# Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
DEFICIENCIES = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    "none": np.eye(3).tolist(),
}
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def _linear(colour: object) -> np.ndarray:
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* (D65) of linear sRGB."""
    xyz = _TO_XYZ @ linear / _TO_XYZ.sum(axis=1)
    x, y, z = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def lightness(colour: object) -> float:
    return float(_lab(_linear(colour))[0])


def test_the_measure_knows_black_white_and_the_grey_in_between():
    assert lightness("black") == pytest.approx(0.0, abs=1e-9)
    assert lightness("white") == pytest.approx(100.0, abs=0.01)
    assert lightness("#777777") == pytest.approx(50.0, abs=0.5)
    np.testing.assert_allclose(_lab(_linear("#ff0000")), [53.2, 80.1, 67.2], atol=0.2)


def _differ_in_grey(colours: list[str], least: float) -> None:
    for one, other in itertools.combinations(colours, 2):
        assert abs(lightness(one) - lightness(other)) >= least, (one, other)


def test_filters_differ_in_grey():
    _differ_in_grey([*stacks.FILTER_COLOURS.values(), stacks.OTHER_FILTER], 11.0)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_values_of_a_sweep_go_from_dark_to_light_and_stay_visible_on_white(count):
    shades = [lightness(shade) for shade in stacks.shades_of(count)]
    assert (np.diff(shades) > 11.0).all()
    assert shades[-1] < 80.0


def test_the_robot_is_the_dark_one_among_the_cars_and_marked_beside():
    assert lightness(style.CAR) - lightness(style.ROBOT) > 20.0
    assert lightness(style.ASPHALT) - lightness(style.CAR) > 10.0
    assert abs(lightness(style.INTERVENTION) - 100.0) < 15.0  # shading under lines stays light


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_who_is_colour_blind_tells_filters_robot_cars_and_rogues_apart(deficiency):
    seen = np.array(DEFICIENCIES[deficiency])
    groups = [
        [*stacks.FILTER_COLOURS.values(), stacks.OTHER_FILTER],
        [style.ROBOT, style.CAR, style.ROGUE],
        [style.VALUE_COLOURS(0.45), style.VALUE_COLOURS(0.55)],
        stacks.shades_of(4),
    ]
    for colours in groups:
        for one, other in itertools.combinations(colours, 2):
            apart = np.linalg.norm(_lab(seen @ _linear(one)) - _lab(seen @ _linear(other)))
            assert apart > 15.0, (one, other)


def test_values_get_lighter_the_safer_they_are_and_change_their_hue_at_zero():
    places = np.linspace(0.0, 1.0, 41)
    shades = np.array([lightness(style.VALUE_COLOURS(place)) for place in places])
    assert (np.diff(shades) > 0.0).all()
    below, above = style.VALUE_COLOURS(0.499), style.VALUE_COLOURS(0.501)
    assert below[0] > below[2]  # red
    assert above[2] > above[0]  # blue
