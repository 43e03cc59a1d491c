"""What people see in the terminal: progress bars, result tables, errors. Scripts take --json instead."""

import json
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

# Results go to standard output, everything for people's eyes only to standard error, so that --json can be piped.
messages = Console(stderr=True)
results = Console()

# What a summary shows, in this order: key, what it is, unit, format.
_SUMMARY_ROWS = (
    ("ended", "ended by", "", "s"),
    ("mean_speed", "mean speed", "m/s", ".2f"),
    ("distance", "distance", "m", ".0f"),
    ("lane_changes", "lane changes", "", "d"),
    ("collisions", "collisions", "", "d"),
    ("min_gap", "smallest gap to any car", "m", ".2f"),
    ("ttc_ge_3", "share of samples with TTC >= 3 s", "", ".4f"),
    ("ttc_p10", "TTC, 10th percentile", "s", ".2f"),
    ("ttc_p1", "TTC, 1st percentile", "s", ".2f"),
    ("btn_le_1", "share of samples with BTN <= 1", "", ".4f"),
    ("btn_p90", "BTN, 90th percentile", "", ".3f"),
    ("stn_le_1", "share of samples with STN <= 1", "", ".4f"),
    ("stn_p90", "STN, 90th percentile", "", ".3f"),
    ("mean_abs_acceleration", "mean |a|", "m/s²", ".3f"),
    ("intervention_percent", "filter intervened", "%", ".1f"),
    ("promise_kept_percent", "filter kept its promise", "%", ".2f"),
    ("promise_samples", "samples with a promise", "", "d"),
    ("not_judged_samples", "samples that the filter could not judge", "", "d"),
    ("desired_not_finite_samples", "samples with no finite control to filter", "", "d"),
    ("solver_failures", "failures of the filter's solver, answered by another", "", "d"),
    ("escape_samples", "samples driven by a manoeuvre that escapes", "", "d"),
    ("no_escape_samples", "samples with no escape from the worst of all cars", "", "d"),
    ("wall_seconds", "wall time", "s", ".2f"),
    ("real_time_factor", "faster than real time", "x", ".1f"),
)
# What should not happen is shown only where it did.
_FAULTS = (
    *("not_judged_samples", "desired_not_finite_samples", "solver_failures"),
    *("escape_samples", "no_escape_samples"),
)


class WarningCount(logging.Handler):
    """Counts the library's warnings (SUMO's among them) instead of printing them."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Count one."""
        self.count += 1


def progress_bars() -> Progress:
    """Return bars with the time left, on standard error."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=messages,
    )


def bar(bars: Progress, description: str) -> Callable[[int, int], None]:
    """Return a progress callback (done, total) whose bar appears when it is first called."""
    tasks: list[TaskID] = []

    def advance(done: int, total: int) -> None:
        if not tasks:
            tasks.append(bars.add_task(description, total=total))
        bars.update(tasks[0], completed=done, total=total)

    return advance


def print_json(value: Any) -> None:
    """Print a result as strict JSON; what is not finite becomes null."""
    print(json.dumps(_finite(value), indent=2, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def summary_table(summary: Mapping[str, Any]) -> Table:
    """Return a run's summary as a table to read."""
    stack = summary["planner"] if summary["filter"] == "none" else f"{summary['planner']} + {summary['filter']}"
    scheme = "" if summary["filter"] == "none" else f" ({summary['scheme']})"
    table = Table(title=f"{summary['scenario']}, seed {summary['seed']}: {stack}{scheme}, {summary['duration']:g} s")
    table.add_column("what")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for key, what, unit, form in _SUMMARY_ROWS:
        if key in summary and (summary[key] or key not in _FAULTS):
            value = summary[key]
            table.add_row(what, "–" if value is None else format(value, form), unit)
    return table


def plain_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> Table:
    """Return a table of texts and numbers; numbers stand to the right, the last column takes the room that is left."""
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0), expand=True)
    for index, column in enumerate(columns):
        numeric = bool(rows) and all(isinstance(row[index], int | float) for row in rows)
        heading = column.replace("_", " ")
        if numeric:
            table.add_column(heading, justify="right", max_width=9)
        else:
            last = index == len(columns) - 1
            table.add_column(heading, overflow="fold", ratio=1 if last else None, no_wrap=not last)
    for row in rows:
        table.add_row(*(f"{cell:g}" if isinstance(cell, float) else str(cell) for cell in row))
    return table


