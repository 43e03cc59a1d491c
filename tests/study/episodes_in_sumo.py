"""An episode function that drives in SUMO itself, importable by worker processes, and what may go wrong in it."""

import itertools
import os
import signal
from unittest.mock import patch

import libsumo

from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import EpisodeJob

SEED_OF_AN_ERROR, SEED_OF_A_CRASH = 1, 2
STEPS_BEFORE = 32  # that go well: 31 are for settling


def drive_while_sumo_breaks(job: EpisodeJob) -> None:
    """Drive an episode; in the unlucky ones, soon after the robot has taken over, SUMO can neither step nor end."""
    steps, step, close = itertools.count(), libsumo.simulationStep, libsumo.close

    def break_down() -> None:
        os.write(2, b"SUMO said something last\n")
        if job.config.seed == SEED_OF_A_CRASH:
            os.kill(os.getpid(), signal.SIGSEGV)
        raise libsumo.FatalTraCIError("nothing goes any more")

    is_unlucky = job.config.seed in (SEED_OF_AN_ERROR, SEED_OF_A_CRASH)

    def faulty_step() -> None:
        if is_unlucky and next(steps) > STEPS_BEFORE:
            break_down()
        step()

    def faulty_close() -> None:
        if is_unlucky:
            break_down()
        close()

    with patch.object(libsumo, "simulationStep", faulty_step), patch.object(libsumo, "close", faulty_close):
        drive_episode(job)
