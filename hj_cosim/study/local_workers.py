"""Worker processes on this machine, one SUMO each; one that dies is replaced, and its episode reported."""

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from hj_cosim.errors import WorkerError
from hj_cosim.files import temporary_folder
from hj_cosim.study.jobs import EpisodeFunction, EpisodeJob, NotDone, Outcome
from hj_cosim.study.worker import READY

LOG_LENGTH = 20_000  # characters of a failed episode's log that are kept, from its end

# One core a worker: libraries that start threads of their own would only take the other workers' cores.
_SINGLE_THREADED = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class LocalWorkers:
    """An engine of `count` processes on this machine, as many as there are cores unless told otherwise."""

    def __init__(self, count: int | None = None, started: Callable[[EpisodeJob], None] | None = None) -> None:
        """Say how many; none is started yet.

        Args:
            count: processes.
            started: called, from the threads that keep them, with every job that one is handed.
        """
        if count is not None and count < 1:
            raise WorkerError(f"workers = {count}: a study needs one worker or more")
        self.count = count or available_cores()
        self._started = started or (lambda job: None)

    def run(self, jobs: Sequence[EpisodeJob], function: EpisodeFunction) -> Generator[Outcome, None, None]:
        """Carry out the jobs (study.jobs.Engine).

        Every process has a thread here that hands it one job at a time, so none waits while there is work.
        """
        waiting: Queue[EpisodeJob] = Queue()
        for job in jobs:
            waiting.put(job)
        done: Queue[Outcome | BaseException] = Queue()
        setup = pickle.dumps(function)
        with temporary_folder() as logs:
            keepers = [_WorkerKeeper(logs / f"{number}.log", setup) for number in range(min(self.count, len(jobs)))]
            threads = [threading.Thread(target=keeper.serve, args=(waiting, done, self._started)) for keeper in keepers]
            try:
                for thread in threads:
                    _start(thread)
                for _ in jobs:
                    result = done.get()
                    if isinstance(result, BaseException):
                        raise result
                    yield result
            finally:
                for keeper in keepers:
                    keeper.leave()
                for thread in threads:
                    if thread.ident is not None:  # one that could not be started cannot be waited for
                        thread.join()


def _start(thread: threading.Thread) -> None:
    try:
        thread.start()
    except RuntimeError as error:  # the system has no more of them
        raise WorkerError(_not_started("a thread that keeps a worker process", error)) from error


def _not_started(what: str, error: Exception) -> str:
    return f"{what} could not be started: {error}; --resume goes on with what is left, --workers with fewer of them"


class _WorkerKeeper:
    """Keeps a worker process at work: hands it one job after another, from a thread, and replaces it if it dies."""

    def __init__(self, log: Path, setup: bytes) -> None:
        self._log = log
        self._setup = setup
        self._lock = threading.Lock()  # between starting a process and leaving
        self._left = False
        self._worker: _WorkerProcess | None = None

    def serve(
        self,
        waiting: "Queue[EpisodeJob]",
        done: "Queue[Outcome | BaseException]",
        started: Callable[[EpisodeJob], None],
    ) -> None:
        """Have jobs carried out until there are none, or `leave` is called; what is raised here is put in `done`."""
        try:
            while (worker := self._present_worker()) is not None:
                try:
                    job = waiting.get_nowait()
                except Empty:
                    break
                started(job)
                done.put(worker.carry_out(job))
        except BaseException as error:  # noqa: BLE001 - raised again by `run`, which would wait for ever without it
            done.put(error)
        finally:
            self.leave()
            if self._worker is not None:
                self._worker.dispose()

    def leave(self) -> None:
        """End the process, whatever it is doing, and start no other; any thread may call this."""
        with self._lock:
            self._left = True
            if self._worker is not None:
                self._worker.kill()

    def _present_worker(self) -> "_WorkerProcess | None":
        """Return the process, a new one in place of one that died; None after `leave`.

        Raises:
            WorkerError: if a new process cannot be started, or does not get as far as being ready.
        """
        with self._lock:
            if self._left:
                return None
            if self._worker is None or self._worker.is_dead():
                if self._worker is not None:
                    self._worker.dispose()
                    self._worker = None
                try:
                    self._worker = _WorkerProcess(self._log)
                except OSError as error:
                    raise WorkerError(_not_started("a worker process", error)) from error
        if self._worker.set_up(self._setup) or self._left:
            return self._worker
        raise WorkerError(f"a worker process could not start; it said: {self._worker.log_text().strip() or 'nothing'}")


class _WorkerProcess:
    """A process that runs `study.worker`."""

    def __init__(self, log: Path) -> None:
        """Start it.

        Args:
            log: the file that what it prints is appended to.

        Raises:
            OSError: if the system has no room for the file or the process.
        """
        self._log_path = log
        self._is_set_up = False
        with ExitStack() as on_failure:
            self._log = on_failure.enter_context(log.open("ab"))
            self._process = subprocess.Popen(
                [sys.executable, "-m", "hj_cosim.study.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                # The worker finds what this process finds: the function that drives an episode may be a user's own.
                env={**os.environ, **_SINGLE_THREADED, "PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)},
                start_new_session=True,  # Ctrl-C reaches the study alone, which then ends its workers
            )
            on_failure.pop_all()

    def set_up(self, setup: bytes) -> bool:
        """Return whether the process is ready for jobs; the first time, hand it the function."""
        if not self._is_set_up:
            self._is_set_up = self._ask(setup) == READY
        return self._is_set_up

    def carry_out(self, job: EpisodeJob) -> Outcome:
        """Have one job done; a process that dies over it is a failed job, and SUMO's failure ends the process."""
        self._log.truncate(0)
        reply = self._ask(pickle.dumps(job))
        if reply is _NOTHING:
            return Outcome(job, f"the worker process {self._how_it_ended()}", self.log_text())
        if isinstance(reply, NotDone):
            if reply.process_is_spoilt:
                self._process.kill()
                self._process.wait()
            return Outcome(job, reply.reason, self.log_text())
        return Outcome(job)

    def is_dead(self) -> bool:
        """Return whether the process has ended."""
        return self._process.poll() is not None

    def log_text(self) -> str:
        """Return the end of what the process printed since its last job began."""
        return self._log_path.read_text(encoding="utf-8", errors="replace")[-LOG_LENGTH:]

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()

    def dispose(self) -> None:
        """End the process and let go of everything."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._log):
            assert stream is not None
            with suppress(BrokenPipeError):  # what was not yet sent to a dead process
                stream.close()

    def _ask(self, request: bytes) -> Any:
        """Return the process's reply, or `_NOTHING` when it died over it."""
        requests, replies = self._process.stdin, self._process.stdout
        assert requests is not None
        assert replies is not None
        try:
            requests.write(pickle.dumps(request))  # framed: see study.worker
            requests.flush()
            return pickle.load(replies)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            return _NOTHING

    def _how_it_ended(self) -> str:
        status = self._process.wait()
        return f"was killed by {_signal_name(-status)}" if status < 0 else f"ended with exit status {status}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # most real-time signals have none
        return f"signal {number}"


_NOTHING = object()  # the reply of a dead process
