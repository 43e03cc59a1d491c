"""The episodes of a study as its page lists them: which row each belongs to, how it went, and a replay of it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hj_cosim.analysis.figures.run_table import table_of
from hj_cosim.analysis.figures.stacks import varying_factors
from hj_cosim.analysis.html import page, replay_parts
from hj_cosim.analysis.plan_path import tracking_of
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.errors import RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import SUMMARY, read_config, read_run
from hj_cosim.recording.study_files import EPISODES
from hj_cosim.recording.summary_file import read_summary
from hj_cosim.recording.trajectories import TRAJECTORIES

REPLAY = "replay.html"
REPLAY_BYTES = 400_000  # of the cars in one; a study has hundreds
_UNVARIED = ("scenario", "planner", "filter", "scheme")

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class StudyEpisode:
    """One episode of a study."""

    row: int  # of the study's table
    seed: int
    folder: Path
    summary: Mapping[str, Any]

    @property
    def crashed(self) -> bool:
        """Whether the robot's body overlapped another's."""
        collisions = self.summary.get("collisions")
        return isinstance(collisions, int | float) and collisions > 0

    @property
    def has_cars(self) -> bool:
        """Whether what the other cars did was kept, so that it can be replayed."""
        return (self.folder / TRAJECTORIES).is_file()


def study_episodes(study: Path, table: pd.DataFrame) -> list[StudyEpisode]:
    """Return the episodes that belong to a row of a study's table, by row and seed.

    Raises:
        RunFolderError: if an episode's folder is broken.
    """
    rows = table.to_dict("records")
    varied = [name for name in varying_factors(table) if name not in _UNVARIED]
    found = [
        StudyEpisode(row, int(summary["seed"]), folder, summary)
        for folder, summary in _folders(study)
        if (row := _row_of(summary, read_config(folder) if varied else {}, rows, varied)) is not None
    ]
    return sorted(found, key=lambda episode: (episode.row, episode.seed))


def _folders(study: Path) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    for path in sorted((study / EPISODES).glob(f"**/{SUMMARY}")):
        if any(part.startswith(".") for part in path.relative_to(study).parts):
            continue  # what is being written
        try:
            summary = read_summary(path)
            int(summary["seed"])
        except (OSError, ValueError, TypeError) as error:
            raise RunFolderError(f"{path.parent} holds no readable run: {error}") from error
        yield path.parent, summary


def _row_of(
    summary: Mapping[str, Any], config: Mapping[str, Any], rows: Sequence[Mapping[Any, Any]], varied: Sequence[str]
) -> int | None:
    """Return the row of the table that an episode belongs to; None if it belongs to none."""
    for number, row in enumerate(rows):
        names = [name for name in _UNVARIED if not (name == "scheme" and row[name] == "-")]
        if all(str(row[name]) == str(summary[name]) for name in names) and all(
            _is_same(row[key], _setting(config, key)) for key in varied
        ):
            return number
    return None


def _setting(config: Mapping[str, Any], key: str) -> Any:
    value: Any = config
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def _is_same(one: Any, other: Any) -> bool:
    """Return whether a table's cell is a setting's value: 1.0 is 1, and True is "True"."""
    return bool(one == other) or str(one).lower() == str(other).lower()


def write_replays(episodes: Sequence[StudyEpisode], progress: Progress) -> None:
    """Write the replay of every episode whose cars were kept into its folder.

    Args:
        episodes: of one study.
        progress: called with the replays written and the replays in all.

    Raises:
        RunFolderError: if an episode's folder is broken.
        TableError: if a value table cannot be had.
        HjCosimError: if a file cannot be written.
    """
    tables: dict[str, ValueTable] = {}
    shown = [episode for episode in episodes if episode.has_cars]
    for done, episode in enumerate(shown, start=1):
        run = read_run(episode.folder)
        key = f"{run.config['table']} {run.config['robot']}"
        table = tables.setdefault(key, tables[key] if key in tables else table_of(run))
        data = replay_data(run.record, table, tracking_of(run), REPLAY_BYTES)
        name = "-".join(str(run.summary[part]) for part in ("planner", "filter", "scheme"))
        title = f"{run.summary['scenario']}, {name}, seed {episode.seed}"
        with whole_file(episode.folder / REPLAY) as temporary:
            temporary.write_text(page(title, replay_parts(data)), encoding="utf-8")
        progress(done, len(shown))
