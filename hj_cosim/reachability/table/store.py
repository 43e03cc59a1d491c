"""Solved value tables and their files: made from a specification, written, found again, read.

A specification is a TOML file, or the .npz of a solved table, which holds the specification that it was solved from.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from hj_cosim import locations
from hj_cosim.errors import ConfigurationError, TableError
from hj_cosim.files import whole_file
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import Game, SizeClass
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.solver import Progress, SolveReport, solve
from hj_cosim.reachability.table.size_classes import CAR, SIZE_CLASSES
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.reachability.table.table_file import TableFile, open_table_file
from hj_cosim.settings import RobotSettings, TableSpecification, read_toml, validate

# Part of every specification's hash: raised when the solver changes what it computes, so that tables are re-solved.
_SOLVER_VERSION = 4
_HASH_IN_NAME = 12  # characters of it in the name of a table that no specification names


def save_table(table: ValueTable, path: Path) -> None:
    """Write a table, whole or not at all.

    Raises:
        HjCosimError: if it cannot be written.
    """
    arrays = {"values": table.values} | {f"axis{i}": axis for i, axis in enumerate(table.grid.axes)}
    specification = table.specification.model_dump_json()
    report = asdict(table.report) | {
        "specification_hash": specification_hash(table.specification, table.game),
        "checksum": _checksum(arrays, specification),
    }
    with whole_file(path) as temporary:
        content: dict[str, Any] = {
            **arrays,
            "spec": np.array(specification),
            "report": np.array(json.dumps(report)),
        }
        np.savez(temporary, **content)


def read_table(path: Path, specification: TableSpecification | None = None) -> ValueTable:
    """Return the table in a file, which anybody may have made.

    Args:
        path: the .npz.
        specification: what it must have been solved from, the place of its game included. Without one, a table whose
            game is a Python file is refused: reading a table runs nothing that the table names.

    Raises:
        TableError: if it is missing, truncated, altered, not finite, or was solved by another version of the game.
    """
    if not path.is_file():
        raise TableError(f"there is no table {path}; solve it with `hj-cosim table solve`")
    with open_table_file(path) as file:
        specification_json = file.text("spec")
        found, game = _stated_in(file, path, specification)
        report = _report_of(file)
        grid = Grid.from_settings(found.grid, game.boundary)
        shapes = {f"axis{number}": (nodes,) for number, nodes in enumerate(grid.shape)}
        if set(file.names) != {"values", "spec", "report", *shapes} or grid.dimension != game.dimension:
            raise ValueError(f"it holds {', '.join(sorted(file.names))}, which is no table of {game.name}")
        arrays = {name: file.array(name, shape, np.float64) for name, shape in shapes.items()}
        if not all(np.allclose(arrays[f"axis{i}"], axis, rtol=1e-12) for i, axis in enumerate(grid.axes)):
            raise ValueError("its axes are not those of its specification")
        arrays["values"] = file.array("values", grid.shape, np.float32)
    if report.checksum != _checksum(arrays, specification_json):
        raise TableError(f"{path} was altered after it was solved; delete it and solve it again")
    if report.specification_hash != specification_hash(found, game):
        raise TableError(f"{path} was solved by another version of {game.name}; solve it again")
    report_fields = {field.name: getattr(report, field.name) for field in fields(SolveReport)}
    return ValueTable(found, game, arrays["values"], SolveReport(**report_fields))


@dataclass(frozen=True)
class _KeptReport(SolveReport):
    """The report as a table's file has it."""

    specification_hash: str
    checksum: str


def _stated_in(file: TableFile, path: Path, wanted: TableSpecification | None) -> tuple[TableSpecification, Game]:
    """Return the specification in a table's file, and its game.

    Raises:
        ValueError: if it is no specification.
        TableError: if its game is a Python file other than the one wanted.
    """
    found = TableSpecification.model_validate_json(file.text("spec"))
    if found.dynamics.endswith(".py") and found.dynamics != (wanted and wanted.dynamics):
        raise TableError(
            f"{path} names the Python file {found.dynamics} as its game, which is not run because a table says so; load"
            " it by its specification"
        )
    return found, find_game(found.dynamics)


def _report_of(file: TableFile) -> _KeptReport:
    """Return a file's report.

    Raises:
        ValueError: if it is no JSON, or says something else than a report.
    """
    return TypeAdapter(_KeptReport).validate_json(file.text("report"))


