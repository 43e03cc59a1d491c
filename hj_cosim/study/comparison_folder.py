"""A comparison on disk: comparison.csv, time lines, and a page with replays in step."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import pandas as pd

from hj_cosim.analysis.comparison_page import ComparedRows, comparison_page
from hj_cosim.analysis.figures.side_by_side import side_by_side
from hj_cosim.analysis.figures.style import save_drawing
from hj_cosim.locations import given_path
from hj_cosim.recording.run_folder import new_folder, read_run, require_free_folder, whole_folder
from hj_cosim.recording.trajectories import TRAJECTORIES
from hj_cosim.study.comparison import Group, differing_settings, groups_of, shown_runs
from hj_cosim.study.tables import write_csv

COMPARISON_TABLE = "comparison.csv"
TIMELINES = "timelines"
PAGE = "comparison.html"


@dataclass(frozen=True)
class Comparison:
    """Runs and studies side by side; SI units."""

    folder: Path
    groups: tuple[Group, ...]  # rows that belong together
    table: pd.DataFrame  # comparison.csv: a row per metric and side, see `study.comparison.Group.table`
    shown: tuple[Path, ...]  # the runs on the page; none where the cars were not kept


def compare(folders: Sequence[PathLike[str] | str], out: PathLike[str] | str | None = None) -> Comparison:
    """Lay runs and studies side by side, and write what comes of it; this is what `hj-cosim compare` does.

    Intervals are bootstrap intervals over episodes (Efron & Tibshirani 1993), paired on the seeds that both sides have.

    Args:
        folders: two to six, of runs and of studies.
        out: the folder to write; a new one in runs/ unless given.

    Raises:
        ConfigurationError: if there are too few or too many, or nothing in them belongs together.
        RunFolderError: if one holds neither a run nor a study, or `out` already holds something.
        TableError: if the value table of a run that is shown cannot be had.
    """
    groups = groups_of(folders)
    target = _new_folder(folders) if out is None else given_path(out, "out")
    require_free_folder(target)
    rows = [ComparedRows(group.title, group.table(), differing_settings(group)) for group in groups]
    table = pd.concat([row.table for row in rows], ignore_index=True)
    chosen = shown_runs(groups)
    kept = {label: path for label, path in chosen.items() if (path / TRAJECTORIES).is_file()}
    runs = {label: read_run(path) for label, path in kept.items()}
    drawing = side_by_side(runs) if runs else None
    text = comparison_page(rows, runs, drawing)
    with whole_folder(target) as temporary:
        write_csv(table, temporary / COMPARISON_TABLE)
        if drawing is not None:
            save_drawing(drawing, temporary / TIMELINES)
        (temporary / PAGE).write_text(text, encoding="utf-8")
    return Comparison(target, tuple(groups), table, tuple(kept.values()))


def _new_folder(folders: Sequence[PathLike[str] | str]) -> Path:
    """Return a folder that does not exist yet, in runs/, named for what is compared."""
    return new_folder("-".join(["compare", *(Path(folder).name for folder in folders)]))
