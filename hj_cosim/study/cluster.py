"""The same episodes on a Dask cluster (optional extra `cluster`), from a laptop's two workers to a thousand.

Nothing but the package has to be on the workers: value tables and Python files of one's own (planners, filters, games)
travel to them and finished run folders back, so that no file system is shared; only scenarios with a network of the
user's own need it at the same place everywhere, and a planner named by its module needs that installed. Dask
drives an episode again elsewhere when its worker dies, and gives it up when it has taken several workers with it.
"""

import atexit
import hashlib
import tempfile
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import rmtree
from typing import Any

from hj_cosim.errors import HjCosimError, WorkerError
from hj_cosim.files import temporary_folder, whole_file
from hj_cosim.locations import read_code_from
from hj_cosim.recording.run_folder import whole_folder
from hj_cosim.study.jobs import EpisodeFunction, EpisodeJob, Outcome

RunFiles = Mapping[str, bytes | None]  # the content of a run folder by path; None for a folder in it
Code = Mapping[Path, bytes]  # Python files of a user's own, by their places where the study is
TableContent = tuple[str, bytes]  # a solved table's file and its digest

_ONE_SUMO = threading.Lock()  # a process holds one SUMO; a worker started with several threads takes turns


class DaskCluster:
    """An engine of the workers of a Dask cluster, which are best started with one thread each."""

    def __init__(
        self, scheduler: str, timeout: float = 10.0, started: Callable[[EpisodeJob], None] | None = None
    ) -> None:
        """Take what is needed to connect.

        Args:
            scheduler: its address, for example tcp://10.0.0.1:8786.
            timeout: s, for the scheduler to answer and for the first worker to be there.
            started: told when a worker begins with a job, if given; from a thread of its own.
        """
        self.scheduler = scheduler
        self.timeout = timeout
        self._started = started

    def run(self, jobs: Sequence[EpisodeJob], function: EpisodeFunction) -> Generator[Outcome, None, None]:
        """Carry out the jobs (study.jobs.Engine)."""
        if not jobs:
            return
        with _connected(self.scheduler, self.timeout) as client:
            # Tables are tasks, not scattered data: when the workers that hold one die, Dask makes it again.
            places = {kept.path for job in jobs for kept in (job.table, *job.larger)}
            tables = {path: client.submit(_content, path.read_bytes(), pure=False) for path in places}
            code = _code_of(jobs)
            open_jobs = {str(job.folder): job for job in jobs}
            topic = None if self._started is None else f"hj-cosim-{client.id}"
            if topic is not None:
                client.subscribe_topic(topic, lambda event: self._begin(open_jobs.get(event[1])))
            waiting = {
                client.submit(
                    _drive_remotely,
                    job,
                    [tables[kept.path] for kept in (job.table, *job.larger)],
                    code,
                    function,
                    topic,
                    pure=False,
                    priority=-number,
                ): job
                for number, job in enumerate(jobs)
            }
            for episode in _distributed().as_completed(list(waiting), loop=client.loop):
                job = waiting.pop(episode)
                del open_jobs[str(job.folder)]
                yield _outcome(job, episode, self.scheduler)
                episode.release()

    def _begin(self, job: EpisodeJob | None) -> None:
        """Pass on that a job has begun; what is said of one that has ended came late."""
        if job is not None and self._started is not None:
            self._started(job)


def _distributed() -> Any:
    try:
        import distributed
    except ModuleNotFoundError as error:
        raise WorkerError("--scheduler needs Dask; install it with `pip install 'hj-cosim[cluster]'`") from error
    return distributed


