"""Ctrl-C at any instant: one line, status 130, no traceback."""

import os
import signal
import subprocess
import sys

import pytest

from hj_cosim.cli.interruption import MESSAGE

# `-X importtime` has Python say each module that it has imported: what to wait for.
COMMAND = [sys.executable, "-X", "importtime", "-m", "hj_cosim"]


@pytest.mark.parametrize("module", ["rich.markup", "typer.main", "hj_cosim.cli.commands", "pydantic", "numba"])
def test_interruption_while_modules_are_imported_is_answered_in_one_line(module, small_specification, tmp_path):
    options = ("run", "--table", str(small_specification), "--out", str(tmp_path / "run"))
    process = subprocess.Popen([*COMMAND, *options], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for line in process.stderr:
        if line.endswith(f" {module}\n"):
            process.send_signal(signal.SIGINT)
            break
    rest, out = process.stderr.read().splitlines(), process.stdout.read()
    assert process.wait(timeout=60) == 130
    assert [line for line in rest if not line.startswith("import time:")] == [MESSAGE]
    assert out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [ImportError, SystemError], ids=lambda error: error.__name__)
def test_interruption_that_a_library_turns_into_another_error_is_still_one(error):
    """Extension modules are known to answer an interrupted import with an ImportError."""
    program = (
        "import os, signal\n"
        "from hj_cosim.cli import commands, entry\n"
        "def command():\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        signal.pause()\n"
        "    except KeyboardInterrupt:\n"
        f"        raise {error.__name__}('initialization failed') from None\n"
        "commands.main = command\n"
        "entry.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (130, f"{MESSAGE}\n", "")


def test_interruption_within_what_python_itself_compiles_ends_with_the_same_status(tmp_path, monkeypatch):
    """Python remembers one in an `exec`, such as that of a dataclass, and would end by the signal long afterwards."""
    (tmp_path / "victim.py").write_text(
        "import os, signal\n"
        "from hj_cosim.cli import commands, entry\n"
        "def command():\n"
        "    try:\n"
        "        exec('os.kill(os.getpid(), signal.SIGINT); signal.pause()')\n"
        "    except KeyboardInterrupt:\n"
        "        raise SystemExit(130) from None\n"
        "commands.main = command\n"
        "entry.main()\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))
    assert ended("-m", "victim") == (130, "")


def test_interruption_before_there_is_a_handler_is_answered_too():
    program = (
        "import builtins\n"
        "import_it = builtins.__import__\n"
        "def import_interrupted(name, *more):\n"
        "    if name == 'signal':\n"
        "        raise KeyboardInterrupt\n"
        "    return import_it(name, *more)\n"
        "builtins.__import__ = import_interrupted\n"
        "import hj_cosim.cli.entry\n"
    )
    assert ended("-c", program) == (130, "interrupted\n")


def test_interruption_while_python_takes_itself_down_changes_nothing():
    program = (
        "import os, signal\n"
        "from hj_cosim.cli import commands, entry\n"
        "class Last:\n"
        "    def __del__(self, kill=os.kill, this=os.getpid(), interruption=signal.SIGINT):\n"
        "        kill(this, interruption)\n"
        "last = Last()\n"
        "commands.main = lambda: None\n"
        "entry.main()\n"
    )
    assert ended("-c", program) == (0, "")


def ended(*program):
    """Return a program's exit status and messages."""
    done = subprocess.run([sys.executable, *program], capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stderr


def test_error_of_our_own_is_no_interruption():
    program = (
        "from hj_cosim.cli import commands, entry\n"
        "def command():\n"
        "    raise ZeroDivisionError('a programming error')\n"
        "commands.main = command\n"
        "entry.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert "ZeroDivisionError: a programming error" in done.stderr