def specification_hash(specification: TableSpecification, game: Game) -> str:
    """Return what identifies a table's content: the specification, the game's source, the solver's version."""
    # The description says nothing about the values, nor does the place of a game's file.
    content = specification.model_dump_json(exclude={"description", "dynamics"})
    return hashlib.sha256(f"{_SOLVER_VERSION} {game.fingerprint} {content}".encode()).hexdigest()


def _checksum(arrays: Mapping[str, np.ndarray], specification: str) -> str:
    digest = hashlib.sha256(specification.encode())
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].shape} {arrays[name].dtype}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()


def find_specification(name_or_path: str) -> Path:
    """Return the file of a specification: a name in value_tables/, or a path ending in .toml or .npz.

    Raises:
        ConfigurationError: if there is none.
    """
    path = locations.given_path(name_or_path, "the value table").expanduser()
    if path.suffix == ".npz":
        if not path.is_file():
            raise ConfigurationError(f"table file {name_or_path} does not exist; solve it with `hj-cosim table solve`")
        return path
    return locations.find_toml(str(name_or_path), locations.specifications_folder(), "table specification")


def read_specification(path: Path) -> TableSpecification:
    """Return the specification in a TOML file or in a solved table, checked against the game that it names.

    Raises:
        ConfigurationError: if it cannot be read, or a key or a value is wrong.
        TableError: if a table's file is broken, or its game is a Python file.
    """
    if path.suffix == ".npz":
        with open_table_file(path) as file:
            specification, game = _stated_in(file, path, None)
    else:
        specification = validate(TableSpecification, read_toml(path), str(path))
        if specification.dynamics.endswith(".py"):
            specification = specification.model_copy(
                update={"dynamics": str((path.parent / Path(specification.dynamics).expanduser()).resolve())}
            )
        try:
            game = find_game(specification.dynamics)
        except ConfigurationError as error:
            raise ConfigurationError(f"{path}: {error}") from error
    if len(specification.grid.shape) != game.dimension:
        raise ConfigurationError(
            f"{path}: grid.shape has {len(specification.grid.shape)} entries; {game.name} has"
            f" {game.dimension} axes: {', '.join(game.state)}"
        )
    game.parameter_values(specification.parameters, str(path))
    _require_manoeuvres(specification, game, str(path))
    return specification


def _require_manoeuvres(specification: TableSpecification, game: Game, name: str) -> None:
    if specification.capped_by_manoeuvres and game.manoeuvres is None:
        raise ConfigurationError(
            f"{name}: capped_by_manoeuvres is for games whose manoeuvres are known; none are of {game.name}"
        )


def table_path(specification_path: Path) -> Path:
    """Return where the solved table of a specification's file is kept; a table's own file is that place."""
    if specification_path.suffix == ".npz":
        return specification_path
    if specification_path.parent == locations.specifications_folder():
        return locations.tables_folder() / f"{specification_path.stem}.npz"
    return specification_path.with_suffix(".npz")


def for_pair(specification: TableSpecification, robot: RobotSettings, size: SizeClass = CAR) -> TableSpecification:
    """Return the specification made out for a robot's body and limits and other cars of a size.

    A game that says nothing about robots is taken to be right for any: it comes back as it is.

    Raises:
        ConfigurationError: if the robot would need too large a grid.
    """
    game = find_game(specification.dynamics)
    if game.of_pair is None:
        return specification
    try:
        return game.of_pair(specification, robot, size)
    except ValidationError as error:
        raise ConfigurationError(
            f"no table of {game.name} can be solved for robot.length = {robot.length:g} m, robot.width ="
            f" {robot.width:g} m, robot.speed_max = {robot.speed_max:g} m/s: {error.errors()[0]['msg']}"
        ) from error


def require_robot(table: ValueTable, robot: RobotSettings) -> None:
    """Check that a table is a robot's, among other cars of some size.

    Raises:
        TableError: if it is another robot's.
    """
    specification = table.specification
    if all(for_pair(specification, robot, size) != specification for size in SIZE_CLASSES):
        raise TableError(
            f"the table of {table.game.name} is another robot's: its body or limits (omega_max, acceleration_min,"
            " acceleration_max, speed_max, length, width) are not those of the settings; load_table(..., robot=...)"
            " solves one for them"
        )


