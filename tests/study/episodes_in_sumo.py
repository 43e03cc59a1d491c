"""Episode functions that drive in SUMO itself, importable by worker processes, and what may go wrong in it."""

import itertools
import os
import signal
from collections.abc import Callable
from unittest.mock import patch

import libsumo

from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import EpisodeJob

UNLUCKY_SEED = 1
STEPS_BEFORE = 160  # that go well: 151 are for settling


def _drive(job: EpisodeJob, fail: Callable[[], None]) -> None:
    """Drive an episode; in the unlucky one, soon after the robot has taken over, SUMO can neither step nor end."""
    steps, step, close = itertools.count(), libsumo.simulationStep, libsumo.close

    def faulty_step() -> None:
        if next(steps) > STEPS_BEFORE and job.config.seed == UNLUCKY_SEED:
            fail()
        step()

    def faulty_close() -> None:
        if job.config.seed == UNLUCKY_SEED:
            fail()
        close()

    with patch.object(libsumo, "simulationStep", faulty_step), patch.object(libsumo, "close", faulty_close):
        drive_episode(job)


def drive_while_sumo_fails(job: EpisodeJob) -> None:
    def fail() -> None:
        os.write(2, b"SUMO said something last\n")
        raise libsumo.FatalTraCIError("nothing goes any more")

    _drive(job, fail)


def drive_while_sumo_crashes(job: EpisodeJob) -> None:
    def crash() -> None:
        os.write(2, b"SUMO said something last\n")
        os.kill(os.getpid(), signal.SIGSEGV)

    _drive(job, crash)
