"""What `--watch` does: a server while something is driven. Without it nothing of this is imported."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from hj_cosim.cli.console import say

if TYPE_CHECKING:
    from hj_cosim.watching.drive import LiveDrive
    from hj_cosim.watching.server import WatchServer
    from hj_cosim.watching.study import LiveStudy


@contextmanager
def watched_drive(title: str) -> "Iterator[LiveDrive | None]":
    """Serve a page about a drive for as long as the block lasts; None where that cannot be, and the drive goes on."""
    from hj_cosim.watching.drive import LiveDrive, drive_page

    with _served(drive_page(title)) as server:
        yield None if server is None else LiveDrive(server)


@contextmanager
def watched_study() -> "Iterator[LiveStudy | None]":
    """Serve a page about a study, likewise."""
    from hj_cosim.watching.study import LiveStudy, study_page

    with _served(study_page()) as server:
        yield None if server is None else LiveStudy(server)


@contextmanager
def _served(page: str) -> "Iterator[WatchServer | None]":
    from hj_cosim.watching.server import PATIENCE, WatchServer

    try:
        server = WatchServer(page)
    except OSError as error:
        say(f"nobody can watch, for no port of this machine can be listened on: {error}")
        yield None
        return
    with server:
        say(f"watch at {server.address}; it begins when the page is open, or in {PATIENCE:g} s")
        server.wait_for_page()
        yield server
