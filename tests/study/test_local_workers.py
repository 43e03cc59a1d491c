import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from errno import EAGAIN, EMFILE
from pathlib import Path
from queue import Empty

import pytest

from hj_cosim.errors import WorkerError
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.results import is_complete

HANGS_AFTER = 60.0  # s: what comes back at all comes back much sooner


def _outcomes(engine, jobs, function):
    """Return the outcomes of an engine; one that hangs is a failed test, and not a test that hangs.

    Raises:
        BaseException: what the engine raises.
    """
    outcomes, raised = [], []

    def run():
        try:
            outcomes.extend(engine.run(jobs, function))
        except BaseException as error:  # noqa: BLE001 - raised again below
            raised.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(HANGS_AFTER)
    assert not thread.is_alive(), "the study hangs"
    if raised:
        raise raised[0]
    return outcomes


@pytest.fixture
def workers(monkeypatch):
    """The worker processes that were started."""
    begun = []
    start = subprocess.Popen

    def watched(*args, **options):
        begun.append(start(*args, **options))
        return begun[-1]

    monkeypatch.setattr("hj_cosim.study.local_workers.subprocess.Popen", watched)
    yield begun
    for process in begun:
        process.kill()


@pytest.fixture
def jobs(study_folder, tmp_path):
    folder = study_folder("study")
    folder.begin({"hj-cosim": "1.0"}, resume=False)
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


def test_a_worker_that_cannot_be_started_ends_the_study_in_a_sentence(jobs, synthetic, monkeypatch):
    def refuse(*args, **options):
        raise OSError(EAGAIN, os.strerror(EAGAIN))

    monkeypatch.setattr("hj_cosim.study.local_workers.subprocess.Popen", refuse)
    sentence = r"^a worker process could not be started: .*Resource temporarily unavailable; --resume goes on with"
    with pytest.raises(WorkerError, match=sentence):
        _outcomes(LocalWorkers(2), jobs, synthetic.drive)


def test_a_log_that_cannot_be_opened_ends_the_study_in_a_sentence(jobs, synthetic, monkeypatch):
    opened = Path.open

    def refuse(self, mode="r", **options):
        if self.suffix == ".log":
            raise OSError(EMFILE, os.strerror(EMFILE), str(self))
        return opened(self, mode, **options)

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(WorkerError, match=r"a worker process could not be started: .*Too many open files"):
        _outcomes(LocalWorkers(1), jobs, synthetic.drive)


def test_a_worker_that_cannot_be_replaced_ends_the_study_in_a_sentence(jobs, synthetic, monkeypatch):
    start, begun = subprocess.Popen, []

    def start_one(*args, **options):
        if begun:
            raise OSError(EAGAIN, os.strerror(EAGAIN))
        begun.append(start(*args, **options))
        return begun[0]

    def end_it(job):
        begun[0].kill()
        begun[0].wait()

    monkeypatch.setattr("hj_cosim.study.local_workers.subprocess.Popen", start_one)
    with pytest.raises(WorkerError, match="a worker process could not be started: "):
        _outcomes(LocalWorkers(1, end_it), jobs, synthetic.drive)


def test_a_thread_that_cannot_be_started_ends_the_study_in_a_sentence(jobs, synthetic, monkeypatch):
    class NoThread(threading.Thread):
        def start(self):
            raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr("hj_cosim.study.local_workers.threading.Thread", NoThread)
        with pytest.raises(WorkerError, match="a thread that keeps a worker process could not be started: can't start"):
            next(LocalWorkers(2).run(jobs, synthetic.drive))


@pytest.mark.parametrize("error", [ZeroDivisionError("a programming error"), Empty(), SystemExit(3)], ids=repr)
def test_what_an_onlooker_raises_is_raised_by_the_study_and_its_workers_end(jobs, synthetic, workers, error):
    def fail(job):
        raise error

    with pytest.raises(type(error)) as raised:
        _outcomes(LocalWorkers(2, fail), jobs, synthetic.drive)
    assert raised.value is error
    assert all(process.returncode is not None for process in workers)


def test_a_worker_killed_by_a_signal_without_a_name_is_reported_with_its_number(jobs, synthetic, workers):
    nameless = min(number for number in signal.valid_signals() if not isinstance(number, signal.Signals))

    def kill(job):
        workers[0].send_signal(nameless)
        workers[0].wait()

    (outcome,) = _outcomes(LocalWorkers(1, kill), jobs[:1], synthetic.drive)
    assert outcome.error == f"the worker process was killed by signal {int(nameless)}"


def test_no_jobs_need_no_workers(synthetic):
    assert list(LocalWorkers(2).run([], synthetic.drive)) == []


def test_there_are_as_many_workers_as_cores_unless_told_otherwise():
    assert LocalWorkers().count == len(os.sched_getaffinity(0))
    assert LocalWorkers(3).count == 3
    with pytest.raises(WorkerError, match="workers = 0"):
        LocalWorkers(0)
