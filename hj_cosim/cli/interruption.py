"""What Ctrl-C is answered with, wherever it is pressed; nothing is imported here that takes time."""

import os
import sys

INTERRUPTED = 130  # the exit status, 128 + SIGINT, as shells have it
MESSAGE = "interrupted; nothing half-written is left; a begun study goes on with --resume"


def leave_interrupted(*_: object, said: bool = False) -> None:
    """End the process where nothing of ours is open; a handler of signals, too.

    Not by an exception: Python would end by the signal itself where an interruption was ever raised within an `exec`,
    such as that of a dataclass.

    Args:
        said: whether MESSAGE has been printed already.
    """
    sys.stdout.flush()
    if not said:
        os.write(sys.stderr.fileno(), f"{MESSAGE}\n".encode())
    os._exit(INTERRUPTED)
