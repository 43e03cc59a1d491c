"""Where the program begins and ends: Ctrl-C is answered in one line from its first instant to its last.

What takes long to import is imported under the guard. An interruption can be lost on its way (libraries catch what is
raised in the middle of their import or of a callback), so that it is remembered as well as raised.
"""

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

from hj_cosim.cli.interruption import INTERRUPTED, MESSAGE


class _Interruptions:
    """Whether Ctrl-C was pressed; its handler while a command runs."""

    def __init__(self) -> None:
        self.pressed = False

    def __call__(self, number: int, frame: FrameType | None) -> NoReturn:
        """Remember it, and have whoever is at work clean up."""
        self.pressed = True
        raise KeyboardInterrupt


def main() -> None:
    """Run the command line; see `commands.main`."""
    signal.signal(signal.SIGINT, _leave_at_once)  # while modules are imported, and after a command has ended
    from hj_cosim.cli.commands import main as run_command_line

    interruptions = _Interruptions()
    try:
        signal.signal(signal.SIGINT, interruptions)
        run_command_line()
    except BaseException as error:
        signal.signal(signal.SIGINT, _leave_at_once)
        already_said = isinstance(error, SystemExit) and error.code == INTERRUPTED
        if interruptions.pressed and not already_said:
            _leave_at_once(signal.SIGINT, None)
        raise
    signal.signal(signal.SIGINT, _leave_at_once)


def _leave_at_once(number: int, frame: FrameType | None) -> NoReturn:
    """End the process where nothing of ours is open."""
    sys.stdout.flush()
    os.write(sys.stderr.fileno(), f"{MESSAGE}\n".encode())
    os._exit(INTERRUPTED)
