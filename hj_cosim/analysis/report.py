"""A run or a study as one HTML file that needs nothing else: no network, no other file, any browser.

Everything that comes from a run (names, configuration, numbers) is escaped, and the page's policy forbids it to load
anything from anywhere.
"""

from collections.abc import Callable
from html import escape
from pathlib import Path

from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.run_table import table_of
from hj_cosim.analysis.html import figure, label, meaning, page, replay_parts, toml, value_text
from hj_cosim.analysis.plan_path import tracking_of
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.analysis.study_page import study_page
from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import ROBOT, Run, read_run
from hj_cosim.recording.study_files import STUDY, TABLE, require_not_ours

REPORT = "report.html"
ENDINGS = (".html", ".htm")
RUN_FIGURES = {
    "timeline": "Speed, value, TTC and lane over time.",
    "snapshots": "The drive from above.",
    "highway": "The moment of the least value.",
    "value-along-drive": "The values of the cars around the robot, and where they are.",
    "control-sets": "The safe controls of SPC and RSS at the moment with the most constraints.",
}

Progress = Callable[[int, int], None]


def write_report(
    folder: Path,
    out: Path | None = None,
    table: ValueTable | None = None,
    progress: Progress | None = None,
    *,
    replays: bool = True,
) -> Path:
    """Write the report of a run or of a study.

    Args:
        folder: of a run or a study.
        out: the HTML file; `report.html` in the folder unless given.
        table: V for a run's values; the table that the run was driven with unless given.
        progress: called with the figures, of a study the replays, made and in all.
        replays: whether a replay of every episode of a study is written into the episode's folder.

    Returns:
        The file.

    Raises:
        OutputError: if the file's ending is another than HTML's.
        RunFolderError: if the folder holds neither a run nor a study, or a broken one, or the file belongs to one.
        TableError: if the run's table cannot be had.
        HjCosimError: if the file cannot be written.
    """
    report = progress or (lambda done, total: None)
    target = out or folder / REPORT
    require_not_ours(target)
    if target.suffix.lower() not in ENDINGS:
        raise OutputError(f"cannot write {target}: a report ends in .html or .htm")
    if (folder / ROBOT).exists():
        run = read_run(folder)
        text = run_page(run, table or table_of(run), report)
    elif (folder / TABLE).exists() or (folder / STUDY).exists():
        text = study_page(folder, target.absolute().parent, report, replays=replays)
    else:
        raise RunFolderError(f"{folder} holds neither a run nor a study; give the folder that one of them wrote")
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
    replay, *scripts = replay_parts(replay_data(run.record, table, tracking_of(run)))
    return page(
        title,
        [
            replay,
            f'<h2>Summary</h2><div class="pairs" id="summary">{pairs}</div>',
            "<h2>Figures</h2>",
            *figures,
            f"<h2>Configuration</h2><details><summary>config.toml</summary><pre>{escape(toml(run.config))}</pre></details>",
            *scripts,
        ],
    )
