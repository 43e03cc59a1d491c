"""A study's table in the terminal; which metrics, and how, their declarations say."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from hj_cosim.cli.console import messages, results, show_place
from hj_cosim.metrics.catalogue import shown_in_study
from hj_cosim.metrics.declaration import EpisodesWith, Metric

_WIDE = 110  # columns of a terminal in which the intervals have room
_UNBOUNDED = 10_000  # columns, to measure a table in


def show_study(study: Any) -> None:
    """Print a study's table: ours, its 95 % interval where the terminal is wide enough, and the paper's number.

    The paper's stands only beside its own stacks in its own traffic. Names are never broken; where there is no room for
    all metrics, some are left out.

    Args:
        study: a `study.study.Study`.
    """
    metrics = [metric for metric in shown_in_study() if metric.name in study.table]
    shown = metrics
    table = _study_table(study, shown)
    for dispensable in sorted(metrics, key=lambda metric: -metric.leaves_first):
        if not dispensable.leaves_first or _full_width(table) <= results.width:
            break
        shown = [metric for metric in shown if metric != dispensable]
        table = _study_table(study, shown)
    results.print(table)
    if len(shown) < len(metrics):
        results.print("[dim]more metrics than have room here are in table.csv[/dim]")
    for failure in study.failures:
        messages.print(f"missing: {failure.stack}, seed {failure.seed}: {failure.reason} (log: {failure.log})")
    show_place(study.folder)


def _full_width(table: Table) -> int:
    """Return how many columns of a terminal a table takes where nothing in it is broken."""
    return table.__rich_measure__(results, results.options.update(width=_UNBOUNDED)).maximum


def _study_table(study: Any, metrics: Sequence[Metric]) -> Table:
    wide = results.width >= _WIDE
    factors = list(study.table.columns[: study.table.columns.get_loc("episodes")])
    paper = {tuple(row[name] for name in factors): row for row in study.comparison.to_dict("records")}
    table = Table(title=_study_legend(study, wide), box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("stack", no_wrap=True)
    for metric in metrics:
        table.add_column(metric.heading, justify="right")
    varying = [name for name in factors[:-3] if study.table[name].nunique() > 1]
    for row in study.table.to_dict("records"):
        row_paper = paper.get(tuple(row[name] for name in factors))
        cells = [_study_cell(row, row_paper, metric, wide) for metric in metrics]
        table.add_row(_row_name(row, varying), *cells)
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


def _study_cell(ours: Mapping[str, Any], paper: Mapping[str, Any] | None, metric: Metric, wide: bool) -> str:
    name = metric.name
    if isinstance(metric.pooling, EpisodesWith):
        return f"{metric.text(ours[name])} of {ours['episodes']}" if ours["episodes"] else metric.text(None)
    lines = [metric.text(ours[name])]
    if wide and math.isfinite(ours[name]):
        lines.append(f"{metric.text(ours[f'{name}_lo'])} to {metric.text(ours[f'{name}_hi'])}")
    if paper is not None and f"{name}_paper" in paper:
        lines.append(f"[dim]{metric.text(paper[f'{name}_paper'])}[/dim]")
    return "\n".join(lines)
