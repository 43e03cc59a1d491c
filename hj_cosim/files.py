"""Files and folders that appear whole or not at all, and of which a killed process leaves nothing for ever.

What is being written has a temporary name beside its place, and is locked by the process that writes it. The system
drops the lock when that process ends, however it ends; so the next one to write there can tell what nobody will
finish any more, and removes it.
"""

import os
import re
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from shutil import copyfileobj, rmtree
from typing import IO

from hj_cosim.errors import HjCosimError

try:
    import fcntl
except ModuleNotFoundError:  # Windows has no such locks: there, what a killed process leaves is left to the user
    fcntl = None  # type: ignore[assignment]

UNFINISHED = ".hj-cosim-unfinished-"  # in the name of everything that is being written

LONGEST_NAME = 200  # bytes; a file system takes 255, and a stack, a seed and a temporary name's letters are added


def file_name(text: str) -> str:
    """Return a text, whoever wrote it, as a part of a file's name: no separator, no dot in front, not too long."""
    allowed = re.sub(r"[^\w.,=+-]", "_", text).lstrip(".").encode()
    return allowed[:LONGEST_NAME].decode(errors="ignore") or "_"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it takes `path`'s place when the block ends without an error.

    Args:
        path: where the file is to appear; missing folders are made.

    Yields:
        The temporary path to write to, with `path`'s suffix.

    Raises:
        HjCosimError: if the folder cannot be written or the disk is full.
    """
    with naming_the_place(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with _claimed(lambda: _new_file(path), path.parent) as temporary:
            yield temporary
            make_readable(temporary)
            temporary.replace(path)


@contextmanager
def temporary_folder(above: Path | None = None, name: str = "") -> Iterator[Path]:
    """Yield a new folder, which is gone when the block ends, unless it was moved elsewhere.

    Args:
        above: where it is made, the system's folder for temporary files unless given.
        name: what its name begins with, after a dot.

    Raises:
        HjCosimError: if it cannot be made.
    """
    with naming_the_place(above or Path("a temporary file")), ExitStack() as stack:
        parent = above or Path(tempfile.gettempdir())
        make = partial(tempfile.mkdtemp, prefix=f".{name}{UNFINISHED}", dir=parent)
        folder = stack.enter_context(_claimed(lambda: Path(make()), parent))
        at_the_end = stack.pop_all()
    with at_the_end:
        yield folder


class UnfinishedFile:
    """A file that is written for as long as it takes, beside its place; gone with this object unless it is moved there.

    Attributes:
        stream: of it, open for reading and writing, wherever the file is moved to.
    """

    def __init__(self, beside: Path) -> None:
        """Make it.

        Args:
            beside: the place near which it is made; missing folders are made.

        Raises:
            HjCosimError: if it cannot be made there.
        """
        with naming_the_place(beside):
            beside.parent.mkdir(parents=True, exist_ok=True)
            remove_abandoned(beside.parent)
            self._path, lock = _make_and_lock(lambda: _new_file(beside))
            self.stream: IO[bytes] = self._path.open("w+b")
        weakref.finalize(self, _let_go, self._path, lock, self.stream)

    def move_to(self, place: Path) -> None:
        """Put what was written into a place, or a copy of it where it has been put into one before.

        Raises:
            OSError: if that is not possible.
        """
        self.stream.flush()
        try:
            self._path.replace(place)
        except OSError:  # it lies on another disk, or elsewhere already
            self.stream.seek(0)
            with place.open("wb") as copy:
                copyfileobj(self.stream, copy)
        make_readable(place)


def make_readable(path: Path) -> None:
    """Make a temporary file, which is private, as readable as any other file of the user."""
    umask = os.umask(0)
    os.umask(umask)
    path.chmod(0o666 & ~umask)


def _let_go(path: Path, lock: int, stream: IO[bytes]) -> None:
    with suppress(OSError):  # of a full disk, what is left to write
        stream.close()
    _remove(path)
    os.close(lock)


def require_writable(path: Path) -> None:
    """Check, before the work, that a file or a folder can be written at `path`; nothing is left there.

    Raises:
        HjCosimError: if it cannot.
    """
    above = next(parent for parent in path.absolute().parents if parent.exists())
    # Only making something there tells: permissions say nothing of read-only disks, nor do they bind everyone.
    with naming_the_place(path), _claimed(lambda: _new_file(above / "probe"), above):
        pass


@contextmanager
def naming_the_place(place: Path, kind: type[HjCosimError] = HjCosimError) -> Iterator[None]:
    """Turn what the system refuses within the block into one sentence about `place`.

    Raises:
        HjCosimError: of the given kind, if anything raised an OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise kind(f"cannot write {place}: {reason}; choose another place or free it") from error


def remove_abandoned(folder: Path) -> None:
    """Remove everything unfinished in `folder` that no living process holds; not what lies in folders within."""
    for path in list(folder.glob(f".*{UNFINISHED}*")):
        with suppress(OSError):  # gone meanwhile, or another user's: nothing of ours to remove
            lock = os.open(path, os.O_RDONLY)
            try:
                if _lock(lock, wait=False):
                    _remove(path)
            finally:
                os.close(lock)


def _new_file(path: Path) -> Path:
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}{UNFINISHED}", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    return Path(name)


@contextmanager
def _claimed(make: Callable[[], Path], folder: Path) -> Iterator[Path]:
    """Yield what `make` makes in `folder`, locked, and remove it at the end if it is still there.

    What ended processes left unfinished in `folder` is removed first.

    Raises:
        OSError: if nothing can be made there.
    """
    remove_abandoned(folder)
    path, lock = _make_and_lock(make)
    try:
        yield path
    finally:
        _remove(path)
        os.close(lock)


def _make_and_lock(make: Callable[[], Path]) -> tuple[Path, int]:
    """Return a new path and the descriptor that locks it; again, if another process took it for abandoned before."""
    while True:
        path = make()
        with suppress(FileNotFoundError):
            lock = os.open(path, os.O_RDONLY)
            _lock(lock, wait=True)
            if path.exists():
                return path, lock
            os.close(lock)


def _lock(handle: int, *, wait: bool) -> bool:
    """Lock an open file or folder for this process; return whether that was possible.

    It is not where another process holds it (unless one waits for that), nor on file systems that know no locks; what
    is there is never taken for abandoned.
    """
    if fcntl is None:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


def _remove(path: Path) -> None:
    if path.is_dir():
        rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
