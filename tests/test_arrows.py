"""The walls of the house: which room may know which, how long a file is, and how much a function is handed."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

import hj_cosim

PACKAGE = Path(hj_cosim.__file__).resolve().parent

# From the cellar to the roof. A room knows the rooms of the lines above its own, and no other of its own line. A new
# room has to be given its place here.
FLOORS = (
    ("errors", "kernels"),
    ("settings", "files", "locations", "plugin_answers"),
    ("vehicles", "plugins"),
    ("scene",),
    ("recording",),
    ("metrics", "reachability"),
    ("traffic", "planning", "control"),
    ("analysis", "verification", "testing"),
    ("cosim",),
    ("rehearsal",),
    ("study", "run", "training"),
    ("watching",),
    ("cli", "examples"),
    ("__main__",),
)
# Lower down, and still walled off: the loop stands on recording, not on drawing.
WALLS = {("cosim", "analysis"), ("cosim", "testing")}
# The package itself: names for users that are imported when they are first asked for, and the version.
FACE = "hj_cosim"

MOST_LINES = 350
MOST_PARAMETERS = 8
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


class Arrow(NamedTuple):
    """One module that imports another, both as they are written: `hj_cosim.scene.road`."""

    source: str
    target: str
    for_types_only: bool  # under `if TYPE_CHECKING:`


def modules(package: Path) -> Iterator[tuple[str, Path]]:
    """Yield the name and the file of every module."""
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def arrows_of(module: str, text: str, known: set[str]) -> Iterator[Arrow]:
    """Yield what a module imports from the package: at its top, in its functions, and for its types."""

    def visit(node: ast.AST, for_types_only: bool) -> Iterator[Arrow]:
        targets: list[str] = []
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively; say the whole name"
            targets = [f"{node.module}.{alias.name}" for alias in node.names]
        for target in targets:
            if target.split(".")[0] == FACE:
                yield Arrow(module, target if target in known else target.rpartition(".")[0] or target, for_types_only)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for child in node.body:
                yield from visit(child, True)
            for child in node.orelse:
                yield from visit(child, for_types_only)
            return
        for child in ast.iter_child_nodes(node):
            yield from visit(child, for_types_only)

    yield from visit(ast.parse(text), False)


def room(module: str) -> str:
    """Return the room that a module is in: the first name below the package."""
    return module.split(".")[1] if "." in module else FACE


def place(module: str) -> str:
    """Return a module as its file below the package, for a sentence."""
    return module.removeprefix("hj_cosim.").replace(".", "/") + ".py"


def crossed_wall(arrow: Arrow) -> str | None:
    """Return the sentence about the wall that an arrow crosses; None where there is a door.

    An import for types alone counts as any other: who has to know a type knows the room.
    """
    source, target = room(arrow.source), room(arrow.target)
    for name in (source, target):
        if name not in FLOOR_OF and name != FACE:
            return f"{name} is a new room: give it a place in FLOORS"
    if FACE in (source, target) or source == target:
        return None
    sentence = f"{place(arrow.source)} imports {place(arrow.target)}: {source} may not know {target}"
    if (source, target) in WALLS:
        return sentence
    if FLOOR_OF[target] < FLOOR_OF[source]:
        return None
    return sentence


@cache
def all_arrows() -> list[Arrow]:
    """Return every import of the package by the package."""
    found = list(modules(PACKAGE))
    known = {name for name, _ in found}
    return [arrow for name, path in found for arrow in arrows_of(name, path.read_text(encoding="utf-8"), known)]


def test_arrows_go_downwards_only():
    crossed = {wall for arrow in all_arrows() if (wall := crossed_wall(arrow))}
    assert not crossed, "\n".join(sorted(crossed))


def test_the_face_imports_nothing_until_it_is_asked():
    assert all(arrow.for_types_only for arrow in all_arrows() if arrow.source == FACE)


def test_contracts_import_no_implementation():
    """A contract stands on data: other contracts, what is observed, settings, errors.

    What it names for types alone is exempt: a value table is handed through to who asks for one, and an implementation
    that does not ask never imports it.
    """
    data = {"hj_cosim.scene", "hj_cosim.settings", "hj_cosim.errors", "hj_cosim.reachability.grid"}
    contracts = [arrow for arrow in all_arrows() if arrow.source.endswith(".contract")]
    assert {room(arrow.source) for arrow in contracts} == {"planning", "control", "traffic", "reachability"}
    crossed = [
        f"{place(arrow.source)} imports {place(arrow.target)}: a contract may not know an implementation"
        for arrow in contracts
        if not arrow.for_types_only
        and arrow.target not in data
        and not arrow.target.startswith(("hj_cosim.scene.", "hj_cosim.settings."))
        and not arrow.target.endswith(".contract")
    ]
    assert not crossed, "\n".join(crossed)


def test_no_two_modules_import_each_other():
    """A circle of modules cannot be read from one end; found by taking away, again and again, who imports nobody."""
    known = {name for name, _ in modules(PACKAGE)} - {FACE}
    waits_for = {name: set() for name in known}
    for arrow in all_arrows():
        if not arrow.for_types_only and arrow.source in known and arrow.target in known:
            waits_for[arrow.source].add(arrow.target)
    while free := {name for name, targets in waits_for.items() if not targets & waits_for.keys()}:
        waits_for = {name: targets for name, targets in waits_for.items() if name not in free}
    assert not waits_for, f"in circles or above one: {', '.join(sorted(waits_for))}"


@pytest.mark.parametrize(
    ("module", "text", "sentence"),
    [
        ("planning.x", "from hj_cosim.control.y import z", "planning/x.py imports control/y.py: planning may not know"),
        ("scene.x", "def f():\n    import hj_cosim.traffic.fake", "scene may not know traffic"),
        ("cosim.x", "if TYPE_CHECKING:\n    from hj_cosim.analysis.y import Z", "cosim may not know analysis"),
        ("metrics.x", "class A:\n    from hj_cosim.reachability.grid import Grid", "metrics may not know reachability"),
        ("cellar.x", "from hj_cosim.scene import road", "cellar is a new room"),
    ],
)
def test_a_crossed_wall_is_named(module, text, sentence):
    known = {"hj_cosim.control.y", "hj_cosim.traffic.fake", "hj_cosim.analysis.y", "hj_cosim.reachability.grid"}
    (arrow,) = arrows_of(f"hj_cosim.{module}", text, known)
    assert sentence in str(crossed_wall(arrow))


@pytest.mark.parametrize("text", ["import numpy", "from hj_cosim.scene.road import Road", "import hj_cosim.scene.road"])
def test_a_door_is_open(text):
    for arrow in arrows_of("hj_cosim.planning.x", text, {"hj_cosim.scene.road"}):
        assert arrow.target == "hj_cosim.scene.road"
        assert crossed_wall(arrow) is None


def folders() -> list[str]:
    """Return the package's folders that hold Python files, relative to it."""
    return sorted({path.parent.relative_to(PACKAGE).as_posix() for _, path in modules(PACKAGE)})


