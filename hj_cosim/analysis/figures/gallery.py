"""Drawing a figure by its name, from a run's or a study's folder or from a value table alone."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from hj_cosim.analysis.figures.catalogue import FIGURES, FigureKind
from hj_cosim.analysis.figures.style import Drawing, require_width
from hj_cosim.errors import OutputError
from hj_cosim.recording.run_folder import read_run

if TYPE_CHECKING:
    from hj_cosim.reachability.table.table import ValueTable

DEFAULT_TABLE = "highway"


def draw_figure(
    name: str,
    *,
    run: Path | None = None,
    study: Path | None = None,
    table: "ValueTable | None" = None,
    width: int | None = None,
) -> Drawing:
    """Draw a figure by its name.

    Args:
        name: one of FIGURES.
        run: a run's folder, for figures of a run.
        study: a study's folder, for figures of a study.
        table: V; unless given, the run's table, or `highway`, which is solved first if it has not been.
        width: mm, 85 (one column of a journal) or 178 (two); the figure's own unless given.

    Returns:
        The picture and its data; `style.save_drawing` writes both.

    Raises:
        OutputError: if there is no such figure or width, or the folder that it needs is not given.
        RunFolderError: if the folder does not hold what the figure needs.
        TableError: if the table cannot be had.
    """
    if name not in FIGURES:
        raise OutputError(f"no figure is called {name!r}; choose one of {', '.join(FIGURES)}")
    if width is not None:
        require_width(width)
    kind, sized = FIGURES[name], {} if width is None else {"width": width}
    if kind.source == "table":
        return function_of(kind)(table or _default_table(), **sized)
    if kind.source == "study":
        if study is None:
            raise OutputError(f"figure {name} is drawn from a study; give its folder with --study")
        return function_of(kind)(study, **sized)
    if run is None:
        raise OutputError(f"figure {name} is drawn from a run; give its folder with --run")
    read = read_run(run)
    if not kind.needs_table:
        return function_of(kind)(read, **sized)
    from hj_cosim.analysis.figures.run_table import table_of  # with the kernels that look values up

    return function_of(kind)(read, table or table_of(read), **sized)


def function_of(kind: FigureKind) -> Callable[..., Drawing]:
    """Return what draws a figure; its module, and what that stands on, is imported now and no earlier."""
    module, function = kind.drawn_by.split(":")
    return getattr(import_module(f"hj_cosim.analysis.figures.{module}"), function)


def _default_table() -> "ValueTable":
    from hj_cosim.reachability.table.store import load_table  # with the solver's kernels

    return load_table(DEFAULT_TABLE)
