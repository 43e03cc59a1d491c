"""The command line: one thin command per library function.

The library is imported inside the commands, so that `--help` and mistakes are answered at once.
"""

import io
import sys

from rich.markup import escape

# isort: off
# Importing them puts the commands into the application, in the order of the help.
from hj_cosim.cli import run_commands, study_command, compare_command, table_commands  # noqa: F401
from hj_cosim.cli import check_command, realism_command, list_commands, examples_command  # noqa: F401

# isort: on
from hj_cosim.cli.app import app
from hj_cosim.cli.console import messages
from hj_cosim.cli.interruption import INTERRUPTED, MESSAGE
from hj_cosim.errors import HjCosimError


def main() -> None:
    """Run the command line; what a user got wrong ends in one sentence and exit status 2, Ctrl-C in 130."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal or a pipe that cannot show a letter is told '?'
            stream.reconfigure(errors="replace")
    try:
        app()
    except HjCosimError as error:
        _say_error(str(error))
        sys.exit(2)
    except OSError as error:  # what nobody named on the way, such as a disk that is full while kernels are compiled
        place = f" {error.filename}" if error.filename else ""
        _say_error(f"the system refuses{place}: {error.strerror or error}; free some space or mend the permissions")
        sys.exit(2)
    except SystemExit as stopped:
        if stopped.code == INTERRUPTED:  # Typer's answer to Ctrl-C, which comes without a word
            messages.print(MESSAGE)
        raise


def _say_error(sentence: str) -> None:
    messages.print(f"[bold red]error:[/bold red] {escape(sentence)}", highlight=False, soft_wrap=True)
