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


OWN = {
    "mine.py:KeepRight/spc-mi": ("KeepRight-spc-mi", "KeepRight + SPC + MI"),
    "dir/mine.py:KeepRight/rss-sw": ("KeepRight-rss-sw", "KeepRight + RSS + SW"),
    "/abs/olute/mine.py:KeepRight/none": ("KeepRight-none", "KeepRight + None"),
    "package.module:KeepRight/none": ("KeepRight-none", "KeepRight + None"),
    "hjop/mine.py:Cautious": ("hjop-Cautious", "HJOP + Cautious"),
    "hjop/mine.py:Cautious-sw": ("hjop-Cautious-sw", "HJOP + Cautious + SW"),
    "a/b.py:Keep/c/d.py:Cautious-mi": ("Keep-Cautious-mi", "Keep + Cautious + MI"),
    "hjop/mine.py:KeepRight/spc-mi": ("KeepRight-spc-mi", "KeepRight + SPC + MI"),  # a file in the folder hjop
    "hjop/spc-mi": ("hjop-spc-mi", "HJOP + SPC + MI"),
}


@pytest.mark.parametrize("text", OWN)
def test_a_stack_may_hold_a_users_own_classes(text):
    stack = parse_stack(text)
    assert (stack.name, stack.label) == OWN[text]
    assert "/" not in stack.name
    assert parse_stack(stack.text) == stack
    assert stack.columns["planner"] == stack.name.split("-")[0]


def test_a_users_file_is_named_by_its_whole_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stack = parse_stack("mine.py:KeepRight/spc-mi")
    assert stack.flags == {
        "planner": {"kind": f"{tmp_path}/mine.py:KeepRight"},
        "filter": {"kind": "spc", "scheme": "mi"},
    }
    assert parse_stack("hjop/package.module:Cautious").flags["filter"] == {"kind": "package.module:Cautious"}


@pytest.mark.parametrize(
    "text",
    ["mine.py:KeepRight", "mine.py:KeepRight-spc-mi", "mine.py:KeepRight/spc", "mine.py:/none", "mine.py:K-R/none",
     "dir/mine.txt:KeepRight/none", "/spc-mi", "hjop/", "hjop/none-mi", "a.py:B/mine.py:Cautious-xx"],
)  # fmt: skip
def test_what_is_no_reference_is_refused(text):
    with pytest.raises(ConfigurationError, match=r"mine\.py:KeepRight/spc-mi"):
        parse_stack(text)


def test_two_classes_of_one_name_are_two_rows_that_cannot_be_told_apart():
    stacks = tuple(parse_stack(f"{file}.py:KeepRight/none") for file in ("one", "other"))
    assert stacks[0] != stacks[1]
    assert stacks[0].name == stacks[1].name
