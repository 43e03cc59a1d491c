"""Where scenarios, table specifications, solved tables and runs live: in a clone, or beside an installed wheel."""

from pathlib import Path

import platformdirs

from hj_cosim.errors import ConfigurationError

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
    """Return the folder that runs write to unless told otherwise: `runs/` in a clone, else `./runs`."""
    return _CLONE / "runs" if _in_clone() and Path.cwd().is_relative_to(_CLONE) else Path.cwd() / "runs"


def names_in(folder: Path) -> list[str]:
    """Return the names of the TOML files in `folder`, sorted, without their ending."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def find_toml(name: str, folder: Path, kind: str) -> Path:
    """Return the TOML file that `name` means: a path ending in .toml, or a name in `folder`.

    Raises:
        ConfigurationError: if there is no such file; the message lists the names that exist.
    """
    if name.endswith(".toml"):
        path = Path(name).expanduser()
        if not path.is_file():
            raise ConfigurationError(f"{kind} file {name} does not exist; give a path to a TOML file or a name")
        return path
    if name not in names_in(folder):
        raise ConfigurationError(
            f"no {kind} is called {name!r}; choose one of {', '.join(names_in(folder))}, or give a path to a .toml"
        )
    return folder / f"{name}.toml"
