"""The page about a study: crashes first, then the chosen metrics, claims, paired differences, and all the rest."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pandas as pd

from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE
from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.of_study import TEXT_COLUMNS, read_study_table
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS, varying_factors
from hj_cosim.analysis.html import figure, label, meaning, page, resource, shown, table_region, value_text
from hj_cosim.analysis.study_episodes import REPLAY, StudyEpisode, study_episodes, write_replays
from hj_cosim.metrics.catalogue import METRICS, shown_in_study
from hj_cosim.metrics.declaration import EpisodesWith
from hj_cosim.recording.study_files import CLAIMS_TABLE, COMPARISON, DIFFERENCES, STUDY, TABLE, study_progress

CRASHED = "collision_episodes"

Progress = Callable[[int, int], None]


def study_page(folder: Path, place: Path, progress: Progress, *, replays: bool = True) -> str:
    """Return the HTML of a study's report.

    Args:
        folder: the study's.
        place: the folder that the page will be in, for its links.
        progress: called with the figures and replays made and those in all.
        replays: whether a replay of every episode whose cars were kept is written into its folder.

    Raises:
        RunFolderError: if one of its files is broken.
        TableError: if a value table that the replays need cannot be had.
    """
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
    episodes = study_episodes(folder, table)
    if replays:
        write_replays(episodes, progress)
    study = _StudyOnPage(table, episodes, place)
    figures = {"trade-off": "Safety over performance: 2D TTC over speed, with 95 % intervals."}
    if table.scenario.nunique() > 1:
        figures["density-sweep"] = "What denser traffic does."
    if len([name for name in varying_factors(table) if name != "scenario"]) == 1:
        figures["sweep"] = "What the varied setting does."
    if {BEHAVIOUR, SHARE} <= set(table.columns):
        figures["attack"] = "What drivers who mean harm do."
    drawn = [figure(draw_figure(name, study=folder), caption) for name, caption in figures.items()]
    parts = [
        unfinished,
        *study.crashes(),
        *study.chosen(),
        *_claims(folder),
        *_differences(folder, study.metrics),
        "<h2>Figures</h2>",
        *drawn,
        *study.rows(),
        "<h2>Everything</h2>",
        _intervals_table(table, "every metric with its 95 % bootstrap interval over episodes"),
    ]
    if (folder / COMPARISON).exists() and len(comparison := read_study_table(folder / COMPARISON, STACK_COLUMNS)):
        parts += ["<h2>Beside the paper</h2>", _intervals_table(comparison, "ours with intervals, and the paper's")]
    return page(f"Study {folder.name}", [*parts, f"<script>{resource('study.js')}</script>"], "study")


class _StudyOnPage:
    """A study's table and episodes, as sections of HTML."""

    def __init__(self, table: pd.DataFrame, episodes: Sequence[StudyEpisode], place: Path) -> None:
        self._rows = table.to_dict("records")
        self._episodes = [[episode for episode in episodes if episode.row == row] for row in range(len(self._rows))]
        self._place = place
        self._missing = int(table["missing"].sum()) if "missing" in table else 0
        varying = varying_factors(table)
        self._names = [row_name(row, varying) for row in self._rows]
        chosen = sorted(shown_in_study(), key=lambda metric: metric.name != CRASHED)
        self.metrics = [metric.name for metric in chosen if metric.name in table]
        self._counted = {metric.name for metric in chosen if isinstance(metric.pooling, EpisodesWith)}

    def crashes(self) -> Iterator[str]:
        """Yield which rows crashed how often, the worst first, with the seeds."""
        yield "<h2>Crashes</h2>"
        counts = [row.get(CRASHED) or 0 for row in self._rows]
        crashed = [number for number in sorted(range(len(counts)), key=lambda n: -counts[n]) if counts[number] > 0]
        lines = [
            f'<li><a href="#row-{number}" {_sorted_by(CRASHED)}><b>{counts[number]:g} of'
            f" {shown(self._rows[number]['episodes'])}</b> {escape(self._names[number])}</a>{self._seeds(number)}</li>"
            for number in crashed
        ]
        spared = [number for number in range(len(counts)) if number not in crashed]
        if spared:
            driven = sum(self._rows[number]["episodes"] for number in spared)
            names = "" if len(crashed) and len(spared) > 4 else f": {'; '.join(self._names[n] for n in spared)}"
            which = f"{'the other' if crashed else 'all'} {len(spared)} rows" if len(spared) > 1 else "one row"
            lines.append(f"<li><b>0 of {driven:g}</b> in {which}{escape(names)}</li>")
        yield f'<ul class="crashes">{"".join(lines)}</ul>'
        if self._missing:
            yield f"<p>{self._missing} episodes are missing: they failed.</p>"

    def _seeds(self, row: int) -> str:
        links = [self._link(episode) for episode in self._episodes[row] if episode.crashed]
        return f' <span class="seeds">seed {", ".join(links)}</span>' if links else ""

    def _link(self, episode: StudyEpisode) -> str:
        """Return an episode's seed, as a link to its replay where there is one."""
        replay = episode.folder / REPLAY
        if not replay.is_file():
            return str(episode.seed)
        address = quote(Path(os.path.relpath(replay.resolve(), self._place.resolve())).as_posix())
        return f'<a href="{escape(address)}">{episode.seed}</a>'

    def chosen(self) -> Iterator[str]:
        """Yield the table of the chosen metrics; every cell leads to its row's episodes."""
        yield "<h2>Chosen metrics</h2>"
        yield "<p class='note'>With 95 % intervals over episodes. A number leads to the episodes behind it.</p>"
        head = "".join(
            f'<th scope="col" role="columnheader" title="{escape(meaning(m))}">{escape(label(m))}</th>'
            for m in self.metrics
        )
        body = "".join(
            f'<tr role="row"><th scope="row" role="rowheader">{escape(name)}</th>'
            f"{''.join(self._cell(number, metric) for metric in self.metrics)}</tr>"
            for number, name in enumerate(self._names)
        )
        yield (  # roles, for a narrow window lays the table out as cards, which takes those of its elements away
            '<table class="chosen" role="table" aria-label="chosen metrics of every row"><thead role="rowgroup">'
            f'<tr role="row"><th scope="col" role="columnheader">row</th>{head}</tr></thead>'
            f'<tbody role="rowgroup">{body}</tbody></table>'
        )

    def _cell(self, number: int, metric: str) -> str:
        row = self._rows[number]
        bounds = [row.get(f"{metric}{end}") for end in ("_lo", "_hi")]
        if metric in self._counted:
            text, interval = f"{value_text(metric, row[metric])} of {shown(row['episodes'])}", ""
        else:
            text, interval = value_text(metric, row[metric]), " to ".join(value_text(metric, bound) for bound in bounds)
        return (
            f'<td role="cell" data-label="{escape(label(metric))}"><a href="#row-{number}" {_sorted_by(metric)}>'
            f'<b>{escape(text)}</b> <span class="interval">{escape(interval)}</span></a></td>'
        )

    def rows(self) -> Iterator[str]:
        """Yield the episodes of every row, those that crashed first."""
        yield "<h2>Episodes</h2>"
        columns = ["collisions", *(metric for metric in self.metrics if metric not in self._counted)]
        for number, name in enumerate(self._names):
            own = sorted(self._episodes[number], key=lambda episode: (not episode.crashed, episode.seed))
            lines = [
                [self._link(episode), *(escape(value_text(c, episode.summary.get(c))) for c in columns)]
                for episode in own
            ]
            head = ["seed (replay)", *(escape(label(column)) for column in columns)]
            content = (
                table_region(head, lines, f"episodes of {name}", keys=["seed", *columns])
                if lines
                else "<p>No episode's folder is here.</p>"
            )
            yield (
                f'<details class="episodes"><summary id="row-{number}">{escape(name)}: {len(own)} episodes</summary>'
                f"{content}</details>"
            )


