"""The list of all settings: complete, explained, and true."""

import inspect
from collections.abc import Iterator

import pytest

from hj_cosim import settings
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import EpisodeConfig, NormalDistribution, Settings, list_settings, unit_of


def groups() -> Iterator[type[Settings]]:
    for _, kind in inspect.getmembers(settings, inspect.isclass):
        if issubclass(kind, Settings) and kind is not Settings:
            yield kind


@pytest.mark.parametrize("group", tuple(groups()))
def test_every_setting_is_described_and_every_real_number_has_its_unit(group):
    for name, field in group.model_fields.items():
        assert field.description, f"{group.__name__}.{name} has no description"
        of_what_is_drawn = group is NormalDistribution and name in ("mean", "deviation")
        if field.annotation in (float, float | None) and not of_what_is_drawn:
            assert unit_of(field), f"{group.__name__}.{name} has no unit; take Metres, Number, ..."


@pytest.mark.parametrize("preset", ["best", "paper"])
def test_list_has_every_leaf_of_a_configuration_with_its_default(preset):
    def leaves(value, key=""):
        if isinstance(value, dict) and value:
            for name, below in value.items():
                yield from leaves(below, f"{key}.{name}" if key else name)
        else:
            yield key, value

    config = EpisodeConfig.model_validate(
        resolve_config("paper", preset=preset).model_dump() | {"scenario": {"name": "x"}}
    )
    listed = {entry.key: entry for entry in list_settings()}
    expected = dict(leaves(config.model_dump()))
    assert listed.keys() == expected.keys()
    for key, value in expected.items():
        if not key.startswith("scenario."):
            assert getattr(listed[key], "default" if preset == "best" else "paper") == value, key


def test_entry_of_a_distribution_speaks_of_what_is_drawn():
    entry = next(entry for entry in list_settings() if entry.key == "scenario.drivers.time_headway.mean")
    assert (entry.unit, entry.default, entry.allowed) == ("s", 1.5, "> 0")
    assert entry.description == "IDM's T, behind the leader: the mean"


def test_group_is_a_part_of_the_list_and_an_unknown_one_is_refused():
    assert {entry.key.split(".")[0] for entry in list_settings("planner")} == {"planner"}
    assert [entry.key for entry in list_settings("planner.gamma_r")] == ["planner.gamma_r"]
    with pytest.raises(ConfigurationError, match="no settings are called 'plan'; choose one of robot, tracking"):
        list_settings("plan")
