"""Compiling while a table is solved: the second process drives what the first one will, leaves nothing, and ends."""

import subprocess
import sys
import time
from contextlib import nullcontext

import psutil
import pytest

from hj_cosim import rehearsal, run
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.rehearsal import can_be_rehearsed, flat_table, rehearse, rehearsed
from hj_cosim.run import run_episode


@pytest.fixture
def config(small_specification, small_table):
    return resolve_config("paper", assignments=[f"table={small_specification}"])


def test_the_rehearsal_plans_twice_and_the_filter_acts(config, monkeypatch):
    driven = []
    whole = rehearsal.run_in_sumo
    monkeypatch.setattr(rehearsal, "run_in_sumo", lambda *given: driven.append(whole(*given)))
    rehearse(config)
    (episode,) = driven
    assert episode.record.robot.intervening.any()
    assert (episode.config.planner, episode.config.filter) == (config.planner, config.filter)
    assert episode.record.time[-1] >= config.planner.action_time


def test_a_flat_table_is_of_the_same_game_and_robot_and_says_nothing(small_table):
    flat = flat_table(small_table.specification)
    assert (flat.game, flat.parameters) == (small_table.game, small_table.parameters)
    assert not flat.values.any()


@pytest.mark.parametrize(("part", "kind"), [("planner", "mine.py:Planner"), ("filter", "package.module:Filter")])
def test_what_is_not_ours_is_not_rehearsed(config, part, kind):
    assert can_be_rehearsed(config)
    other = getattr(config, part).model_copy(update={"kind": kind})
    assert not can_be_rehearsed(config.model_copy(update={part: other}))


def test_it_is_waited_for_and_ends_with_a_block_that_fails(config, monkeypatch):
    started = []
    whole = subprocess.Popen

    def noted(command, **options):
        # In its place one that only says by its end that it was waited for, or never ends.
        process = whole([sys.executable, "-c", f"import time; time.sleep({seconds})"], **options)
        started.append(process)
        return process

    monkeypatch.setattr(subprocess, "Popen", noted)
    seconds = 0.5
    with rehearsed(config):
        pass
    assert started[-1].returncode == 0
    seconds = 1000
    with pytest.raises(ZeroDivisionError), rehearsed(config):
        raise ZeroDivisionError
    assert started[-1].returncode < 0
    assert not psutil.pid_exists(started[-1].pid)


def test_it_ends_with_who_started_it(config):
    process = subprocess.Popen([sys.executable, "-m", "hj_cosim.rehearsal"], stdin=subprocess.PIPE)
    process.stdin.write(config.model_dump_json().encode() + b"\n")
    process.stdin.flush()
    time.sleep(0.1)
    process.stdin.close()
    assert process.wait(timeout=60) in (0, 1)


@pytest.mark.parametrize(("is_solved", "times"), [(True, 0), (False, 1)])
def test_only_a_drive_that_has_to_wait_for_its_table_is_rehearsed(config, monkeypatch, is_solved, times):
    asked = []
    monkeypatch.setattr(run, "rehearsed", lambda given: asked.append(given) or nullcontext())
    if not is_solved:
        monkeypatch.setattr("hj_cosim.reachability.table.store.KeptTable.is_solved", False)
        monkeypatch.setattr(run, "load_tables", lambda *_, **__: (_ for _ in ()).throw(ZeroDivisionError))
        with pytest.raises(ZeroDivisionError):
            run_episode(settings=(f"table={config.table}",), duration=0.1)
    else:
        run_episode(settings=(f"table={config.table}",), duration=0.1)
    assert len(asked) == times
