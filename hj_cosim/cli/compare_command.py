"""`hj-cosim compare`: runs and studies side by side."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from hj_cosim.cli.app import Json, app, example
from hj_cosim.cli.console import print_json, results, show_place
from hj_cosim.metrics.catalogue import METRICS


@app.command(
    epilog=example("hj-cosim compare runs/paper-hjop-spc-mi-0 runs/paper-op-none-0", "hj-cosim compare STUDY STUDY")
)
def compare(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR DIR...", help="Two to six, of runs and of studies.")],
    out: Annotated[Path | None, typer.Option(help="The folder to write; a new one in runs/ by default.")] = None,
    as_json: Json = False,
) -> None:
    """Lay runs and studies side by side: metrics and differences, time lines on one axis, replays in step.

    Differences are each one's less the first one's, on the seeds that both have, with 95 % intervals over episodes.
    """
    from hj_cosim.study.comparison_folder import compare as compare_folders

    done = compare_folders(folders, out)
    if as_json:
        shown = [str(path) for path in done.shown]
        print_json({"folder": str(done.folder), "rows": done.table.to_dict("records"), "shown": shown})
        return
    for group in done.groups:
        results.print(_table(group.title, done.table[done.table["compared"] == group.title].to_dict("records")))
    if not done.shown:
        results.print("[dim]no time lines or replays: the studies kept the robot alone[/dim]")
    show_place(done.folder)


def _table(title: str, rows: list[dict[str, Any]]) -> Table:
    """Return the metrics that a run's table shows, a line each, with a column for each side."""
    sides = {row["side"]: row["episodes"] for row in rows}
    table = Table(title=escape(title), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("what", overflow="fold")
    for side, episodes in sides.items():
        heading = f"{side}\n{episodes} episodes" if episodes > 1 else side
        table.add_column(escape(heading), justify="right", overflow="fold")
    cells = {(row["side"], row["metric"]): row for row in rows}
    for metric in METRICS.values():
        own = [cells.get((side, metric.name)) for side in sides]
        if metric.shown in ("study", "run") and any(own):
            table.add_row(metric.label_with_unit, *(_cell(cell, metric) for cell in own))
    return table


def _cell(cell: dict[str, Any] | None, metric: Any) -> str:
    """Return a side's value, and below it by how much it exceeds the first side's."""
    if cell is None:
        return "–"
    lines = [metric.text(cell["value"])]
    difference = cell.get("difference", math.nan)
    if math.isfinite(difference):
        text = f"{'+' if difference > 0 else ''}{metric.text(difference)}"
        low, high = cell.get("difference_lo", math.nan), cell.get("difference_hi", math.nan)
        if math.isfinite(low) and math.isfinite(high):
            text += f" {escape('[')}{metric.text(low)}, {metric.text(high)}]"
        lines.append(f"[dim]{text}[/dim]")
    return "\n".join(lines)
