"""A run that is driven again from its config.toml: what it takes over, and whether the same came of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.store import find_specification
from hj_cosim.recording.run_folder import CONFIG, DRIVERS, ROBOT, SUMMARY
from hj_cosim.recording.trajectories import TRAJECTORIES
from hj_cosim.recording.versions import changed_versions, read_versions
from hj_cosim.settings import read_toml, shown

COMPARED = (CONFIG, TRAJECTORIES, ROBOT, DRIVERS, SUMMARY)  # what is the same, byte for byte, when nothing changed


@dataclass(frozen=True)
class Repetition:
    """What became of a run that was driven again."""

    original: Path  # the first run's folder
    same: tuple[str, ...]  # files that are the same, byte for byte
    different: tuple[str, ...]  # files that are not
    versions: Mapping[str, tuple[str, str]]  # of what is another one than it was: then and now

    @property
    def is_exact(self) -> bool:
        """Whether every file that both have is the same."""
        return not self.different


def is_run_configuration(data: Mapping[str, Any]) -> bool:
    """Return whether the content of a TOML file is a run's config.toml rather than a scenario."""
    return isinstance(data.get("scenario"), Mapping) and "preset" in data


def require_nothing_foreign(data: Mapping[str, Any], given: Mapping[str, Any], path: Path) -> None:
    """Check that nothing is run because a run's folder says so, which may come from anybody.

    Args:
        data: the content of a run's config.toml.
        given: what the user says besides, nested likewise: what is named there may be run.
        path: the file, for the message.

    Raises:
        ConfigurationError: if it names a planner's or a filter's class, or a table whose game is a Python file, and
            the user does not.
    """
    for noun in ("planner", "filter"):
        kind = str(_kind(data, noun))
        if ":" in kind and _kind(given, noun) is None:
            raise ConfigurationError(
                f"{path}: {noun}.kind = {shown(repr(kind))} is Python, which is not run because a run's folder says so;"
                f" name it yourself: --{noun} {shown(kind)}"
            )
    scenario = data.get("scenario", {})
    rogues = scenario.get("rogues", {})
    named = [rogues.get("behaviour") if isinstance(rogues, Mapping) else None]
    named += [car.get("rogue") for car in scenario.get("cars", ()) if isinstance(car, Mapping)]
    for kind in (str(kind) for kind in named if ":" in str(kind)):
        if "rogues" not in given.get("scenario", {}):
            raise ConfigurationError(
                f"{path}: the rogue {shown(repr(kind))} is Python, which is not run because a run's folder says so;"
                f" name it yourself: --set scenario.rogues.behaviour={shown(kind)}"
            )
    table = str(data.get("table", ""))
    if "table" not in given and table.endswith(".toml"):
        game = str(read_toml(find_specification(table)).get("dynamics", ""))
        if game.endswith(".py"):
            raise ConfigurationError(
                f"{path}: table = {shown(repr(table))} has the Python file {shown(game)} as its game, which is not run"
                f" because a run's folder says so; name it yourself: --table {shown(table)}"
            )


def _kind(data: Mapping[str, Any], noun: str) -> Any:
    group = data.get(noun)
    return group.get("kind") if isinstance(group, Mapping) else None


def repetition(original: Path, folder: Path) -> Repetition:
    """Return how a run's folder compares with that of the run which it repeats.

    Raises:
        RunFolderError: if one of the lists of versions is broken.
    """
    both = [name for name in COMPARED if (original / name).is_file() and (folder / name).is_file()]
    same = tuple(name for name in both if (original / name).read_bytes() == (folder / name).read_bytes())
    different = tuple(name for name in both if name not in same)
    then = read_versions(original)
    return Repetition(original, same, different, changed_versions(then, read_versions(folder)) if then else {})
