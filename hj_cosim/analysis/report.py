"""A run or a study as one HTML file that needs nothing else: no network, no other file, any browser.

Everything that comes from a run (names, configuration, numbers) is escaped, and the page's policy forbids it to load
anything from anywhere.
"""

import base64
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
import tomli_w

from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE
from hj_cosim.analysis.figures.gallery import TEXT_COLUMNS, draw_figure, read_study_table, table_of
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.figures.style import save_drawing
from hj_cosim.analysis.plan_path import tracking_of
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.errors import RunFolderError
from hj_cosim.files import temporary_folder, whole_file
from hj_cosim.metrics.catalogue import FACTS, METRICS
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
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"

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
        page = run_page(run, table or table_of(run), report)
    elif (folder / TABLE).exists() or (folder / STUDY).exists():
        page = study_page(folder, report)
    else:
        raise RunFolderError(f"{folder} holds neither a run nor a study; give the folder that one of them wrote")
    target = out or folder / REPORT
    require_not_own_file(target)
    with whole_file(target) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return target


def run_page(run: Run, table: ValueTable, progress: Progress) -> str:
    """Return the HTML of a run's report."""
    summary = run.summary
    title = f"{summary['scenario']}, {summary['planner']} + {summary['filter']}, seed {summary['seed']}"
    pairs = "".join(
        f'<div title="{escape(_meaning(key))}"><span>{escape(_label(key))}</span>'
        f" <b>{escape(_value(key, value))}</b></div>"
        for key, value in summary.items()
    )
    figures = []
    for done, (name, caption) in enumerate(RUN_FIGURES.items(), start=1):
        figures.append(_figure(name, caption, run=run.folder, table=table))
        progress(done, len(RUN_FIGURES))
    data = json.dumps(replay_data(run.record, table, tracking_of(run)), allow_nan=False)
    return _page(
        title,
        [
            _resource("replay.html"),
            f'<h2>Summary</h2><div class="pairs" id="summary">{pairs}</div>',
            "<h2>Figures</h2>",
            *figures,
            f"<h2>Configuration</h2><details><summary>config.toml</summary><pre>{escape(_toml(run.config))}</pre></details>",
            f'<script type="application/json" id="run">{_in_script(data)}</script>',
            f"<script>{_resource('replay.js')}</script>",
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
        return _page(f"Study {folder.name}", [unfinished])
    table = read_study_table(folder / TABLE, TEXT_COLUMNS)
    figures = {"trade-off": "Safety over performance in windows of ten seconds."}
    if table.scenario.nunique() > 1:
        figures["density-sweep"] = "What denser traffic does."
    if {BEHAVIOUR, SHARE} <= set(table.columns):
        figures["attack"] = "What drivers who mean harm do."
    drawn = []
    for done, (name, caption) in enumerate(figures.items(), start=1):
        drawn.append(_figure(name, caption, study=folder))
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
    return _page(f"Study {folder.name}", [*parts, "<h2>Figures</h2>", *drawn])


def _page(title: str, parts: Iterable[str]) -> str:
    body = "\n".join(part for part in parts if part)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{_resource('report.css')}</style></head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def _figure(name: str, caption: str, **source: Any) -> str:
    with temporary_folder() as folder:
        path = save_drawing(draw_figure(name, **source), folder / f"{name}.png")[0]
        picture = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{picture}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _resource(name: str) -> str:
    return files("hj_cosim.analysis").joinpath("page", name).read_text(encoding="utf-8")


def _in_script(document: str) -> str:
    """Return JSON that cannot end the script element that it stands in."""
    return document.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _toml(config: Mapping[str, Any]) -> str:
    return tomli_w.dumps(config)


def _label(key: str) -> str:
    """Return how a key of a summary is called; its own name if it is no metric of ours."""
    return METRICS[key].label_with_unit if key in METRICS else key


def _meaning(key: str) -> str:
    return METRICS[key].explanation if key in METRICS else next((f.explanation for f in FACTS if f.name == key), "")


def _value(key: str, value: Any) -> str:
    """Return a value as its metric is shown; a run from elsewhere may hold anything under a metric's name."""
    if key in METRICS and isinstance(value, int | float):
        return METRICS[key].text(value)
    return _shown(value)


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else "–"
    return "–" if value is None else str(value)


def _intervals_table(table: pd.DataFrame) -> str:
    """Return a study's table as HTML, each metric with its interval in one cell, and the paper's number beside it."""
    metrics = [name for name in table.columns if f"{name}_lo" in table.columns]
    own = [name for name in table.columns if not any(name.startswith(metric) for metric in metrics)]
    columns: dict[str, list[str]] = {name: [_shown(value) for value in table[name]] for name in own}
    for metric in metrics:
        bounds = zip(table[metric], table[f"{metric}_lo"], table[f"{metric}_hi"], strict=True)
        columns[_label(metric)] = [
            f"{_value(metric, value)} [{_value(metric, low)}, {_value(metric, high)}]" for value, low, high in bounds
        ]
        if f"{metric}_paper" in table:
            columns[f"{_label(metric)}, paper"] = [_value(metric, value) for value in table[f"{metric}_paper"]]
    return _html_table(list(columns), zip(*columns.values(), strict=True))


def _html_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    header = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{header}</tr></thead><tbody>{lines}</tbody></table></div>'
