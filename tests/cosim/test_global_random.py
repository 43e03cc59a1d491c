"""Planners of one's own that draw random numbers, and that change the current folder."""

import os
import random
import warnings

import numpy as np
import pytest

from hj_cosim import run_episode
from hj_cosim.cosim.global_random import global_random_of
from hj_cosim.errors import PluginError
from hj_cosim.planning.contract import IDLE, Plan
from hj_cosim.scene.observation import Target


class Wandering:
    """Draws its speed from the global generators."""

    plan_period = 0.1

    def plan(self, observation, previous):
        return Plan(IDLE, Target(previous.lane, 20.0 + random.random() + np.random.random()))  # noqa: NPY002


class Moving:
    """Leaves the folder that it was started in."""

    def plan(self, observation, previous):
        os.chdir("/")
        return Plan(IDLE, previous)


class Awaited:
    async def plan(self, observation, previous):
        return Plan(IDLE, previous)


@pytest.fixture
def drive(small_specification):
    def driven(planner, **asked):
        given = {"duration": 0.3, "table": str(small_specification), "figures": False, **asked}
        return run_episode("light", planner=planner, filter="none", settings=["simulation.settle_time=0.1"], **given)

    return driven


def test_a_seed_is_a_drive_whatever_the_planner_drew_before(drive):
    found = []
    for seed in (3, 3, 4):
        found.append(drive(Wandering, seed=seed).record.robot.plan_speed)
        random.random()
        np.random.random()  # noqa: NPY002
    first, again, other = found
    np.testing.assert_array_equal(first, again)
    assert len(np.unique(first)) == 3
    assert (first != other).any()


def test_callers_find_their_generators_as_they_were():
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    expected = random.random(), np.random.random()  # noqa: NPY002
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    with global_random_of(2**40 + 5):
        random.random()
        np.random.random()  # noqa: NPY002
    assert (random.random(), np.random.random()) == expected  # noqa: NPY002


def test_a_run_is_written_where_it_was_asked_for_though_the_planner_went_elsewhere(drive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive(Moving, out="mine")
    assert (tmp_path / "mine" / "summary.json").is_file()


def test_a_method_that_would_have_to_be_awaited_is_refused_without_a_warning(drive):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(PluginError, match=r"Awaited.plan returned <coroutine object Awaited.plan"):
            drive(Awaited)