def _sorted_by(metric: str) -> str:
    """Return the attributes of a link that opens a list of episodes sorted by a metric, the worst first."""
    key = "collisions" if metric == CRASHED else metric
    return f'data-metric="{key}" data-worst="{"lowest" if METRICS[key].better == "higher" else "highest"}"'


def row_name(row: Mapping[Any, Any], varying: Sequence[str]) -> str:
    """Return what tells a row from the others: its stack, and the scenario and knobs where they vary."""
    stack = "-".join(str(row[name]) for name in STACK_COLUMNS if row[name] != "-")
    others = [str(row[name]) if name == "scenario" else f"{name}={row[name]}" for name in varying]
    return ", ".join([stack, *others])


def _claims(folder: Path) -> Iterator[str]:
    """Yield the claims that the study checks, those that do not hold first."""
    if not (folder / CLAIMS_TABLE).exists():
        return
    claims = read_study_table(folder / CLAIMS_TABLE, ()).to_dict("records")
    if not claims:
        return
    yield "<h2>Claims</h2>"
    yield (
        "<p class='note'>A claim holds if the difference has the right sign, and is certain if its whole 95 % interval"
        " has.</p>"
    )
    order = ["does not hold", "holds, not certain", "holds"]
    judged = sorted(((_verdict(claim), claim) for claim in claims), key=lambda pair: order.index(pair[0]))
    lines = [
        [
            escape(_claim_text(str(claim.get("claim")))),
            f'<span class="verdict" data-verdict="{verdict}">{verdict}</span>',
            escape(f"{shown(claim.get('excess'))} [{shown(claim.get('excess_lo'))}, {shown(claim.get('excess_hi'))}]"),
        ]
        for verdict, claim in judged
    ]
    yield table_region(["claim", "verdict", "difference"], lines, "claims", kind="claims")


