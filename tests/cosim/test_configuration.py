"""Which layer of the configuration lies over which."""

import tomllib

import pytest

from hj_cosim.cosim.configuration import config_toml, resolve_config, stack_flags
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.store import find_specification, read_specification


@pytest.fixture
def scenario_with_fast_drivers(tmp_path):
    path = tmp_path / "fast.toml"
    path.write_text("[drivers.desired_speed]\nmean = 28.0\ndeviation = 2.0\n")
    return str(path)


def test_best_keeps_an_escape_on_a_capped_table_and_paper_does_neither_of_it():
    for preset, both in (("best", True), ("paper", False)):
        config = resolve_config("paper", preset=preset)
        assert config.filter.keep_escape is both
        assert read_specification(find_specification(config.table)).capped_by_manoeuvres is both


def test_preset_lies_over_the_defaults_and_under_the_scenario(scenario_with_fast_drivers):
    assert resolve_config("paper").scenario.drivers.desired_speed.mean == 24.0
    assert resolve_config("paper", preset="paper").scenario.drivers.desired_speed.mean == 23.0
    assert resolve_config(scenario_with_fast_drivers, preset="paper").scenario.drivers.desired_speed.mean == 28.0


def test_assignments_lie_over_flags_and_the_last_wins():
    config = resolve_config(
        flags=stack_flags(planner="op", seed=3), assignments=["planner.kind=idle", "planner.kind=hjop", "seed=5"]
    )
    assert (config.planner.kind, config.seed) == ("hjop", 5)


def test_flags_that_were_not_given_change_nothing():
    assert resolve_config(flags=stack_flags()) == resolve_config()


def test_config_toml_says_everything(scenario_with_fast_drivers):
    config = resolve_config(scenario_with_fast_drivers)
    assert type(config).model_validate(tomllib.loads(config_toml(config))) == config


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"preset": "bset"}, "no preset is called 'bset'; choose one of best, paper"),
        ({"scenario": "papr"}, "no scenario is called 'papr'"),
        ({"flags": stack_flags(duration=-1.0)}, r"the command line: simulation\.duration = -1\.0"),
    ],
)
def test_wrong_name_or_flag_is_named(arguments, said):
    with pytest.raises(ConfigurationError, match=said):
        resolve_config(**arguments)
