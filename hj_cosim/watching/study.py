"""A study for the page that shows how it stands: which episodes run, and the table of what has been driven."""

import json
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hj_cosim.analysis.html import html_table, label, page, resource, value_text
from hj_cosim.recording.run_folder import SUMMARY
from hj_cosim.recording.summary_file import read_summary
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.jobs import EpisodeJob, Outcome
from hj_cosim.watching.server import WatchServer

SHOWN = ("collisions", "mean_speed", "ttc_2d_p1", "intervention_percent", "mean_abs_acceleration")


def study_page() -> str:
    """Return the HTML of the page; it shows what it is sent."""
    head = ["row", "driven", "failed", *(label(name) for name in SHOWN)]
    parts = [
        '<p class="note" id="watching" role="status">waiting for the study to begin</p>',
        "<h2>What runs</h2>",
        f'<div id="running">{html_table(["row", "seed", "since (s)"], [], "episodes that run")}</div>',
        "<h2>How it stands</h2>",
        f'<div id="standing">{html_table(head, [], "means of the episodes that are driven")}</div>',
        f"<script>{resource('watch_study.js')}</script>",
    ]
    return page("Study", parts, is_live=True)


@dataclass
class _Row:
    """What is known of a row so far."""

    name: str
    asked: int
    failed: int = 0
    summaries: list[dict[str, float]] = field(default_factory=list)

    def cells(self) -> list[str]:
        means = []
        for name in SHOWN:
            values = [one[name] for one in self.summaries if name in one]
            means.append(value_text(name, sum(values) / len(values)) if values else "–")
        return [self.name, f"{len(self.summaries)} of {self.asked}", str(self.failed), *means]


def _shown(folder: Path) -> dict[str, float]:
    """Return those of SHOWN that an episode has."""
    summary = read_summary(folder / SUMMARY)
    return {name: float(summary[name]) for name in SHOWN if isinstance(summary.get(name), int | float)}


class LiveStudy:
    """Tells a server how a study stands; any thread may call it."""

    def __init__(self, server: WatchServer) -> None:
        self._server = server
        self._lock = threading.Lock()
        self._rows: list[_Row] = []
        self._row_of: dict[object, _Row] = {}
        self._running: dict[object, tuple[str, int, float]] = {}

    def begun(self, folder: StudyFolder, jobs: Sequence[EpisodeJob]) -> None:
        """Take in what a study consists of, and what of it is still to be driven."""
        waiting = {job.folder for job in jobs}
        with self._lock:
            for cell in folder.design.cells:
                row = _Row(" ".join(map(str, cell.factors.values())), len(folder.design.seeds))
                self._rows.append(row)
                for seed in folder.design.seeds:
                    place = folder.run_folder(cell, seed)
                    self._row_of[place] = row
                    if place not in waiting:
                        row.summaries.append(_shown(place))
        self._tell()

    def started(self, job: EpisodeJob) -> None:
        """Note that a worker was handed a job."""
        with self._lock:
            self._running[job.folder] = (self._row_of[job.folder].name, job.config.seed, time.monotonic())
        self._tell()

    def ended(self, outcome: Outcome, is_driven: bool) -> None:
        """Note what became of a job."""
        with self._lock:
            row = self._row_of[outcome.job.folder]
            self._running.pop(outcome.job.folder, None)
            if is_driven:
                row.summaries.append(_shown(outcome.job.folder))
            else:
                row.failed += 1
        self._tell()

    def end(self, message: str) -> None:
        """Say that it is over."""
        self._server.publish("end", json.dumps(message))

    def _tell(self) -> None:
        with self._lock:
            now = time.monotonic()
            state = {
                "done": sum(len(row.summaries) for row in self._rows),
                "total": sum(row.asked for row in self._rows),
                "failed": sum(row.failed for row in self._rows),
                "running": [[name, str(seed), f"{now - since:.0f}"] for name, seed, since in self._running.values()],
                "rows": [row.cells() for row in self._rows],
            }
            self._server.publish("state", json.dumps(state))
