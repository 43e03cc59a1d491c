"""Killing the command line at a given moment, and seeing what it left behind; imported by tests and a benchmark.

The victims are forked from a process that has loaded everything (kills_ready), so that what is hit is the work itself.
"""

import contextlib
import json
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.context import ForkServerProcess
from pathlib import Path

import pandas as pd
import psutil
import pyarrow.parquet as pq
import pytest
from PIL import Image

from hj_cosim.cli.commands import main
from hj_cosim.files import UNFINISHED
from hj_cosim.reachability.table.store import read_table

A_FEW_CARS = "[traffic]\ncount = 6\ncount_behind = 2\n"
WATCHING = 0.0002  # s between two looks at a folder

_fork = multiprocessing.get_context("forkserver")


def _make_ready() -> None:
    """Start the process that victims are forked from; it finds its modules on PYTHONPATH alone before Python 3.13."""
    _fork.set_forkserver_preload(["kills_ready"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(path or "." for path in sys.path))
        forkserver.ensure_running()


@dataclass(frozen=True)
class Victim:
    """A call that writes to one place, in a folder of its own."""

    name: str
    folder: Path  # empty but for the place and what is unfinished
    place: Path
    arguments: tuple[str, ...]

    @property
    def temporary(self) -> Path:
        """Its folder for temporary files."""
        return self.folder.with_name(f"{self.folder.name}-tmp")


def a_run(folder: Path, specification: Path) -> Victim:
    """Return one episode of a few cars; its table is solved already."""
    scenario = _scenario(folder)
    options = ("--duration", "1", "--seed", "3", "--table", str(specification))
    return _victim("run", folder, folder / "run", ("run", str(scenario), *options))


def a_solve(folder: Path, specification: Path) -> Victim:
    """Return the solution of a small table."""
    return _victim("solve", folder, folder / "table.npz", ("table", "solve", str(specification)))


def a_study(folder: Path, specification: Path) -> Victim:
    """Return two short episodes of each of two stacks, driven by two workers."""
    scenario = _scenario(folder)
    knobs = ("--set", "simulation.duration=1", "--set", f"table={specification}")
    size = ("--stack", "op-none", "--stack", "hjop-spc-mi", "--episodes", "2", "--workers", "2")
    return _victim("study", folder, folder / "study", ("study", str(scenario), *knobs, *size))


def _scenario(folder: Path) -> Path:
    path = folder.with_name("few.toml")
    path.write_text(A_FEW_CARS)
    return path


def _victim(name: str, folder: Path, place: Path, arguments: tuple[str, ...]) -> Victim:
    victim = Victim(name, folder, place, (*arguments, "--out", str(place)))
    for path in (victim.folder, victim.temporary):
        path.mkdir(exist_ok=True)
    return victim


def _call(arguments: tuple[str, ...], temporary: Path) -> None:
    with (temporary.parent / "said.txt").open("ab") as said:
        os.dup2(said.fileno(), 1)
        os.dup2(said.fileno(), 2)
    os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
    sys.argv = ["hj-cosim", *arguments]
    main()


def start(victim: Victim, *more: str) -> ForkServerProcess:
    """Start a victim, with further arguments."""
    _make_ready()
    process = _fork.Process(target=_call, args=((*victim.arguments, *more), victim.temporary))
    process.start()
    return process


def finish(victim: Victim, *more: str) -> int | None:
    """Let a victim finish, and return its exit status."""
    process = start(victim, *more)
    process.join()
    return process.exitcode


def seconds_of(victim: Victim) -> float:
    """Return how long a victim takes when nobody kills it (s); what it writes is removed."""
    started = time.monotonic()
    assert finish(victim) == 0, _said(victim)
    seconds = time.monotonic() - started
    clear(victim)
    return seconds


def clear(victim: Victim) -> None:
    """Remove all that a victim has written."""
    for path in (victim.folder, victim.temporary):
        shutil.rmtree(path)
        path.mkdir()


def kill(victim: Victim, moment: float, *, while_writing: bool) -> bool:
    """Start a victim and kill it, and its workers with it; return whether it was still at work.

    Args:
        victim: what to start.
        moment: s after its start, or after something unfinished has been seen.
        while_writing: wait until something unfinished with a content lies beside its place.
    """
    process = start(victim)
    itself = psutil.Process(process.pid)
    while while_writing and process.is_alive() and not _has_begun_to_write(victim.folder):
        time.sleep(WATCHING)
    process.join(timeout=moment)
    workers = []
    with contextlib.suppress(psutil.NoSuchProcess):
        workers = itself.children(recursive=True)
    was_at_work = process.is_alive()
    process.kill()
    process.join()
    _, orphans = psutil.wait_procs(workers, timeout=60.0)
    assert not orphans
    return was_at_work


def _unfinished(folder: Path) -> list[Path]:
    return [path for path in folder.rglob(f".*{UNFINISHED}*") if UNFINISHED not in path.parent.as_posix()]


def _has_begun_to_write(folder: Path) -> bool:
    with contextlib.suppress(OSError):  # finished while it was being looked at
        return any(any(path.iterdir()) if path.is_dir() else path.stat().st_size for path in _unfinished(folder))
    return False


def left_behind(victim: Victim) -> list[Path]:
    """Return what is unfinished, beside the victim's place or in its folder for temporary files."""
    return [*_unfinished(victim.folder), *victim.temporary.iterdir()]


_READERS: dict[str, Callable[[Path], object]] = {
    ".npz": read_table,
    ".parquet": pq.read_table,
    ".csv": pd.read_csv,
    ".json": lambda path: json.loads(path.read_text()),
    ".toml": lambda path: tomllib.loads(path.read_text()),
    ".png": lambda path: Image.open(path).load(),
}


def read_all(victim: Victim) -> dict[str, bytes]:
    """Read every file that is in its place, each by its own reader, and return those that any machine writes alike."""
    content = {}
    for path in sorted(victim.folder.rglob("*")):
        if path.is_file() and UNFINISHED not in path.as_posix():
            _READERS[path.suffix](path)
            if path.name not in ("timing.json", "wall_times.csv") and path.suffix != ".npz":  # these hold wall times
                content[path.relative_to(victim.folder).as_posix()] = path.read_bytes()
    return content


def next_call(victim: Victim) -> str:
    """Call the victim once more, to its end, and return what came of it.

    A run that is whole is refused, as any folder in use; the other calls go on with what is there.
    """
    if victim.name == "run" and (victim.place / "summary.json").is_file():
        assert finish(victim) == 2
        assert "already holds a run" in _said(victim)
        return "was whole, apart from its pictures"
    resume = ("--resume",) if victim.name == "study" and (victim.place / "study.toml").is_file() else ()
    assert finish(victim, *resume) == 0, _said(victim)
    return "resumed" if resume else "done anew"


def _said(victim: Victim) -> str:
    return " ".join((victim.folder.parent / "said.txt").read_text().split()[-200:])
