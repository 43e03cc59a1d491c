"""The tables that a study writes; the same episodes give the same bytes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import combinations
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from hj_cosim.files import whole_file
from hj_cosim.metrics.catalogue import shown_in_study
from hj_cosim.study.design import Cell
from hj_cosim.study.statistics import Estimate, RowStatistics

STACK_COLUMNS = ("planner", "filter", "scheme")


@dataclass(frozen=True)
class Row:
    """A row of the study's table."""

    cell: Cell
    statistics: RowStatistics
    missing: int  # episodes that failed


def study_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return table.csv's content: a row per cell, every metric with its interval in `_lo` and `_hi`."""
    return pd.DataFrame(
        {
            **row.cell.factors,
            "episodes": len(row.statistics.seeds),
            "missing": row.missing,
            **_columns(row.statistics.estimates()),
        }
        for row in rows
    )


def difference_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return differences.csv's content: every two rows that differ in one factor, first minus second, on common seeds.

    The first row's factors have their names, the second one's `other_` before them. A factor is the stack, the
    scenario, or a varied knob; rows that differ in more than one say nothing about either.
    """
    records = [
        _difference(first, second)
        for first, second in combinations(rows, 2)
        if _differing_factors(first.cell, second.cell) == 1
    ]
    factors = list(rows[0].cell.factors)
    return pd.DataFrame(records, columns=None if records else [*factors, *(f"other_{f}" for f in factors)])


def _difference(first: Row, second: Row) -> dict[str, Any]:
    seeds, differences = first.statistics.differences(second.statistics)
    other = {f"other_{name}": value for name, value in second.cell.factors.items()}
    return {**first.cell.factors, **other, "episodes": seeds, **_columns(differences)}


def _differing_factors(first: Cell, second: Cell) -> int:
    settings = zip(first.setting, second.setting, strict=True)
    pairs = [(first.stack, second.stack), (first.scenario, second.scenario), *settings]
    return sum(one != other for one, other in pairs)


def _columns(estimates: Mapping[str, Estimate]) -> dict[str, float]:
    columns: dict[str, float] = {}
    for name, estimate in estimates.items():
        columns |= {name: estimate.value, f"{name}_lo": estimate.low, f"{name}_hi": estimate.high}
    return columns


def paper_table() -> pd.DataFrame:
    """Return the paper's table of ten stacks, from its LaTeX source; 20 episodes of 30 s each."""
    with files("hj_cosim.study").joinpath("paper_table.csv").open(encoding="utf-8") as stream:
        return pd.read_csv(stream)


def comparison_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the paper's metrics of a study's rows, ours with its interval and the paper's beside it in `_paper`.

    Rows that the paper does not have are left out: other stacks, and other traffic than the paper's.
    """
    paper = paper_table()
    table = study_table(rows)
    metrics = [name for name in paper.columns if name not in STACK_COLUMNS and name in table.columns]
    factors = list(rows[0].cell.factors)
    of_paper = table[[row.cell.is_papers for row in rows]]
    merged = of_paper.merge(paper, on=list(STACK_COLUMNS), suffixes=("", "_paper"))
    columns = [f"{name}{ending}" for name in metrics for ending in ("", "_lo", "_hi", "_paper")]
    return merged[[*factors, "episodes", *columns]]


def notebook_table(table: pd.DataFrame) -> str:
    """Return a study's table as HTML, escaped: what tells the rows apart, and the metrics that a terminal shows."""
    factors = list(table.columns[: table.columns.get_loc("episodes") + 1])
    columns = {name: [str(value) for value in table[name]] for name in factors}
    for metric in shown_in_study():
        if metric.name in table:
            bounds = zip(*(table[f"{metric.name}{end}"] for end in ("", "_lo", "_hi")), strict=True)
            columns[metric.label_with_unit] = [
                f"{metric.text(value)} [{metric.text(low)}, {metric.text(high)}]" for value, low, high in bounds
            ]
    return str(pd.DataFrame(columns).to_html(index=False, border=0))


def write_csv(table: pd.DataFrame, path: Path) -> None:
    """Write a table as CSV, every number as exactly as it is; whole or not at all."""
    with whole_file(path) as temporary:
        table.to_csv(temporary, index=False, lineterminator="\n")


def write_parquet(records: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write records of the same keys as Parquet, whole or not at all; nothing in it tells when or where."""
    with whole_file(path) as temporary:
        pq.write_table(pa.Table.from_pylist(list(records)), temporary, compression="zstd")


def read_csv(path: Path) -> pd.DataFrame:
    """Return a table as `write_csv` wrote it; no name is taken for a missing number."""
    return pd.read_csv(path, keep_default_na=False, na_values=[""]).copy()  # in one piece: pandas makes one a column
