"""A run or a study as one HTML file that needs nothing else: no network, no other file, any browser.

Everything that comes from a run (names, configuration, numbers) is escaped, and the page's policy forbids it to load
anything from anywhere.
"""

import json
from collections.abc import Callable
from html import escape
from pathlib import Path

import pandas as pd

from hj_cosim.analysis.figures.gallery import TEXT_COLUMNS, draw_figure, read_study_table, table_of
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.html import (
    figure,
    html_table,
    in_script,
    label,
    meaning,
    page,
    resource,
    shown,
    toml,
    value_text,
)
from hj_cosim.analysis.plan_path import tracking_of
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.errors import RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import ROBOT, Run, read_run, require_not_own_file
from hj_cosim.recording.study_files import COMPARISON, STUDY, TABLE, study_progress

REPORT = "report.html"
RUN_FIGURES = {
    "timeline": "Speed, value, TTC and lane over time.",
    "snapshots": "The drive from above.",
    "highway": "The moment of the least value.",
    "value-along-drive": "The values of the cars around the robot, and where they are.",
    "control-sets": "The safe controls of SPC and RSS at the moment with the most constraints.",
}

Progress = Callable[[int, int], None]


def write_report(
    folder: Path, out: Path | None = None, table: ValueTable | None = None, progress: Progress | None = None
) -> Path:
    """Write the report of a run or of a study.

    Args:
        folder: of a run or a study.
        out: the HTML file; `report.html` in the folder unless given.
        table: V for a run's values; the table that the run was driven with unless given.
        progress: called with the figures drawn and the figures in all.

    Returns:
        The file.

    Raises:
        RunFolderError: if the folder holds neither a run nor a study, or a broken one.
        TableError: if the run's table cannot be had.
        HjCosimError: if the file cannot be written.
    """
    report = progress or (lambda done, total: None)
    if (folder / ROBOT).exists():
        run = read_run(folder)
        text = run_page(run, table or table_of(run), report)
    elif (folder / TABLE).exists() or (folder / STUDY).exists():
        text = study_page(folder, report)
    else:
        raise RunFolderError(f"{folder} holds neither a run nor a study; give the folder that one of them wrote")
    target = out or folder / REPORT
    require_not_own_file(target)
    with whole_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


def run_page(run: Run, table: ValueTable, progress: Progress) -> str:
    """Return the HTML of a run's report."""
    summary = run.summary
    title = f"{summary['scenario']}, {summary['planner']} + {summary['filter']}, seed {summary['seed']}"
    pairs = "".join(
        f'<div title="{escape(meaning(key))}"><span>{escape(label(key))}</span>'
        f" <b>{escape(value_text(key, value))}</b></div>"
        for key, value in summary.items()
    )
    figures = []
    for done, (name, caption) in enumerate(RUN_FIGURES.items(), start=1):
        figures.append(figure(draw_figure(name, run=run.folder, table=table), caption))
        progress(done, len(RUN_FIGURES))
    data = json.dumps(replay_data(run.record, table, tracking_of(run)), allow_nan=False)
    return page(
        title,
        [
            resource("replay.html"),
            f'<h2>Summary</h2><div class="pairs" id="summary">{pairs}</div>',
            "<h2>Figures</h2>",
            *figures,
            f"<h2>Configuration</h2><details><summary>config.toml</summary><pre>{escape(toml(run.config))}</pre></details>",
            f'<script type="application/json" id="run">{in_script(data)}</script>',
            f"<script>{resource('replay.js')}</script>",
        ],
    )


def study_page(folder: Path, progress: Progress) -> str:
    """Return the HTML of a study's report."""
    state = study_progress(folder) if (folder / STUDY).exists() else None
    unfinished = (
        f"<p>The study is unfinished: {state.text} are there, and"
        f" <code>hj-cosim study --resume --out {escape(str(folder))}</code> goes on with it.</p>"
        if state is not None and state.is_unfinished
        else ""
    )
    if not (folder / TABLE).exists():
        return page(f"Study {folder.name}", [unfinished])
    table = read_study_table(folder / TABLE, TEXT_COLUMNS)
    figures = {"trade-off": "Safety over performance in windows of ten seconds."}
    if table.scenario.nunique() > 1:
        figures["density-sweep"] = "What denser traffic does."
    drawn = []
    for done, (name, caption) in enumerate(figures.items(), start=1):
        drawn.append(figure(draw_figure(name, study=folder), caption))
        progress(done, len(figures))
    missing = int(table["missing"].sum()) if "missing" in table else 0
    parts = [
        unfinished,
        "<h2>Table</h2><p class='note'>Each metric with its 95 % bootstrap interval over episodes.</p>",
        _intervals_table(table),
        f"<p>{missing} episodes are missing: they failed.</p>" if missing else "",
    ]
    if (folder / COMPARISON).exists() and len(comparison := read_study_table(folder / COMPARISON, STACK_COLUMNS)):
        parts += ["<h2>Beside the paper</h2>", _intervals_table(comparison)]
    return page(f"Study {folder.name}", [*parts, "<h2>Figures</h2>", *drawn])


def _intervals_table(table: pd.DataFrame) -> str:
    """Return a study's table as HTML, each metric with its interval in one cell, and the paper's number beside it."""
    metrics = [name for name in table.columns if f"{name}_lo" in table.columns]
    own = [name for name in table.columns if not any(name.startswith(metric) for metric in metrics)]
    columns: dict[str, list[str]] = {name: [shown(value) for value in table[name]] for name in own}
    for metric in metrics:
        bounds = zip(table[metric], table[f"{metric}_lo"], table[f"{metric}_hi"], strict=True)
        columns[label(metric)] = [
            f"{value_text(metric, value)} [{value_text(metric, low)}, {value_text(metric, high)}]"
            for value, low, high in bounds
        ]
        if f"{metric}_paper" in table:
            columns[f"{label(metric)}, paper"] = [value_text(metric, value) for value in table[f"{metric}_paper"]]
    return html_table(list(columns), zip(*columns.values(), strict=True))