# The columns of the paper's table: key, heading, format.
_STUDY_COLUMNS = (
    ("ttc_ge_3", "TTC>=3", ".3f"),
    ("ttc_p10", "TTC p10", ".1f"),
    ("btn_le_1", "BTN<=1", ".3f"),
    ("stn_le_1", "STN<=1", ".3f"),
    ("mean_speed", "m/s", ".2f"),
    ("mean_abs_acceleration", "|a|", ".2f"),
    ("intervention_percent", "interv.", ".1f"),
)
_WIDE = 110  # columns of a terminal in which the intervals have room
# What is left out of a narrow terminal first, so that names stay whole; table.csv has it all.
_DISPENSABLE = ("ttc_p10", "stn_le_1", "btn_le_1", "intervention_percent", "mean_abs_acceleration", "ttc_ge_3")


def show_study(study: Any) -> None:
    """Print a study's table: ours, its 95 % interval where the terminal is wide enough, and the paper's number.

    The paper's stands only beside its own stacks in its own traffic. Names are never broken; where there is no room for
    all metrics, some are left out.

    Args:
        study: a `study.study.Study`.
    """
    shown = [key for key, _, _ in _STUDY_COLUMNS]
    table = _study_table(study, shown)
    for key in _DISPENSABLE:
        if table.__rich_measure__(results, results.options.update(width=_UNBOUNDED)).maximum <= results.width:
            break
        shown.remove(key)
        table = _study_table(study, shown)
    results.print(table)
    if len(shown) < len(_STUDY_COLUMNS):
        results.print("[dim]more metrics than have room here are in table.csv[/dim]")
    for failure in study.failures:
        messages.print(f"missing: {failure.stack}, seed {failure.seed}: {failure.reason} (log: {failure.log})")
    results.print(f"Everything is in [bold]{study.folder}[/bold]")


_UNBOUNDED = 10_000  # columns, to measure a table in


def _study_table(study: Any, metrics: Sequence[str]) -> Table:
    wide = results.width >= _WIDE
    factors = list(study.table.columns[: study.table.columns.get_loc("episodes")])
    paper = {tuple(row[name] for name in factors): row for row in study.comparison.to_dict("records")}
    columns = [column for column in _STUDY_COLUMNS if column[0] in metrics and column[0] in study.table]
    table = Table(title=_study_legend(study, wide), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("stack", no_wrap=True)
    for heading in [*(heading for _, heading, _ in columns), "crashed"]:
        table.add_column(heading, justify="right")
    varying = [name for name in factors[:-3] if study.table[name].nunique() > 1]
    for row in study.table.to_dict("records"):
        row_paper = paper.get(tuple(row[name] for name in factors))
        cells = [_study_cell(row, row_paper, key, form, wide) for key, _, form in columns]
        crashed = "–" if row["episodes"] == 0 else f"{row['collision_episodes']:.0f} of {row['episodes']}"
        table.add_row(_row_name(row, varying), *cells, crashed)
    return table


def _study_legend(study: Any, wide: bool) -> str:
    parts = [", ".join(dict.fromkeys(study.table["scenario"])) + ": ours"]
    parts += ["its 95 % interval over episodes"] if wide else []
    if len(study.comparison):
        parts.append("and the paper's below")
    return escape(", ".join(parts))


def _row_name(row: Mapping[str, Any], varying: Sequence[str]) -> str:
    """Return a row's stack, and on lines of their own what else tells it from the others."""
    stack = "-".join(str(row[name]) for name in ("planner", "filter", "scheme") if row[name] != "-")
    others = [str(row[name]) if name == "scenario" else f"{name}={row[name]}" for name in varying]
    return escape("\n".join([stack, *others]))


def _study_cell(ours: Mapping[str, Any], paper: Mapping[str, Any] | None, key: str, form: str, wide: bool) -> str:
    if math.isnan(ours[key]):
        return "–"
    lines = [f"{ours[key]:{form}}"]
    if wide:
        lines.append(f"{ours[f'{key}_lo']:{form}}–{ours[f'{key}_hi']:{form}}")
    if paper is not None:
        lines.append(f"[dim]{paper[f'{key}_paper']:{form}}[/dim]")
    return "\n".join(lines)
