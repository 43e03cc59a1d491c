"""Where the program begins and ends: Ctrl-C is answered in one line from its first instant to its last.

The first instant is this file's first line: what Python does before, to start and to find it, is Python's own. What
takes long to import is imported under a guard. An interruption can be lost on its way (libraries catch what is raised
in the middle of their import or of a callback), so that it is remembered as well as raised.
"""

import os

try:
    import atexit
    import signal
    from types import FrameType
    from typing import NoReturn

    from hj_cosim.cli.interruption import INTERRUPTED, leave_interrupted
except KeyboardInterrupt:  # before there is anything that could have been left half-written
    os.write(2, b"interrupted\n")
    os._exit(130)


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
    # The first to be registered is the last to be called: then Python takes itself down, which is not to be cut short.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGINT, leave_interrupted)  # while modules are imported, and after a command has ended
    from hj_cosim.cli.commands import main as run_command_line

    interruptions = _Interruptions()
    try:
        signal.signal(signal.SIGINT, interruptions)
        run_command_line()
    except BaseException as error:
        signal.signal(signal.SIGINT, leave_interrupted)
        if interruptions.pressed:
            leave_interrupted(said=isinstance(error, SystemExit) and error.code == INTERRUPTED)
        raise
    signal.signal(signal.SIGINT, leave_interrupted)
