"""What people see in the terminal: progress bars, result tables, errors. Scripts take --json instead."""

import json
import logging
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, TextIO

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.padding import Padding
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from hj_cosim.metrics.catalogue import shown_in_run

# Results go to standard output, everything for people's eyes only to standard error, so that --json can be piped.
messages = Console(stderr=True)
results = Console()
# Where JSON goes while `answers_alone` holds; empty otherwise.
_answers: list[TextIO] = []

_NARROWEST_TEXT = 24  # columns that a table's last, longest text needs to be read


class WarningCount(logging.Handler):
    """Counts the library's warnings (SUMO's among them) instead of printing them."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Count one."""
        self.count += 1


def say(sentence: str) -> None:
    """Print a sentence beside the progress, as it is."""
    messages.print(sentence, markup=False, highlight=False, soft_wrap=True)


def progress_bars() -> Progress:
    """Return bars with the time left, on standard error; nothing where that is no terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=messages,
        disable=not messages.is_terminal,
    )


def bar(bars: Progress, description: str) -> Callable[[int, int], None]:
    """Return a progress callback (done, total) whose bar appears when it is first called."""
    tasks: list[TaskID] = []

    def advance(done: int, total: int) -> None:
        if not tasks:
            tasks.append(bars.add_task(description, total=total))
        bars.update(tasks[0], completed=done, total=total)

    return advance


@contextmanager
def answers_alone() -> Iterator[None]:
    """Keep standard output for what `print_json` prints; all else, of a plug-in perhaps, goes to standard error."""
    _answers.append(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _answers.pop()


def print_json(value: Any) -> None:
    """Print a result as strict JSON; what is not finite becomes null."""
    print(json.dumps(_finite(value), indent=2, allow_nan=False), file=_answers[-1] if _answers else sys.stdout)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def summary_table(summary: Mapping[str, Any], timing: Mapping[str, float]) -> Table:
    """Return a run's summary as a table to read; which metrics, and how, their declarations say."""
    stack = summary["planner"] if summary["filter"] == "none" else f"{summary['planner']} + {summary['filter']}"
    scheme = "" if summary["filter"] == "none" else f" ({summary['scheme']})"
    title = f"{summary['scenario']}, seed {summary['seed']}: {stack}{scheme}, {summary['duration']:g} s"
    table = Table(title=escape(title))
    table.add_column("what")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_row("ended by", escape(str(summary["ended"])), "")
    for metric in shown_in_run():
        value = summary.get(metric.name)
        if metric.name in summary and (value or metric.shown != "where it happened"):
            table.add_row(metric.label, metric.text(value), metric.unit)
    table.add_row("wall time", f"{timing['wall_seconds']:.2f}", "s")
    table.add_row("faster than real time", f"{timing['real_time_factor']:.1f}", "x")
    return table


def show_repetition(repetition: Any) -> None:
    """Print whether a run that was driven again came out the same, and what is not as it was.

    Args:
        repetition: a `cosim.repetition.Repetition`.
    """
    original = escape(str(repetition.original))
    if repetition.is_exact:
        results.print(f"Repeats {original}: the same bytes in {', '.join(repetition.same)}", soft_wrap=True)
    else:
        results.print(f"Differs from {original} in {', '.join(repetition.different)}", soft_wrap=True)
    for name, (then, now) in repetition.versions.items():
        results.print(escape(f"{name} was {then} then and is {now} now"), soft_wrap=True)


def show_rows(title: str, rows: Sequence[Mapping[str, Any]], as_json: bool = False) -> None:
    """Print rows of the same keys as a table, or one below the other where the terminal is too narrow for that.

    Args:
        title: of the table.
        rows: what each column holds, the name first and the longest text last.
        as_json: print them as JSON instead.
    """
    if as_json:
        print_json(rows)
        return
    columns = list(rows[0])
    cells = [[_cell(row[column]) for column in columns] for row in rows]
    widths = [
        max(cell_len(text) for text in (column, *own))
        for column, own in zip(columns, zip(*cells, strict=True), strict=True)
    ]
    if sum(widths[:-1]) + 2 * len(columns) + min(widths[-1], _NARROWEST_TEXT) <= results.width:
        results.print(plain_table(title, columns, [list(row.values()) for row in rows]))
        return
    results.print(f"{title}\n", style="bold", markup=False)
    for row in cells:
        results.print(Text(row[0], style="bold"), overflow="fold")
        for column, text in zip(columns[1:], row[1:], strict=True):
            if text:
                results.print(Padding(Text(f"{column.replace('_', ' ')}: {text}", overflow="fold"), (0, 0, 0, 4)))


def _cell(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def show_files(paths: Sequence[Path], as_json: bool) -> None:
    """Print which files were written."""
    if as_json:
        print_json([{"file": str(path), "bytes": path.stat().st_size} for path in paths])
        return
    for path in paths:
        results.print(f"wrote [bold]{escape(str(path))}[/bold] ({path.stat().st_size / 1e6:.2f} MB)", soft_wrap=True)


def show_place(folder: Path | None) -> None:
    """Print where everything is."""
    results.print(f"Everything is in [bold]{escape(str(folder))}[/bold]", soft_wrap=True)


def plain_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> Table:
    """Return a table of texts and numbers; numbers stand to the right, the last column takes the room that is left."""
    table = Table(title=escape(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0), expand=True)
    for index, column in enumerate(columns):
        numeric = bool(rows) and all(isinstance(row[index], int | float) for row in rows)
        heading = column.replace("_", " ")
        if numeric:
            table.add_column(heading, justify="right", max_width=9)
        else:
            last = index == len(columns) - 1
            table.add_column(heading, overflow="fold", ratio=1 if last else None, no_wrap=not last)
    for row in rows:
        table.add_row(*(escape(_cell(cell)) for cell in row))
    return table
