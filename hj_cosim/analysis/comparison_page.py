"""The page about runs and studies side by side: metrics, settings that differ, time lines, and replays in step."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import pandas as pd

from hj_cosim.analysis.figures.run_table import table_of
from hj_cosim.analysis.figures.side_by_side import LOOKS
from hj_cosim.analysis.figures.style import Drawing
from hj_cosim.analysis.html import figure, html_table, label, page, replay_parts, resource, table_region, value_text
from hj_cosim.analysis.plan_path import tracking_of
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.metrics.catalogue import METRICS
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run


@dataclass(frozen=True)
class ComparedRows:
    """What is told of rows that are compared with the first of them."""

    title: str
    table: pd.DataFrame  # as study.comparison.Group.table has it
    settings: Sequence[tuple[str, Sequence[str]]]  # that differ, with the value on each side


def comparison_page(
    rows: Sequence[ComparedRows],
    runs: Mapping[str, Run],
    drawing: Drawing | None,
    tables: Mapping[str, ValueTable] | None = None,
) -> str:
    """Return the HTML of a comparison.

    Args:
        rows: what is compared.
        runs: to be looked at, by their labels; those whose cars were not kept are left out.
        drawing: their time lines; None if there are none.
        tables: V of each run; the tables that they were driven with unless given.

    Raises:
        TableError: if a run's table cannot be had.
    """
    parts = [part for row in rows for part in _row(row)]
    if drawing is not None:
        seeds = ", ".join(f"{name}: seed {run.summary['seed']}" for name, run in runs.items())
        parts = [*_replays(runs, tables or {}), "<h2>Time lines</h2>", figure(drawing, seeds), *parts]
    names = list(dict.fromkeys(side for row in rows for side in row.table["side"]))
    return page(" beside ".join(names), parts)


def _row(row: ComparedRows) -> Iterator[str]:
    yield f"<h2>{escape(row.title or 'Metrics')}</h2>"
    if row.settings:
        names = list(dict.fromkeys(row.table["side"]))
        yield "<h3>Settings that differ</h3>"
        cells = ([escape(name).replace(".", ".<wbr>"), *map(escape, values)] for name, values in row.settings)
        yield f'<div class="settings">{table_region(["setting", *map(escape, names)], cells, "settings")}</div>'
    first = row.table["side"].iloc[0]
    yield (
        f"<p class='note'>Differences are each side's less {escape(first)}; in brackets 95 % bootstrap intervals over"
        " episodes, paired on the seeds that both have.</p>"
    )
    shown = [name for name in dict.fromkeys(row.table["metric"]) if METRICS[name].shown in ("study", "run")]
    others = [name for name in dict.fromkeys(row.table["metric"]) if name not in shown]
    yield metric_table(row.table, shown)
    yield f"<details><summary>all other metrics</summary>{metric_table(row.table, others)}</details>"


def metric_table(table: pd.DataFrame, metrics: Sequence[str]) -> str:
    """Return some metrics as HTML, a line each: every side's value, and its difference from the first side's."""
    sides = list(dict.fromkeys(table["side"]))
    head = ["metric", sides[0], *(text for side in sides[1:] for text in (side, f"{side}, difference"))]
    cells = {(row["side"], row["metric"]): row for row in table.to_dict("records")}
    lines = []
    for metric in metrics:
        line = [label(metric), _estimate(cells.get((sides[0], metric)), "value")]
        for side in sides[1:]:
            cell = cells.get((side, metric))
            line += [_estimate(cell, "value"), _estimate(cell, "difference")]
        lines.append(line)
    return html_table(head, lines, "metrics side by side")


def _estimate(cell: Mapping[str, object] | None, name: str) -> str:
    """Return a value or a difference with its interval, or a dash."""
    value = None if cell is None else cell.get(name)
    if cell is None or not isinstance(value, float):
        return "–"
    metric = str(cell["metric"])
    bounds = [cell.get(f"{name}{end}") for end in ("_lo", "_hi")]
    text = value_text(metric, value)
    if name == "difference" and value > 0.0 and text != "–":
        text = f"+{text}"
    if any(not isinstance(bound, float) or pd.isna(bound) for bound in bounds):
        return text
    return f"{text} [{', '.join(value_text(metric, bound) for bound in bounds)}]"


def _replays(runs: Mapping[str, Run], tables: Mapping[str, ValueTable]) -> Iterator[str]:
    """Yield the controls, then a frame for each run; one script moves all of them."""
    yield resource("in_step.html")
    for (name, run), (colour, _) in zip(runs.items(), LOOKS, strict=False):
        data = replay_data(run.record, tables.get(name) or table_of(run), tracking_of(run))
        document = page(
            name,
            replay_parts(data),
            "embedded",
        )
        yield (
            f'<section class="side"><h3 style="border-color:{colour}">{escape(name)}</h3>'
            f'<iframe title="replay of {escape(name)}" data-rate="{data["samplesPerSecond"]}"'
            f' srcdoc="{escape(document)}"></iframe></section>'
        )
    yield f"<script>{resource('in_step.js')}</script>"
