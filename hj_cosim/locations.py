"""Where scenarios, table specifications, solved tables and runs live: in a clone, or beside an installed wheel."""

import errno
import os
from collections.abc import Mapping
from pathlib import Path

import platformdirs

from hj_cosim.errors import ConfigurationError

_LONGEST_SHOWN = 100  # characters of a wrong name in a message
_PACKAGE = Path(__file__).resolve().parent
_CLONE = _PACKAGE.parent


def _in_clone() -> bool:
    return (_CLONE / "pyproject.toml").is_file() and (_CLONE / "sumo_net").is_dir()


def scenarios_folder() -> Path:
    """Return the folder of networks and scenarios, `sumo_net/`."""
    return _CLONE / "sumo_net" if _in_clone() else _PACKAGE / "data" / "sumo_net"


def specifications_folder() -> Path:
    """Return the folder of table specifications, `value_tables/`."""
    return _CLONE / "value_tables" if _in_clone() else _PACKAGE / "data" / "value_tables"


def tables_folder() -> Path:
    """Return the folder where solved tables are kept: `value_tables/` in a clone, else the user's cache."""
    if _in_clone():
        return _CLONE / "value_tables"
    return Path(platformdirs.user_cache_dir("hj-cosim")) / "value_tables"


def runs_folder() -> Path:
    """Return the folder that runs write to unless told otherwise: `runs/` in a clone, else `./runs`.

    Raises:
        ConfigurationError: if the current folder has been removed, or has a name that cannot be written down.
    """
    try:
        here = Path.cwd()
    except FileNotFoundError as error:
        raise ConfigurationError("the current folder has been removed; change to one that is there") from error
    _require_text(here, "the current folder:")
    return _CLONE / "runs" if _in_clone() and here.is_relative_to(_CLONE) else here / "runs"


def names_in(folder: Path) -> list[str]:
    """Return the names of the TOML files in `folder`, sorted, without their ending."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def given_path(place: object, what: str) -> Path:
    """Return a path that a caller gave, as a text or a path; nothing needs to be there.

    Args:
        place: what was given.
        what: it should be the path of, for the message.

    Raises:
        ConfigurationError: if it is no path, or one that no file can have.
    """
    if not isinstance(place, str | os.PathLike):
        given = repr(place) if isinstance(place, int | float) else type(place).__name__
        raise ConfigurationError(f"{what}: {_beginning(given)} is no path; give one as a text or a pathlib.Path")
    path = Path(place)
    try:
        path.lstat()
    except ValueError as error:
        raise ConfigurationError(f"{what}: {_beginning(repr(str(path)))} is no path: {error}") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise ConfigurationError(f"{what}: {_beginning(str(path))} is too long a name for a file") from error
    _require_text(path, f"{what}:")
    return path


def _require_text(path: Path, what: str) -> None:
    """Check that a path can be written down, as runs and studies do with what they were made from.

    Raises:
        ConfigurationError: if its name is bytes that are no UTF-8.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        shown = _beginning(str(path).encode(errors="backslashreplace").decode())
        raise ConfigurationError(
            f"{what} the name {shown} is not UTF-8, so that no text file can hold it; rename it"
        ) from error


def whole_path(text: str, what: str) -> str:
    """Return a path as it is meant in every folder: absolute, without `..`, links or `~` in it.

    Args:
        text: the path.
        what: it is the path of, for the message.

    Raises:
        ConfigurationError: if it is no path that a file can have.
    """
    try:
        path = Path(text).expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # too long, of an unknown user, with a null byte
        raise ConfigurationError(f"{what} {_beginning(repr(text))}: no file has such a path") from error
    _require_text(path, what)
    return str(path)


def whole_name(name: str, what: str) -> str:
    """Return what means the same in every folder: a name as it is, and as a whole path one to a file that users write.

    Such files are TOML files, tables and SUMO's configurations.

    Raises:
        ConfigurationError: as whole_path.
    """
    return whole_path(name, what) if name.endswith((".toml", ".npz", ".sumocfg")) else name


# Where Python files of users' own are read that another machine sent along, by their places there.
_copies: dict[Path, Path] = {}


def code_file(path: Path) -> Path:
    """Return where a Python file of a user's own is read: at its place, or where a copy of it came with the work."""
    return _copies.get(path, path)


def read_code_from(copies: Mapping[Path, Path]) -> None:
    """Have Python files of users' own read from copies; all others, from now on, at their places.

    Args:
        copies: where each one is read, by its place on the machine that sent it.
    """
    _copies.clear()
    _copies.update(copies)


def _beginning(text: str) -> str:
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def find_toml(name: str, folder: Path, kind: str) -> Path:
    """Return the TOML file that `name` means: a path ending in .toml, or a name in `folder`.

    Raises:
        ConfigurationError: if there is no such file; the message lists the names that exist.
    """
    if name.endswith(".toml"):
        path = given_path(name, kind).expanduser()
        if not path.is_file():
            raise ConfigurationError(
                f"{kind} file {_beginning(name)} does not exist; give a path to a TOML file or a name"
            )
        return path
    if name not in names_in(folder):
        raise ConfigurationError(
            f"no {kind} is called {_beginning(repr(name))}; choose one of {', '.join(names_in(folder))},"
            " or give a path to a .toml"
        )
    return folder / f"{name}.toml"
