"""A robot's tables by size class: the one of cars, and with it those of the larger classes that are met."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import SizeClass
from hj_cosim.reachability.solver.solver import Progress
from hj_cosim.reachability.table.size_classes import CAR, SIZE_CLASSES
from hj_cosim.reachability.table.store import KeptTable, kept_table, load_table, read_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import RobotSettings


def kept_tables(name_or_path: str, robot: RobotSettings, sizes: Iterable[SizeClass] = (CAR,)) -> tuple[KeptTable, ...]:
    """Return which tables serve a robot among cars of some sizes, and where they are kept: that of cars first.

    A game that says nothing about sizes has one table for all.

    Args:
        name_or_path, robot: as `store.kept_table` takes them.
        sizes: of the other cars.

    Raises:
        ConfigurationError: if the specification is wrong, or no table can be solved for the robot.
    """
    found = [kept_table(name_or_path, robot)]
    for size in SIZE_CLASSES[1:]:
        if size in sizes:
            kept = kept_table(name_or_path, robot, size)
            if kept.specification != found[0].specification:
                found.append(kept)
    return tuple(found)


def read_tables(kept: Sequence[KeptTable]) -> ValueTable:
    """Return solved tables as one, that of cars with those of larger ones.

    Raises:
        TableError: as `store.read_table`.
    """
    table, *larger = (replace(read_table(one.path, one.specification), size=one.size) for one in kept)
    return replace(table, larger=tuple(larger))


def load_tables(
    name_or_path: str,
    sizes: Iterable[SizeClass],
    progress: Progress | None = None,
    *,
    robot: RobotSettings,
    announce: Callable[[str], None] | None = None,
) -> ValueTable:
    """Return the table of cars with those of larger ones; what is not solved is solved and kept, as by `load_table`.

    Args:
        name_or_path, progress, robot, announce: as `store.load_table` takes them.
        sizes: of the other cars that are met.

    Raises:
        ConfigurationError, TableError: as `store.load_table`; and if its game is not one of two cars.
    """
    kept = kept_tables(name_or_path, robot, sizes)
    find_game(kept[0].specification.dynamics).require_two_cars()  # now, rather than after a solve
    table, *larger = (load_table(name_or_path, progress, robot=robot, size=one.size, announce=announce) for one in kept)
    return replace(table, larger=tuple(larger))


def with_classes(
    table: ValueTable,
    name_or_path: str,
    sizes: Iterable[SizeClass],
    *,
    robot: RobotSettings,
    announce: Callable[[str], None] | None = None,
) -> ValueTable:
    """Return a robot's table with those of size classes that turn out to be met; itself where it has them.

    Args:
        table: of cars at least.
        name_or_path, robot, announce: as `store.load_table` takes them.
        sizes: of the other cars that are met.

    Raises:
        ConfigurationError, TableError: as `store.load_table`.
    """
    present = {each.size for each in table.by_size}
    met = [size for size in SIZE_CLASSES if size in present or size in sizes]
    missing = [one for one in kept_tables(name_or_path, robot, met)[1:] if one.size not in present]
    if not missing:
        return table
    found = {each.size: each for each in table.larger}
    for one in missing:
        found[one.size] = load_table(name_or_path, robot=robot, size=one.size, announce=announce)
    return replace(table, larger=tuple(found[size] for size in SIZE_CLASSES if size in found))
