"""Planners and filters by reference: found, made with what they ask for, and blamed in one sentence where they fail."""

import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import field_validator

from hj_cosim import plugins
from hj_cosim.errors import ConfigurationError, HjCosimError, PluginError
from hj_cosim.planning.guard import GuardedPlanner
from hj_cosim.planning.idle import IdlePlanner
from hj_cosim.plugin_answers import named, shown_answer
from hj_cosim.plugins import FILTER, PLANNER, construct, find_plugin, given, options_of, whole_reference
from hj_cosim.scene.observation import Target
from hj_cosim.traffic.fake import FakeWorld

KEEP = """
from hj_cosim.planning.contract import Plan

class Keep:
    def plan(self, observation, previous):
        return Plan(0, previous)

class Helpless:
    pass
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Return a function that writes mine.py into the current folder."""
    monkeypatch.chdir(tmp_path)
    return lambda text: (tmp_path / "mine.py").write_text(text)


def test_a_class_is_found_by_name_by_file_and_by_module(mine):
    mine(KEEP)
    assert find_plugin(PLANNER, "idle") is IdlePlanner
    assert find_plugin(PLANNER, "hj_cosim.planning.idle:IdlePlanner") is IdlePlanner
    found = find_plugin(PLANNER, "mine.py:Keep")
    assert found.__name__ == "Keep"
    assert find_plugin(PLANNER, whole_reference(PLANNER, "mine.py:Keep")) is found


def test_a_file_that_changes_is_read_anew(mine):
    mine(KEEP)
    first = find_plugin(PLANNER, "mine.py:Keep")
    mine(KEEP + "\n# changed\n")
    assert find_plugin(PLANNER, "mine.py:Keep") is not first


def test_entry_points_are_names_like_ours_and_take_none_of_ours(monkeypatch):
    def entry_points(group):
        assert group == "hj_cosim.planners"
        values = {"calm": "hj_cosim.planning.idle:IdlePlanner", "hjop": "hj_cosim.planning.idle:IdlePlanner"}
        return [importlib.metadata.EntryPoint(name, value, group) for name, value in values.items()]

    monkeypatch.setattr(plugins, "entry_points", entry_points)
    assert find_plugin(PLANNER, "calm") is IdlePlanner
    assert find_plugin(PLANNER, "hjop") is not IdlePlanner


@pytest.mark.parametrize(
    ("text", "reference", "said"),
    [
        ("", "dijkstra", "no planner is called so; choose one of hjop, op, mppi, idle, or write FILE.py:Class"),
        ("", "nowhere.py:Keep", "cannot read .*nowhere.py: No such file"),
        ("", "mine.py:Keep", "mine.py has no class 'Keep'"),
        (KEEP, "mine.py:Kept", "has no class 'Kept'; it has Keep$"),
        (KEEP, "mine.py:Helpless", "mine.py:8: Helpless has no method 'plan', which a planner needs"),
        ("x = (", "mine.py:Keep", r"cannot be imported: mine.py:1: SyntaxError"),
        ("\nx = 1 / 0", "mine.py:Keep", r"cannot be imported: mine.py:2: ZeroDivisionError: division by zero"),
        ("import nothing_such", "mine.py:Keep", "mine.py:1: ModuleNotFoundError: No module named 'nothing_such'"),
        ("raise SystemExit(3)", "mine.py:Keep", "mine.py:1: SystemExit: 3"),
        ("", "nothing_such.planners:Keep", "there is no module 'nothing_such'; is its package installed"),
        ("", "hj_cosim.planning.idle:Keep", "has no class 'Keep'; it has IdlePlanner"),
        ("", "hj_cosim.planning.contract:IDLE", "has no class 'IDLE'"),
        ("", ":Keep", "cannot be imported"),
        ("", "\x00.py:Keep", "no file has such a path"),
        ("", "~nobody_such/mine.py:Keep", "no file has such a path"),
    ],
)
def test_what_cannot_be_found_is_named_in_one_sentence(mine, text, reference, said):
    mine(text)
    with pytest.raises(HjCosimError, match=said) as raised:
        find_plugin(PLANNER, reference)
    assert isinstance(raised.value, ConfigurationError | PluginError)
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith("planner.kind = ")


class Curious:
    def __init__(self, road, robot, depth=3, *_, **more):
        self.handed = (road, robot, depth, more)

    def plan(self, observation, previous): ...


class Demanding(Curious):
    def __init__(self, weather):
        raise AssertionError("not to be called")


class Failing(Curious):
    def __init__(self):
        raise ValueError("not today")


def test_a_constructor_is_handed_what_it_asks_for_and_nothing_else():
    made = construct(PLANNER, Curious, {"road": 1, "robot": 2, "table": 3})
    assert made.handed == (1, 2, 3, {})
    assert construct(PLANNER, made, {"road": 4}) is made


