"""Runs and studies side by side: which rows belong together, and by how much each metric differs.

A run is a row with one episode. Rows are compared on the seeds that both have, in the same scenario (paired), else as
independent ones; an interval takes two episodes or more.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.locations import given_path
from hj_cosim.metrics.catalogue import METRICS
from hj_cosim.recording.run_folder import ROBOT, SUMMARY, read_config
from hj_cosim.recording.study_files import EPISODES
from hj_cosim.settings import flattened
from hj_cosim.study.results import read_result
from hj_cosim.study.statistics import Estimate, RowStatistics

FEWEST, MOST = 2, 6
_MOST_SETTINGS = 100  # that differ, and are told


@dataclass(frozen=True)
class Side:
    """One of those that are compared: a run, or a row of a study."""

    label: str
    key: tuple[str, str, str]  # scenario, varied knobs, stack: what tells the rows of a study apart
    runs: Mapping[int, Path]  # the run folder of each seed
    statistics: RowStatistics

    @property
    def first_run(self) -> Path:
        """The run folder of its first seed."""
        return next(iter(self.runs.values()))


@dataclass(frozen=True)
class Group:
    """Rows that are compared with the first of them."""

    title: str  # what they have in common; empty if nothing
    sides: tuple[Side, ...]

    def differences(self, side: Side) -> tuple[int, dict[str, Estimate]]:
        """Return by how much a side's metrics exceed the first one's, and on how many common seeds; 0 if unpaired."""
        first = self.sides[0]
        if first.key[0] == side.key[0]:
            pairs, paired = side.statistics.differences(first.statistics)
            if pairs:
                return pairs, paired
        return 0, side.statistics.independent_differences(first.statistics)

    def table(self) -> pd.DataFrame:
        """Return a row per metric and side, SI units.

        Columns: compared (the group's title), metric, unit, side, folder, episodes, value, value_lo, value_hi, and,
        but for the first side, pairs (common seeds, 0 where unpaired), difference (less the first side),
        difference_lo, difference_hi; intervals are 95 % bootstrap intervals over episodes.
        """
        records: list[dict[str, Any]] = []
        for number, side in enumerate(self.sides):
            pairs, differences = self.differences(side) if number else (0, {})
            for name, estimate in side.statistics.estimates().items():
                episodes = len(side.statistics.seeds)
                record: dict[str, Any] = {
                    "compared": self.title,
                    "metric": name,
                    "unit": METRICS[name].unit,
                    "side": side.label,
                }
                record |= {"folder": str(side.first_run.parent if len(side.runs) > 1 else side.first_run)}
                record |= {"episodes": episodes, **_columns("value", estimate, episodes)}
                if name in differences:
                    fewest = pairs or min(episodes, len(self.sides[0].statistics.seeds))
                    record |= {"pairs": pairs, **_columns("difference", differences[name], fewest)}
                records.append(record)
        return pd.DataFrame(records)


def _columns(name: str, estimate: Estimate, episodes: int) -> dict[str, float]:
    bounds = {f"{name}_lo": estimate.low, f"{name}_hi": estimate.high} if episodes > 1 else {}
    return {name: estimate.value, **bounds}


def groups_of(folders: Sequence[PathLike[str] | str]) -> list[Group]:
    """Return what is compared with what.

    Where every folder has one row, these are compared, whatever they are. Else rows of the same scenario, varied knobs
    and stack are.

    Args:
        folders: of runs and studies, FEWEST to MOST of them.

    Raises:
        ConfigurationError: if there are too few or too many, one is given twice, or no row is in two of them.
        RunFolderError: if one of them is neither a run nor a study with episodes.
    """
    if not FEWEST <= len(folders) <= MOST:
        raise ConfigurationError(f"{len(folders)} folders are given; {FEWEST} to {MOST} can be compared")
    paths = [given_path(folder, "what is compared") for folder in folders]
    if len({path.resolve() for path in paths}) < len(paths):
        raise ConfigurationError("a folder is given twice; compare each with others")
    are_distinct = len({path.name for path in paths}) == len(paths)
    rows = [list(_sides(path, path.name if are_distinct else str(path))) for path in paths]
    if all(len(own) == 1 for own in rows):
        alone = tuple(own[0] for own in rows)
        alike = len({side.key for side in alone}) == 1
        return [Group(_title(alone[0].key) if alike else "", alone)]
    by_key: dict[tuple[str, str, str], list[Side]] = {}
    for side in (side for own in rows for side in own):
        by_key.setdefault(side.key, []).append(side)
    groups = [Group(_title(key), tuple(sides)) for key, sides in by_key.items() if len(sides) > 1]
    if not groups:
        has = "; ".join(
            f"{path} has {', '.join(_title(side.key) for side in own)}" for path, own in zip(paths, rows, strict=True)
        )
        raise ConfigurationError(f"nothing can be compared, for no row is in two of them: {has}")
    return groups


def _sides(folder: Path, label: str) -> Iterator[Side]:
    """Yield the rows of a folder, a run's single one among them, in the order of their names."""
    if (folder / ROBOT).is_file():
        yield _side(label, [folder], "")
        return
    rows: dict[Path, list[Path]] = {}
    for path in sorted((folder / EPISODES).glob(f"**/{SUMMARY}")):
        if not any(part.startswith(".") for part in path.relative_to(folder).parts):
            rows.setdefault(path.parent.parent, []).append(path.parent)
    if not rows:
        raise RunFolderError(f"{folder} holds neither a run nor a study with episodes; give the folder that one wrote")
    for row, runs in rows.items():
        varied = [part for part in row.relative_to(folder / EPISODES).parts[:-1] if "=" in part]
        yield _side(label, runs, "".join(varied))


def _side(label: str, runs: Sequence[Path], setting: str) -> Side:
    results = {path: read_result(path)[0] for path in runs}
    summary = next(iter(results.values())).summary
    parts = [str(summary[name]) for name in ("planner", "filter", "scheme")]
    stack = "-".join(parts[:2] if parts[1] == "none" else parts)
    by_seed = dict(sorted((result.seed, path) for path, result in results.items()))
    return Side(label, (str(summary["scenario"]), setting, stack), by_seed, RowStatistics(list(results.values())))


def _title(key: tuple[str, str, str]) -> str:
    return ", ".join(part for part in key if part)


def differing_settings(group: Group) -> list[tuple[str, list[str]]]:
    """Return every setting that is not the same on all sides, as `--set` names it, with its value on each.

    Seeds are left out where there are several, and a scenario's description always.

    Raises:
        RunFolderError: if a configuration cannot be read.
    """
    flat = [dict(flattened(read_config(side.first_run))) for side in group.sides]
    names = dict.fromkeys(name for own in flat for name in own)
    names.pop("scenario.description", None)
    if any(len(side.runs) > 1 for side in group.sides):
        names.pop("seed", None)
    differing = [name for name in names if len({str(own.get(name)) for own in flat}) > 1]
    return [(name, [str(own.get(name, "–")) for own in flat]) for name in differing[:_MOST_SETTINGS]]


def shown_runs(groups: Sequence[Group]) -> dict[str, Path]:
    """Return a run of each side that is worth looking at, by the side's label.

    They are of a group and a seed where some crashed and others did not, else where the mean speeds are farthest apart;
    where no seed is common to all sides, of the first group's first ones.
    """
    found = (False, -1.0)
    chosen = {side.label: side.first_run for side in groups[0].sides}
    for group in groups:
        common = set.intersection(*(set(side.runs) for side in group.sides))
        for seed in sorted(common):
            summaries = [side.statistics.summary(seed) for side in group.sides]
            crashed = {summary["collisions"] > 0 for summary in summaries}
            speeds = [float(summary["mean_speed"]) for summary in summaries]
            rank = (len(crashed) == 2, max(speeds) - min(speeds))
            if rank > found:
                found, chosen = rank, {side.label: side.runs[seed] for side in group.sides}
    return chosen