def too_long(path: Path) -> Iterator[str]:
    """Yield what is too long in a file: the file itself, and its functions' lists of parameters.

    A function may have more parameters if the line above it, or above its decorators, is a comment that says how many
    and what that buys.
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    if len(lines) > MOST_LINES:
        yield f"{path.name} has {len(lines)} lines, {MOST_LINES} are the most"
    for node in ast.walk(ast.parse("\n".join(lines))):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        every = node.args
        names = [argument.arg for argument in (*every.posonlyargs, *every.args, *every.kwonlyargs)]
        count = len([name for name in names if name not in ("self", "cls")])
        count += sum(extra is not None for extra in (every.vararg, every.kwarg))
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        above = lines[first - 2].strip() if first >= 2 else ""
        if count > MOST_PARAMETERS and not (above.startswith("#") and " parameters: " in above):
            yield f"{path.name}:{node.lineno} {node.name} has {count} parameters, {MOST_PARAMETERS} are the most"


@pytest.mark.parametrize("folder", folders())
def test_files_are_short_and_functions_are_handed_little(folder):
    found = [sentence for path in sorted((PACKAGE / folder).glob("*.py")) for sentence in too_long(path)]
    assert not found, "\n".join(found)


def test_what_is_too_long_is_named(tmp_path):
    file = tmp_path / "wide.py"
    wide = "def wide(self, a, b, c, d, e, f, g, *h, **i):\n    pass\n"
    file.write_text("x = 1\n" + wide)
    assert list(too_long(file)) == ["wide.py:2 wide has 9 parameters, 8 are the most"]
    file.write_text("# Nine parameters: the definition's own.\n@cached\n" + wide)
    assert list(too_long(file)) == []
    file.write_text("# Nothing about that.\n" + wide + "\n" * 350)
    assert len(list(too_long(file))) == 2
