import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.study.stacks import PAPER_STACKS, Stack, parse_stack
from hj_cosim.study.tables import STACK_COLUMNS, paper_table


def test_the_ten_stacks_come_in_the_order_of_the_papers_table():
    rows = [tuple(row) for row in paper_table()[list(STACK_COLUMNS)].itertuples(index=False)]
    assert [(stack.planner, stack.filter, stack.scheme) for stack in PAPER_STACKS] == rows


@pytest.mark.parametrize("stack", PAPER_STACKS)
def test_a_stack_is_found_by_its_name(stack):
    assert parse_stack(stack.name) == stack


def test_a_stack_is_labelled_as_the_paper_writes_it():
    assert Stack("hjop", "spc", "mi").label == "HJOP + SPC + MI"
    assert Stack("op", "none").label == "OP + None"


@pytest.mark.parametrize("name", ["hjop", "hjop-spc", "hjop-none-mi", "mpc-spc-mi", "hjop-spc-mi-mi", ""])
def test_an_unknown_stack_is_refused_with_an_example(name):
    with pytest.raises(ConfigurationError, match="for example hjop-spc-mi"):
        parse_stack(name)