def test_a_constructor_that_asks_for_what_there_is_not_or_fails_is_named():
    with pytest.raises(
        PluginError, match=r"test_plugins.py:\d+: Demanding asks for 'weather'; a planner may ask for road"
    ):
        construct(PLANNER, Demanding, {"road": 1})
    with pytest.raises(PluginError, match=r"test_plugins.py:\d+: Failing.__init__ raised ValueError: not today"):
        construct(PLANNER, Failing, {})


def test_options_are_the_class_s_own_settings_and_others_are_refused():
    class Tuned(Curious):
        class Options(plugins.Settings):
            margin: float = 5.0

    class Loose(Curious):
        Options = dict

    assert options_of(PLANNER, Tuned, {}).margin == 5.0
    assert options_of(PLANNER, Tuned, {"margin": 8}).margin == 8.0
    with pytest.raises(ConfigurationError, match=r"planner\.options: unknown key 'magrin'; known keys are margin"):
        options_of(PLANNER, Tuned, {"magrin": 8})
    with pytest.raises(ConfigurationError, match=r"filter\.options: margin = 'wide'"):
        options_of(FILTER, Tuned, {"margin": "wide"})
    with pytest.raises(ConfigurationError, match=r"planner\.options: 'margin' is given, but Curious has none"):
        options_of(PLANNER, Curious, {"margin": 8})
    with pytest.raises(ConfigurationError, match=r"Loose.Options must be a subclass of hj_cosim.settings.Settings"):
        options_of(PLANNER, Loose, {})
    assert options_of(PLANNER, Curious, {}) is None


def test_options_that_pydantic_cannot_use_or_that_fail_are_named_with_their_place():
    class Unfinished(Curious):
        class Options(plugins.Settings):
            margin: "Metres" = 5.0  # noqa: F821

    class Raising(Curious):
        class Options(plugins.Settings):
            margin: float = 5.0

            @field_validator("margin")
            @classmethod
            def judge(cls, margin):
                return {}[margin]

    with pytest.raises(PluginError, match=r"^planner\.options: .*test_plugins.py:\d+: .*Options: .* not fully defined"):
        options_of(PLANNER, Unfinished, {})
    with pytest.raises(PluginError, match=r"^planner\.options: .*test_plugins.py:\d+: .*Options: KeyError: 3\.0$"):
        options_of(PLANNER, Raising, {"margin": 3.0})


class Speechless(Exception):
    def __str__(self):
        raise ValueError("nothing to say")

    __repr__ = __str__


def test_an_error_and_an_answer_that_cannot_be_shown_are_called_by_their_class():
    assert named(Speechless()) == "Speechless"
    assert shown_answer(Speechless()) == "a Speechless"
    assert shown_answer("a" * 100) == f"'{'a' * 59}..."


def test_a_method_that_takes_other_arguments_is_placed_in_its_file():
    class Narrow:
        def plan(self):
            raise AssertionError("not to be called")

    line = Narrow.plan.__code__.co_firstlineno
    world = FakeWorld()
    with pytest.raises(PluginError, match=rf"^\S*test_plugins.py:{line}: Narrow.plan raised TypeError: .*takes 1 pos"):
        GuardedPlanner(Narrow(), world.road).plan(world.observe(), Target(0, 20.0))


def test_a_class_or_an_object_that_was_given_is_found_under_its_reference():
    class Local(Curious):
        pass

    reference = given(PLANNER, Local)
    assert plugins.plugin_name(reference) == "Local"
    assert find_plugin(PLANNER, reference) is Local
    made = Local(1, 2)
    assert find_plugin(PLANNER, given(PLANNER, made)) is made
    with pytest.raises(ConfigurationError, match="has no method 'filter'"):
        find_plugin(FILTER, given(FILTER, Local))


def test_contracts_import_no_implementation():
    """In a process of its own, for here everything has been imported already."""
    script = (
        "import sys, hj_cosim.planning.contract, hj_cosim.control.contract, hj_cosim.traffic.contract;"
        "print([n for n in sys.modules if n.startswith('hj_cosim.') and 'settings' not in n"
        " and any(part in n for part in"
        " ('optimistic', 'spc', 'rss', 'solver', 'lookup', 'table', 'problem', 'sumo'))])"
    )
    printed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_every_name_of_ours_is_a_class_with_its_method():
    for kind in (PLANNER, FILTER):
        for name in kind.ours:
            assert callable(getattr(find_plugin(kind, name), kind.method))


def blocks_of_the_readme() -> dict[str, str]:
    """Return the README's Python files by the name in their first line."""
    text = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(# (\w+\.py).*?)```", text, flags=re.DOTALL)
    return {name: block for block, name in blocks}


@pytest.mark.parametrize("example", ["mine.py:KeepRight", "careful.py:KeepAway"])
def test_the_readme_s_examples_keep_their_contracts(mine, tmp_path, example):
    from hj_cosim.testing import check_filter, check_planner

    name = example.split(":")[0]
    (tmp_path / name).write_text(blocks_of_the_readme()[name])
    (check_planner if name == "mine.py" else check_filter)(example)
