"""Whatever the library's functions are given, they take it, or say in one sentence what would be right."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

import hj_cosim
from hj_cosim import run
from hj_cosim.analysis.export import export_run
from hj_cosim.errors import HjCosimError

STRANGE = (
    *(None, True, 3, -1, 10**400, 1.5, math.nan, math.inf, b"x", object(), int),
    *([], [None], (), {}, {1: 2}, np.zeros(3), Path("/nowhere"), Path("\x00")),
    *("", "\x00", "../..", "x" * 5000, "é" * 300, "\udcff", "[red]", "paper=", "KEY=VALUE"),
)
EPISODE = ("scenario", "planner", "filter", "scheme", "preset", "seed", "duration", "table", "settings", "out")
STUDY = ("scenarios", "stacks", "episodes", "seed", "preset", "vary", "settings", "workers", "scheduler", "keep", "out")
PATHS = ("load_scenario", "load_table", "solve_table", "read_run", "read_study")


class WorkBegins(Exception):
    """What was given has been taken: from here on it would be driven."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Return an empty folder to be in, where nothing is solved or driven."""

    def begin(*_, **__):
        raise WorkBegins

    study = importlib.import_module("hj_cosim.study.study")
    for module, name in ((run, "load_tables"), (study, "load_tables"), (study, "conduct")):
        monkeypatch.setattr(module, name, begin)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(function, **given):
    """Return the sentence with which a function refuses what it is given; empty where it begins to work."""
    try:
        function(**given)
    except HjCosimError as error:
        return str(error)
    except WorkBegins:
        return ""
    raise AssertionError(f"{given} was worked on to the end")


def require_sentence(said):
    assert 10 < len(said) < 700
    assert "\n" not in said


@pytest.mark.parametrize("name", PATHS)
def test_who_asks_for_a_file_by_anything_else_than_its_name_is_told_so(here, name):
    for strange in STRANGE:
        function = getattr(hj_cosim, name)
        require_sentence(refused(lambda place, function=function: function(place), place=strange))
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("name", EPISODE)
def test_an_episode_is_not_begun_with_what_it_does_not_know(here, name):
    # A callable `out` is a function that names the folder.
    stranger = [strange for strange in STRANGE if name != "out" or not callable(strange)]
    sentences = [refused(hj_cosim.run_episode, **{name: strange}) for strange in stranger]
    assert any(sentences)
    for said in filter(None, sentences):
        require_sentence(said)
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("name", STUDY)
def test_a_study_is_not_begun_with_what_it_does_not_know(here, name):
    folder = here / "study"
    for strange in STRANGE:
        given = {"out": folder, "stacks": "op-none", "episodes": 1, name: strange}
        said = refused(hj_cosim.run_study, **given)
        if said:
            require_sentence(said)
            assert not folder.exists(), f"{name} = {strange!r} was refused after the study's folder had been made"
        else:
            for path in sorted(here.rglob("*"), reverse=True):
                path.rmdir() if path.is_dir() else path.unlink()


@pytest.mark.parametrize("name", ["folder", "format", "out"])
def test_nothing_is_exported_of_what_is_no_run_to_what_is_no_file(here, name):
    for strange in STRANGE:
        require_sentence(refused(export_run, **{"folder": here / "run", name: strange}))
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("question", ["value", "gradient", "optimal_control", "target_values", "in_grid"])
def test_a_table_is_asked_about_states_of_its_own_shape_alone(small_table, question):
    draw = np.random.default_rng(4)
    ask = getattr(small_table, question)
    for _ in range(60):
        shape = tuple(draw.integers(0, 7, draw.integers(0, 4)))
        states = draw.uniform(-0.3, 0.3, shape)
        if shape == (5,) or (len(shape) == 2 and shape[1] == 5):
            assert len(ask(states)) == (shape[0] if len(shape) == 2 else 1)
            continue
        with pytest.raises(HjCosimError, match=r"\(N, 5\) is right, in the order \(p_x, p_y, theta, v_r, v_o\)"):
            ask(states)
    for strange in (None, "here", [[object()] * 5], {}, np.full((2, 5), 1j)):
        require_sentence(refused(lambda states: ask(states), states=strange))


def test_whoever_asks_by_the_tabulator_key_finds_what_there_is():
    assert [name for name in dir(hj_cosim) if not name.startswith("_")] == sorted(hj_cosim.__all__)
