"""What a command imports before it answers: those that only list wait for no compiler and for nothing that draws."""

import json
import subprocess
import sys

HEAVY = ("numba", "scipy", "pandas", "matplotlib", "libsumo", "pyarrow", "qpsolvers")

# Runs commands one after the other in a fresh interpreter; answers with what is imported after each of them.
PROGRAM = """
import contextlib, io, json, sys
from hj_cosim.cli.entry import main
found = []
for command in json.loads(sys.argv[1]):
    sys.argv = ["hj-cosim", *command]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        main()
    found.append([len(out.getvalue()), [name for name in json.loads(%r) if name in sys.modules]])
print(json.dumps(found))
"""


def imported_by(*commands: tuple[str, ...]) -> list[list[str]]:
    """Return which heavy libraries are there after each of the commands, which all answer something."""
    program = PROGRAM % json.dumps(HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(commands)], capture_output=True, text=True, check=True
    )
    answers = json.loads(done.stdout)
    assert all(length > 0 for length, _ in answers), answers
    return [names for _, names in answers]


def test_what_only_lists_imports_no_compiler_and_nothing_that_draws():
    commands = (
        ("--version",),
        ("--help",),
        ("run", "--help"),
        ("knobs", "--json"),
        ("metrics", "--json"),
        ("figure", "--json"),
        ("examples",),
        ("scenarios", "--template"),
        ("scenarios", "--json"),
    )
    for command, names in zip(commands, imported_by(*commands), strict=True):
        assert names == [], f"hj-cosim {' '.join(command)} imports {', '.join(names)}"
