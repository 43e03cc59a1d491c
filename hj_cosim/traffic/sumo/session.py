"""SUMO in this process, through libsumo: its start, its steps, its end, and what it says meanwhile."""

import contextlib
import io
import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

with contextlib.redirect_stdout(io.StringIO()) as _libsumo_says:
    # It prints a note about the version of pyarrow, which would spoil what --json prints.
    import libsumo

from hj_cosim.errors import SimulationError
from hj_cosim.files import temporary_folder

# libsumo is imported here only, and silently; the others of this room take it from here.
__all__ = ["SUMO_ERRORS", "SumoSession", "libsumo", "log"]

log = logging.getLogger(__name__)
if _libsumo_says.getvalue():
    log.info("libsumo: %s", " ".join(_libsumo_says.getvalue().split()))

SUMO_ERRORS = (libsumo.TraCIException, libsumo.FatalTraCIError)


@contextlib.contextmanager
def _stderr_into(path: Path) -> Iterator[None]:
    """Send what this process, C++ included, writes to stderr into a file."""
    with path.open("wb") as file:
        terminal = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)


class SumoSession:
    """One run of SUMO; a process has room for one at a time.

    Attributes:
        folder: a temporary one for what SUMO is started with; gone when the session is closed.
        warnings_file: where SUMO has to write its warnings and errors, so that they reach the log.
    """

    def __init__(self, retell: Callable[[Sequence[str]], Iterable[str]]) -> None:
        """Prepare to start.

        Args:
            retell: takes the lines of SUMO's warnings and gives those that are to be told, in their final words.

        Raises:
            SimulationError: if another one is open in this process.
        """
        if libsumo.isLoaded():
            raise SimulationError("a SUMO world is open in this process already; close it first")
        self._retell = retell
        self._at_the_end = contextlib.ExitStack()
        self.folder = self._at_the_end.enter_context(temporary_folder())
        self.warnings_file = self.folder / "sumo.log"
        self._moves_wait = False

    def start(self, command: Sequence[str], what: str, *, inserts: bool = True) -> None:
        """Start SUMO.

        Args:
            command: the words of SUMO's command line.
            what: it runs, for the message.
            inserts: whether the step of time 0 is made, in which vehicles are inserted and nobody moves.

        Raises:
            SimulationError: with the first thing that SUMO complains of.
        """
        complaints = self.folder / "errors.log"
        try:
            with _stderr_into(complaints):  # what SUMO finds wrong is told by our own error
                libsumo.start(list(command))
                if inserts:
                    libsumo.simulationStep()
        except SUMO_ERRORS as error:
            lines = complaints.read_text(encoding="utf-8", errors="replace").splitlines()
            reason = lines[0].removeprefix("Error: ") if lines else " ".join(str(error).split())
            raise SimulationError(f"SUMO cannot run {what}: {reason}") from error

    def expect_moves(self) -> None:
        """Be told that vehicles are about to be asked to be somewhere when the next step ends."""
        self._moves_wait = True

    def step(self) -> None:
        """Make a step, in which what was asked for is done."""
        libsumo.simulationStep()
        self._moves_wait = False

    def close(self) -> None:
        """End SUMO and pass its warnings on to the log; a second time does nothing.

        Raises:
            SimulationError: if SUMO fails at that.
        """
        with self._at_the_end:
            try:
                if libsumo.isLoaded():
                    if self._moves_wait:
                        # What moveToXY asked for outlives SUMO's end, and the next session of this process would fall
                        # over a vehicle that is gone (segmentation fault): so it is carried out first.
                        libsumo.simulationStep()
                    libsumo.close()
            except SUMO_ERRORS as error:
                raise SimulationError(f"SUMO failed at its end: {error}") from error
            if self.warnings_file.is_file():
                lines = self.warnings_file.read_text(encoding="utf-8", errors="replace").splitlines()
                for line in self._retell(lines):
                    log.warning("SUMO: %s", line)
