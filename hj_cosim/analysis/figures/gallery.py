"""Drawing a figure by its name, from a run's or a study's folder or from a value table alone."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from hj_cosim.analysis.figures.catalogue import FIGURES, FigureKind
from hj_cosim.analysis.figures.style import Drawing
from hj_cosim.errors import OutputError
from hj_cosim.recording.run_folder import read_run

if TYPE_CHECKING:
    from hj_cosim.reachability.table.table import ValueTable

DEFAULT_TABLE = "highway"


def draw_figure(
    name: str, *, run: Path | None = None, study: Path | None = None, table: "ValueTable | None" = None
) -> Drawing:
    """Draw a figure by its name.

    Args:
        name: one of FIGURES.
        run: a run's folder, for figures of a run.
        study: a study's folder, for figures of a study.
        table: V; unless given, the run's table, or `highway`, which is solved first if it has not been.

    Returns:
        The picture and its data; `style.save_drawing` writes both.

    Raises:
        OutputError: if there is no such figure, or the folder that it needs is not given.
        RunFolderError: if the folder does not hold what the figure needs.
        TableError: if the table cannot be had.
    """
    if name not in FIGURES:
        raise OutputError(f"no figure is called {name!r}; choose one of {', '.join(FIGURES)}")
    kind = FIGURES[name]
    if kind.source == "table":
        return _function_of(kind)(table or _default_table())
    if kind.source == "study":
        if study is None:
            raise OutputError(f"figure {name} is drawn from a study; give its folder with --study")
        return _function_of(kind)(study)
    if run is None:
        raise OutputError(f"figure {name} is drawn from a run; give its folder with --run")
    read = read_run(run)
    if not kind.needs_table:
        return _function_of(kind)(read)
    from hj_cosim.analysis.figures.run_table import table_of  # with the kernels that look values up

    return _function_of(kind)(read, table or table_of(read))


def _function_of(kind: FigureKind) -> Callable[..., Drawing]:
    """Return what draws a figure; its module, and what that stands on, is imported now and no earlier."""
    module, function = kind.drawn_by.split(":")
    return getattr(import_module(f"hj_cosim.analysis.figures.{module}"), function)


def _default_table() -> "ValueTable":
    from hj_cosim.reachability.table.store import load_table  # with the solver's kernels

    return load_table(DEFAULT_TABLE)
