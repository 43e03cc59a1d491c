"""Finding a game: one that comes with the package, or one in a Python file of a user's own."""

import hashlib
import importlib.util
import os
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from hj_cosim.errors import ConfigurationError
from hj_cosim.locations import code_file
from hj_cosim.plugin_answers import STRANGERS_ERRORS, named
from hj_cosim.reachability.games import air3d, double_integrator
from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.games.highway import game as highway
from hj_cosim.reachability.games.highway import time_to_collision


@cache
def registered_games() -> Mapping[str, Game]:
    """Return the games that come with the package, by name."""
    # Each with what else it is made of.
    modules: tuple[tuple[Any, ...], ...] = ((highway,), (time_to_collision, highway), (air3d,), (double_integrator,))
    return {
        parts[0].game.name: _fingerprinted(parts[0].game, *(Path(str(part.__file__)) for part in parts))
        for parts in modules
    }


def find_game(name: str, folder: Path | None = None) -> Game:
    """Return the game that a specification names: a registered one, or one in a Python file.

    The file defines `game`, a Game; `dynamics` is the name that earlier files give it.

    Args:
        name: a registered name, or a path to a .py file.
        folder: what a relative path starts from, the specification's folder; else the current folder.

    Raises:
        ConfigurationError: if there is no such game, or the file does not define one.
    """
    if not name.endswith(".py"):
        known = registered_games()
        if name not in known:
            raise ConfigurationError(
                f"dynamics = {name!r}: choose one of {', '.join(known)}, or give a path to a .py file"
            )
        return known[name]
    path = code_file(((folder or Path()) / Path(name).expanduser()).resolve())
    if not path.is_file():
        raise ConfigurationError(f"dynamics = {name!r}: there is no file {path}")
    place = hashlib.sha256(os.fsencode(path)).hexdigest()[:16]  # two files of one name are two modules
    module_name = f"hj_cosim_game_{path.stem}_{place}"
    specification = importlib.util.spec_from_file_location(module_name, path)
    if specification is None or specification.loader is None:
        raise ConfigurationError(f"dynamics = {name!r}: {path} cannot be imported as Python")
    module = importlib.util.module_from_spec(specification)
    # Numba's cache looks the module up by its name when it loads a function that another process compiled.
    sys.modules[module_name] = module
    try:
        specification.loader.exec_module(module)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    except STRANGERS_ERRORS as error:
        raise ConfigurationError(f"dynamics = {name!r}: {path} fails on import: {named(error)}") from error
    game = getattr(module, "game", getattr(module, "dynamics", None))
    if not isinstance(game, Game):
        raise ConfigurationError(f"dynamics = {name!r}: {path} must define `game`, a Game")
    return _fingerprinted(game, path)


def _fingerprinted(game: Game, *sources: Path) -> Game:
    content = b"".join(source.read_bytes() for source in sources)
    return replace(game, fingerprint=hashlib.sha256(content).hexdigest())
