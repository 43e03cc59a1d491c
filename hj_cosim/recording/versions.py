"""versions.json: what a run's bytes depend on besides its configuration, so that a repetition can say what changed."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from platform import python_version

from hj_cosim import __version__
from hj_cosim.errors import RunFolderError
from hj_cosim.recording.summary_file import LARGEST_SUMMARY

VERSIONS = "versions.json"
TABLE = "value table"
_PACKAGES = ("libsumo", "numpy", "numba", "daqp")  # whose arithmetic is in every sample


@cache
def program_versions() -> Mapping[str, str]:
    """Return the versions of this program, of Python, and of the packages whose arithmetic is in every sample."""
    return {"hj-cosim": __version__, "python": python_version(), **{name: version(name) for name in _PACKAGES}}


def versions_text(versions: Mapping[str, str]) -> str:
    """Return the content of versions.json."""
    return json.dumps(dict(versions), indent=2) + "\n"


def read_versions(folder: Path) -> dict[str, str]:
    """Return the content of a run's versions.json; nothing where there is none.

    Raises:
        RunFolderError: if it is broken.
    """
    path = folder / VERSIONS
    if not path.exists():
        return {}
    try:
        with path.open("rb") as file:
            return {str(name): str(value) for name, value in json.loads(file.read(LARGEST_SUMMARY)).items()}
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise RunFolderError(f"{path} is no list of versions: {error}") from error


def changed_versions(then: Mapping[str, str], now: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """Return what is another version than it was, then and now; `unknown` where one of them does not say."""
    names = dict.fromkeys((*then, *now))
    pairs = {name: (then.get(name, "unknown"), now.get(name, "unknown")) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
