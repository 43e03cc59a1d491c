import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.study.design import Variation, design_study, parse_variation
from hj_cosim.study.stacks import PAPER_STACKS, Stack

PROPOSED = (Stack("hjop", "spc", "mi"),)


def test_the_default_is_the_papers_ten_stacks_on_twenty_seeds():
    design = design_study()
    assert [cell.stack for cell in design.cells] == list(PAPER_STACKS)
    assert design.seeds == tuple(range(20))


def test_every_row_is_driven_on_the_same_seeds_and_seeds_come_first():
    design = design_study(episodes=2, seed=1000, stacks=PAPER_STACKS[:3])
    order = [(seed, cell.stack) for cell, seed in design.episodes()]
    assert order == [(seed, stack) for seed in (1000, 1001) for stack in PAPER_STACKS[:3]]


def test_configurations_hold_the_stack_and_drive_through_collisions():
    for cell in design_study(preset="paper").cells:
        assert cell.config.planner.kind == cell.stack.planner
        assert cell.config.filter.kind == cell.stack.filter
        assert cell.stack.filter == "none" or cell.config.filter.scheme == cell.stack.scheme
        assert cell.config.simulation.on_collision == "continue"
        assert cell.config.preset == "paper"


def test_a_sweep_has_a_row_for_every_combination_and_columns_for_what_varies():
    variations = (parse_variation("planner.gamma_r=0.8,0.9"), parse_variation("filter.epsilon=1,2,5"))
    design = design_study(("light", "paper"), stacks=PROPOSED, variations=variations, episodes=1)
    assert len(design.cells) == 2 * 2 * 3
    assert design.cells[1].factors == {
        "scenario": "light",
        "planner.gamma_r": 0.8,
        "filter.epsilon": 2,
        "planner": "hjop",
        "filter": "spc",
        "scheme": "mi",
    }
    assert design.cells[1].config.planner.gamma_r == 0.8
    assert design.cells[1].config.filter.epsilon == 2.0


def test_run_folders_are_named_for_what_varies_only():
    plain = design_study(stacks=PROPOSED)
    assert plain.folder_name(plain.cells[0]) == "hjop-spc-mi"
    swept = design_study(
        ("light", "paper"), stacks=PROPOSED, variations=(Variation("planner.gamma_r", ("0.8", "1.0")),)
    )
    assert swept.folder_name(swept.cells[3]) == "paper/planner.gamma_r=1.0/hjop-spc-mi"
    assert len({swept.folder_name(cell) for cell in swept.cells}) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("planner.gamma_r", "write KEY=VALUE,VALUE"),
        ("planner.gamma_r=", "write KEY=VALUE,VALUE"),
        ("=0.8,0.9", "write KEY=VALUE,VALUE"),
        ("planner.gamma_r=0.8,,0.9", "write KEY=VALUE,VALUE"),
        ("planner.gamma_r=0.8,0.8", "a value is there twice"),
        ("planner.gamma_r=0.8,0.9,8e-1", "a value is there twice"),
        ("planner.kind=hjop,op", "a study sets planner.kind itself"),
        ("seed=1,2", "a study sets seed itself"),
    ],
)
def test_a_variation_that_makes_no_sense_is_refused(text, said):
    with pytest.raises(ConfigurationError, match=said):
        parse_variation(text)


@pytest.mark.parametrize("key", ["planner.kind", "filter.kind", "filter.scheme", "seed"])
def test_a_setting_that_would_make_a_rows_name_untrue_is_refused(key):
    with pytest.raises(ConfigurationError, match=f"--set {key}=1: a study sets {key} itself; choose stacks and seeds"):
        design_study(stacks=PROPOSED, settings=(f"{key}=1",))


def test_what_is_varied_is_not_set_or_varied_besides():
    varied, again = parse_variation("planner.gamma_r=0.8,0.9"), parse_variation("planner.gamma_r=1")
    said = r"--set planner\.gamma_r=0\.7: --vary planner\.gamma_r=0\.8,0\.9 gives that setting; leave one of them out"
    with pytest.raises(ConfigurationError, match=said):
        design_study(stacks=PROPOSED, variations=(varied,), settings=("filter.epsilon=1", "planner.gamma_r=0.7"))
    with pytest.raises(ConfigurationError, match=r"--vary planner\.gamma_r=1 and --vary .* vary the same setting"):
        design_study(stacks=PROPOSED, variations=(varied, again))


def test_a_wrong_value_in_a_sweep_names_option_key_and_value():
    variations = (parse_variation("planner.gamma_r=0.8,1.5"),)
    with pytest.raises(ConfigurationError, match=r"^--vary planner\.gamma_r=1\.5: planner\.gamma_r = 1\.5"):
        design_study(stacks=PROPOSED, variations=variations)


def test_a_row_cannot_be_there_twice():
    with pytest.raises(ConfigurationError, match="the row hjop-spc-mi twice"):
        design_study(stacks=PROPOSED * 2)
    with pytest.raises(ConfigurationError, match="twice"):
        design_study(("paper", "paper"), stacks=PROPOSED)


@pytest.mark.parametrize("changes", [{"episodes": 0}, {"stacks": ()}, {"scenarios": ()}])
def test_an_empty_study_is_refused(changes):
    with pytest.raises(ConfigurationError, match="a study needs"):
        design_study(**changes)