@contextmanager
def _connected(scheduler: str, timeout: float) -> Iterator[Any]:
    """Yield a client of the scheduler, when it has a worker.

    Raises:
        WorkerError: if it does not answer or has no workers.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(scheduler, timeout=timeout, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise WorkerError(
            f"no Dask scheduler answers at {scheduler} ({error}); start one with `dask scheduler`"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=timeout)
        except TimeoutError as error:
            raise WorkerError(
                f"the Dask scheduler at {scheduler} has no workers; start some with"
                f" `dask worker {scheduler} --nworkers 2 --nthreads 1`"
            ) from error
        yield client


def _outcome(job: EpisodeJob, episode: Any, scheduler: str) -> Outcome:
    """Put the run folder in place that came back, or say why none did.

    Raises:
        WorkerError: if the scheduler is gone.
    """
    if episode.status == "finished":
        reply = episode.result()
        if isinstance(reply, str):
            return Outcome(job, reply)
        _unpack(reply, job.folder)
        return Outcome(job)
    if episode.status == "error":
        error = episode.exception()
        said = "".join(traceback.format_exception(type(error), error, episode.traceback()))
        return Outcome(job, f"a worker of the cluster failed: {type(error).__name__}: {error}", said)
    raise WorkerError(f"the Dask scheduler at {scheduler} was lost; --resume goes on with what is left")


def _content(content: bytes) -> TableContent:
    return hashlib.sha256(content).hexdigest(), content


def _code_of(jobs: Sequence[EpisodeJob]) -> Code:
    """Return the Python files that the jobs name: those of planners, filters and games of a user's own.

    Raises:
        WorkerError: if one cannot be read any more.
    """
    named = {
        name
        for job in jobs
        for name in (
            job.config.planner.kind.rpartition(":")[0],
            job.config.filter.kind.rpartition(":")[0],
            job.table.specification.dynamics,
        )
        if name.endswith(".py")
    }
    try:
        return {Path(name): Path(name).read_bytes() for name in sorted(named)}
    except OSError as error:
        raise WorkerError(f"cannot read {error.filename}, which is to be sent along: {error.strerror}") from error


def _drive_remotely(
    job: EpisodeJob, tables: Sequence[TableContent], code: Code, function: EpisodeFunction, topic: str | None = None
) -> RunFiles | str:
    """Drive an episode on a worker, and return its run folder's files, or one sentence on why it could not be.

    That it begins is told to whoever listens to a topic of the scheduler's, if one is given.
    """
    copies: Mapping[Path, Path] = {}
    try:
        with _ONE_SUMO, temporary_folder() as temporary:
            if topic is not None:
                _distributed().get_worker().log_event(topic, str(job.folder))
            folder = temporary / job.folder.name
            copies = _copies_of(code)
            read_code_from(copies)
            table, *larger = (
                replace(kept, path=_table_file(content))
                for kept, content in zip((job.table, *job.larger), tables, strict=True)
            )
            function(replace(job, table=table, larger=tuple(larger), folder=folder))
            return _pack(folder)
    except HjCosimError as error:
        sentence = str(error)
        for place, copy in copies.items():
            sentence = sentence.replace(str(copy), str(place))
        return sentence


def _copies_of(code: Code) -> Mapping[Path, Path]:
    """Return where Python files are that are not here, or not the same; they are written once a process."""
    copies: dict[Path, Path] = {}
    for place, content in code.items():
        if place.is_file() and place.read_bytes() == content:
            continue
        copy = _folder_for_code() / hashlib.sha256(content).hexdigest() / place.name
        if not copy.is_file():
            with whole_file(copy) as temporary:
                temporary.write_bytes(content)
        copies[place] = copy
    return copies


@cache
def _folder_for_code() -> Path:
    """Return a folder of this process's own, in which nobody else can put code."""
    folder = tempfile.mkdtemp(prefix="hj-cosim-")
    atexit.register(rmtree, folder, ignore_errors=True)
    return Path(folder)


def _table_file(table: TableContent) -> Path:
    """Return a file with the table's content; the workers of a machine share it."""
    digest, content = table
    path = Path(tempfile.gettempdir()) / f"hj-cosim-{digest}.npz"
    if not path.is_file():
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    return path


def _pack(folder: Path) -> RunFiles:
    paths = sorted(folder.rglob("*"))
    return {path.relative_to(folder).as_posix(): None if path.is_dir() else path.read_bytes() for path in paths}


def _unpack(files: RunFiles, folder: Path) -> None:
    with whole_folder(folder) as temporary:
        for name, content in files.items():
            if content is None:
                (temporary / name).mkdir()
            else:
                (temporary / name).write_bytes(content)
