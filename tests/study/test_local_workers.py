import os
import sys
import time
from contextlib import closing

import pytest

from hj_cosim.errors import WorkerError
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.results import is_complete


@pytest.fixture
def jobs(study_folder, tmp_path):
    folder = study_folder("study")
    return folder.remaining_jobs(dict.fromkeys(folder.tables, (tmp_path / "table.npz",)))


def test_every_job_is_done_once(jobs, synthetic):
    outcomes = list(LocalWorkers(2).run(jobs, synthetic.drive))
    assert sorted(outcome.job.folder for outcome in outcomes) == sorted(job.folder for job in jobs)
    assert all(outcome.error is None and is_complete(outcome.job.folder) for outcome in outcomes)


def test_what_an_episode_prints_does_not_disturb_the_study(jobs, synthetic):
    outcomes = list(LocalWorkers(1).run(jobs[:3], synthetic.drive_while_printing))
    assert [outcome.error for outcome in outcomes] == [None] * 3


@pytest.mark.parametrize(
    ("way", "reason", "log"),
    [
        ("drive_or_be_killed", "the worker process was killed by SIGKILL", "SUMO said something last"),
        ("drive_or_fail", "the traffic could not be settled", ""),
        ("drive_or_be_wrong", "the worker process ended with exit status 1", "ZeroDivisionError: a programming error"),
    ],
)
def test_an_episode_that_fails_is_reported_with_its_log_and_the_others_go_on(jobs, synthetic, way, reason, log):
    outcomes = list(LocalWorkers(1).run(jobs, getattr(synthetic, way)))
    assert len(outcomes) == len(jobs)
    (failed,) = (outcome for outcome in outcomes if outcome.error is not None)
    assert (failed.job.config.seed, failed.job.config.planner.kind) == (synthetic.UNLUCKY_SEED, "op")
    assert failed.error == reason
    assert log in failed.log
    assert sum(is_complete(job.folder) for job in jobs) == len(jobs) - 1


def test_closing_the_iterator_ends_the_workers_at_once(jobs, synthetic):
    started = time.monotonic()
    with closing(LocalWorkers(2).run(jobs, synthetic.drive_slowly)) as outcomes:
        next(outcomes)
    assert time.monotonic() - started < 60.0
    assert not all(is_complete(job.folder) for job in jobs)


def test_workers_that_cannot_start_say_why(jobs, synthetic, monkeypatch):
    monkeypatch.setattr(synthetic.drive, "__module__", "a_module_that_workers_do_not_have")
    monkeypatch.setitem(sys.modules, "a_module_that_workers_do_not_have", synthetic)
    with pytest.raises(WorkerError, match=r"could not start; it said: [\s\S]*a_module_that_workers_do_not_have"):
        list(LocalWorkers(1).run(jobs, synthetic.drive))


def test_no_jobs_need_no_workers(synthetic):
    assert list(LocalWorkers(2).run([], synthetic.drive)) == []


def test_there_are_as_many_workers_as_cores_unless_told_otherwise():
    assert LocalWorkers().count == len(os.sched_getaffinity(0))
    assert LocalWorkers(3).count == 3
    with pytest.raises(WorkerError, match="workers = 0"):
        LocalWorkers(0)