def _claim_text(claim: str) -> str:
    """Return a claim with its metric as it is called elsewhere on the page."""
    metric, separator, rest = claim.partition(" of ")
    return f"{label(metric)}{separator}{rest}"


def _verdict(claim: Mapping[Any, Any]) -> str:
    if str(claim.get("holds")) != "True":
        return "does not hold"
    return "holds" if str(claim.get("certain")) == "True" else "holds, not certain"


def _differences(folder: Path, metrics: Sequence[str]) -> Iterator[str]:
    """Yield the paired differences of every two rows that differ in one factor."""
    if not (folder / DIFFERENCES).exists():
        return
    table = read_study_table(folder / DIFFERENCES, ())
    known = [metric for metric in metrics if f"{metric}_lo" in table]
    if table.empty or not known or not set(STACK_COLUMNS) <= set(table):
        return
    factors = [name.removeprefix("other_") for name in table.columns if name.startswith("other_")]
    knobs = [name for name in factors if name not in STACK_COLUMNS]
    varying = [name for name in knobs if len({*table[name], *table[f"other_{name}"]}) > 1]
    lines = []
    for row in table.to_dict("records"):
        other = {name.removeprefix("other_"): value for name, value in row.items() if str(name).startswith("other_")}
        pair = [row_name(row, varying), row_name({**row, **other}, varying)]
        cells = [
            " ".join([value_text(m, row[m]), f"[{value_text(m, row[f'{m}_lo'])}, {value_text(m, row[f'{m}_hi'])}]"])
            for m in known
        ]
        lines.append([escape(" − ".join(pair)), escape(shown(row.get("episodes"))), *map(escape, cells)])
    head = ["first − second", "common seeds", *(escape(label(metric)) for metric in known)]
    yield "<h2>Paired differences</h2>"
    yield (
        f"<details><summary>{len(lines)} pairs of rows that differ in one factor, with 95 % intervals</summary>"
        f"{table_region(head, lines, 'paired differences')}</details>"
    )


def _intervals_table(table: pd.DataFrame, name: str) -> str:
    """Return a study's table as HTML, each metric with its interval in one cell, and the paper's number beside it."""
    metrics = [column for column in table.columns if f"{column}_lo" in table.columns]
    own = [column for column in table.columns if not any(column.startswith(metric) for metric in metrics)]
    varying = varying_factors(table)
    columns: dict[str, list[str]] = {"row": [row_name(row, varying) for row in table.to_dict("records")]}
    columns |= {column: [shown(value) for value in table[column]] for column in own}
    for metric in metrics:
        bounds = zip(table[metric], table[f"{metric}_lo"], table[f"{metric}_hi"], strict=True)
        columns[label(metric)] = [
            f"{value_text(metric, value)} [{value_text(metric, low)}, {value_text(metric, high)}]"
            for value, low, high in bounds
        ]
        if f"{metric}_paper" in table:
            columns[f"{label(metric)}, paper"] = [value_text(metric, value) for value in table[f"{metric}_paper"]]
    lines = [[escape(cell) for cell in line] for line in zip(*columns.values(), strict=True)]
    return table_region([escape(column) for column in columns], lines, name)
