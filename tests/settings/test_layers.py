"""The configuration: what is refused, how, and in which order layers lie."""

import math

import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import (
    EpisodeConfig,
    NormalDistribution,
    PlannerSettings,
    Scenario,
    SimulationSettings,
    overlay,
    parse_assignment,
    read_toml,
    validate,
)


def test_unknown_key_is_named_with_the_known_ones():
    with pytest.raises(ConfigurationError, match=r"mine\.toml: unknown key 'traffic\.cuont'; known keys are count,"):
        validate(Scenario, {"name": "x", "traffic": {"cuont": 3}}, "mine.toml")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"discount": 1.0}, r"discount = 1\.0: input should be less than 1"),
        ({"expansions": 0}, r"expansions = 0: input should be greater than or equal to 1"),
        ({"gamma_r": "much"}, r"gamma_r = 'much': input should be a valid number"),
        ({"kind": 3}, r"kind = 3: input should be a valid string"),
        ({"value_clip": math.nan}, r"value_clip = nan: input should be a finite number"),
        ({"speed_low": 30.0, "speed_high": 20.0}, r"speed_high \(20\.0\) must exceed speed_low \(30\.0\)"),
    ],
)
def test_wrong_value_is_named_with_its_key_and_what_would_be_right(data, said):
    with pytest.raises(ConfigurationError, match=said):
        validate(PlannerSettings, data, "somewhere")


@pytest.mark.parametrize(
    ("given", "traffic_step"),
    [({"step": 0.05}, 0.1), ({"step": 0.03}, 0.09), ({"step": 0.1}, 0.1), ({"step": 0.02, "traffic_step": 0.04}, 0.04)],
)
def test_a_step_that_is_given_alone_gets_the_traffic_step_that_fits_it(given, traffic_step):
    assert SimulationSettings.model_validate(given).traffic_step == pytest.approx(traffic_step)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"traffic_step": 0.05}, r"traffic_step \(0\.05 s\) must be a multiple of simulation\.step \(0\.02 s\).*0\.04"),
        ({"step": 0.1, "traffic_step": 0.02}, r"traffic_step \(0\.02 s\) must be a multiple of simulation\.step"),
        ({"traffic_step": 0.6}, r"traffic_step = 0\.6: input should be less than or equal to 0\.5"),
        ({"step": -1.0}, r"step = -1\.0: input should be greater"),
    ],
)
def test_a_traffic_step_that_fits_no_step_is_refused(given, said):
    with pytest.raises(ConfigurationError, match=said):
        validate(SimulationSettings, given, "somewhere")


def test_distribution_that_reaches_zero_is_refused():
    with pytest.raises(ConfigurationError, match="reaches zero"):
        validate(NormalDistribution, {"mean": 1.0, "deviation": 0.5}, "drivers")


def test_overlay_keeps_what_the_upper_layer_does_not_name():
    assert overlay({"a": {"x": 1, "y": 2}, "b": 3}, {"a": {"y": 5}}) == {"a": {"x": 1, "y": 5}, "b": 3}


@pytest.mark.parametrize(
    ("text", "nested"),
    [
        ("planner.gamma_r=0.8", {"planner": {"gamma_r": 0.8}}),
        ("filter.solver=osqp", {"filter": {"solver": "osqp"}}),
        ("seed = 4", {"seed": 4}),
        ("scenario.network.file=a=b.net.xml", {"scenario": {"network": {"file": "a=b.net.xml"}}}),
    ],
)
def test_assignment_is_toml_or_else_text(text, nested):
    assert parse_assignment(text) == nested


@pytest.mark.parametrize("text", ["planner.gamma_r", "=3", "planner.=3", ""])
def test_assignment_without_key_or_value_is_refused(text):
    with pytest.raises(ConfigurationError, match="write KEY=VALUE"):
        parse_assignment(text)


def test_settings_cannot_be_changed_after_they_were_checked():
    config = EpisodeConfig(scenario=Scenario(name="x"))
    with pytest.raises(ValueError, match="frozen"):
        config.seed = 3


def test_file_that_is_not_toml_is_refused_with_its_place(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("name = \n")
    with pytest.raises(ConfigurationError, match=r"mine\.toml is not TOML: .*line 1"):
        read_toml(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigurationError, match="is not TOML"):
        read_toml(path)
    with pytest.raises(ConfigurationError, match=r"cannot read .*No such file"):
        read_toml(tmp_path / "absent.toml")
