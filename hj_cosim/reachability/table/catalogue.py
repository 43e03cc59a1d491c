"""The tables that there are: specifications in value_tables/, and which of them are solved."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hj_cosim.errors import TableError
from hj_cosim.locations import names_in, specifications_folder
from hj_cosim.reachability.table.store import find_specification, read_specification, read_table, table_path
from hj_cosim.settings import TableSpecification, overlay, validate


@dataclass(frozen=True)
class TableEntry:
    """A specification and the state of its table."""

    name: str
    dynamics: str
    shape: str
    scheme: str
    horizon: float  # s
    state: str  # solved, not solved, or outdated: solved from another specification, or broken
    megabytes: float  # on disk, 0 unless solved


def table_overview() -> list[TableEntry]:
    """Return every specification in value_tables/ with the state of its table.

    Raises:
        ConfigurationError: if one of the specifications is wrong.
    """
    return [_entry(name) for name in names_in(specifications_folder())]


def _entry(name: str) -> TableEntry:
    path = find_specification(name)
    specification = read_specification(path)
    kept = table_path(path)
    return TableEntry(
        name=name,
        dynamics=specification.dynamics,
        shape="x".join(str(nodes) for nodes in specification.grid.shape),
        scheme=specification.scheme,
        horizon=specification.horizon,
        state=_state(kept, specification),
        megabytes=round(kept.stat().st_size / 1e6, 1) if kept.is_file() else 0.0,
    )


def _state(kept: Path, specification: TableSpecification) -> str:
    if not kept.is_file():
        return "not solved"
    try:
        return "solved" if read_table(kept).specification == specification else "outdated"
    except TableError:
        return "outdated"


def changed_specification(
    path: Path, *, shape: Sequence[int] | None = None, scheme: str | None = None
) -> TableSpecification:
    """Return the specification in a file with another shape or scheme.

    Raises:
        ConfigurationError: if the file, the shape or the scheme is wrong.
    """
    specification = read_specification(path)
    changes: dict[str, object] = {}
    if shape:
        changes["grid"] = {"shape": tuple(shape)}
    if scheme:
        changes["scheme"] = scheme
    return validate(TableSpecification, overlay(specification.model_dump(exclude_unset=True), changes), "command line")