@dataclass(frozen=True)
class KeptTable:
    """A table that may have been solved already: what it is solved from, and where it is kept."""

    specification: TableSpecification
    path: Path
    size: SizeClass = CAR  # of the other cars

    @property
    def identity(self) -> str:
        """The hash of what it is solved from, solved or not."""
        return specification_hash(self.specification, find_game(self.specification.dynamics))

    @property
    def is_solved(self) -> bool:
        """Whether its file is there and of this specification.

        Raises:
            TableError: if the file is truncated or was altered.
        """
        if not self.path.is_file():
            return False
        with open_table_file(self.path) as file:
            kept = _report_of(file).specification_hash
        return kept == self.identity


def kept_table(name_or_path: str, robot: RobotSettings | None = None, size: SizeClass = CAR) -> KeptTable:
    """Return which table serves a robot among cars of a size, and where it is kept.

    A robot that the specification was not written for has a table of its own beside the named one, with the hash of
    what it is solved from in its name.

    Args:
        name_or_path: a name in value_tables/, or a path to a TOML file or to a solved table.
        robot: its body and limits; those that the specification was written for unless given.
        size: of the other cars.

    Raises:
        ConfigurationError: if the specification is wrong, or no table can be solved for the robot.
    """
    source = find_specification(name_or_path)
    named = read_specification(source)
    kept = table_path(source)
    if robot is None and size == CAR:
        return KeptTable(named, kept)
    specification = for_pair(named, robot or RobotSettings(), size)
    if specification == named:
        return KeptTable(named, kept, size)
    identity = specification_hash(specification, find_game(specification.dynamics))[:_HASH_IN_NAME]
    return KeptTable(specification, kept.with_name(f"{kept.stem}-{identity}.npz"), size)


def solve_table(specification: TableSpecification | str, progress: Progress | None = None) -> ValueTable:
    """Solve a specification, or the one that a name or a path means; nothing is written.

    Args:
        specification: what to solve, or its name in value_tables/, or a path to a TOML file.
        progress: called with the steps done and the steps in all, after each step.

    Returns:
        The table.

    Raises:
        ConfigurationError: if the specification is wrong.
        TableError: if the solution is not finite.
    """
    if isinstance(specification, TableSpecification):
        name = f"a table of {Path(specification.dynamics).name}"
    else:
        name = str(find_specification(specification))
        specification = read_specification(Path(name))
    game = find_game(specification.dynamics)
    _require_manoeuvres(specification, game, name)
    values, report = solve(specification, game, name, progress)
    if specification.capped_by_manoeuvres and game.manoeuvres is not None:
        grid = Grid.from_settings(specification.grid, game.boundary)
        values = game.manoeuvres.capped(values, grid, {**game.parameters, **specification.parameters})
    return ValueTable(specification, game, values - np.float32(specification.margin), report)


def load_table(
    name_or_path: str,
    progress: Progress | None = None,
    *,
    robot: RobotSettings | None = None,
    size: SizeClass = CAR,
    announce: Callable[[str], None] | None = None,
) -> ValueTable:
    """Return the solved table of a specification; solve and keep it if there is none or the specification changed.

    Args:
        name_or_path: a name in value_tables/, or a path to a TOML file or to a solved table (.npz).
        progress: called with the steps done and the steps in all, after each step of a solve.
        robot: whose body and limits it is to be for; whom the specification was written for unless given. Another
            robot's table is solved once and kept beside the named one.
        size: the size class of the other cars.
        announce: told in one sentence what is solved before it is, if anything.

    Raises:
        ConfigurationError: if the specification is wrong.
        TableError: if the kept table is truncated or was altered.
    """
    wanted = kept_table(name_or_path, robot, size)
    is_a_solved_one = Path(name_or_path).expanduser() == wanted.path  # its file is all that there is: nothing to solve
    if is_a_solved_one or wanted.is_solved:
        return replace(read_table(wanted.path, wanted.specification), size=size)
    if announce is not None:
        reason = (
            ""
            if wanted.path == table_path(find_specification(name_or_path))
            else (f" for this robot and cars up to {size.length:g} m x {size.width:g} m")
        )
        announce(f"solving a value table{reason}; it is kept as {wanted.path}")
    table = replace(solve_table(wanted.specification, progress), size=size)
    save_table(table, wanted.path)
    return table
