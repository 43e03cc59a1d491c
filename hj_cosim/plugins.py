"""Planners, filters and rogues' behaviours by reference: ours, those of installed packages, those in a user's own file.

A reference is

- a name: one of ours, or one that an installed package registers as an entry point of the group `hj_cosim.planners`,
  `hj_cosim.filters` or `hj_cosim.behaviours`; a name stands for a reference of the next form;
- `package.module:Class`, whatever can be imported;
- `FILE.py:Class`, a Python file; a relative one starts from the current folder.

What is referred to is a class with one method (the contracts of planning/, control/ and traffic/rogues/). Its
constructor is handed what it asks for by the names of its parameters, and nothing else. A class may have settings of
its own: a class attribute `Options`, a subclass of `hj_cosim.settings.Settings`, is filled from `planner.options`,
`filter.options` or `scenario.rogues.options` and handed over as `options`. Every episode makes an object anew and seeds
the global generators of Python and NumPy; what a class or a module keeps lasts as long as the process, over episodes.

What is said of one that fails is in plugin_answers.py.
"""

import hashlib
import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from hj_cosim.errors import ConfigurationError, HjCosimError, PluginError
from hj_cosim.locations import code_file, whole_path
from hj_cosim.plugin_answers import STRANGERS_ERRORS, class_of, failure, named, place_of_class, shown_path
from hj_cosim.settings import Settings, shown, validate


@dataclass(frozen=True)
class PluginKind:
    """A kind of plug-in: what it is called, what it must be able to do, and which ones come with the package."""

    noun: str  # in sentences
    method: str  # that its classes must have
    group: str  # of entry points
    setting: str  # that names it
    options: str  # settings of its own
    ours: Mapping[str, str]  # references by name
    several: tuple[str, ...] = ()  # words that stand for several of them, where one may be named


PLANNER = PluginKind(
    noun="planner",
    method="plan",
    group="hj_cosim.planners",
    setting="planner.kind",
    options="planner.options",
    ours={
        "hjop": "hj_cosim.planning.optimistic.planner:OptimisticPlanner",
        "op": "hj_cosim.planning.optimistic.planner:OptimisticPlannerWithoutValue",
        "mppi": "hj_cosim.planning.mppi.planner:MppiPlanner",
        "idle": "hj_cosim.planning.idle:IdlePlanner",
    },
)
FILTER = PluginKind(
    noun="filter",
    method="filter",
    group="hj_cosim.filters",
    setting="filter.kind",
    options="filter.options",
    ours={
        "spc": "hj_cosim.control.spc.filter:SafetyPreservingFilter",
        "rss": "hj_cosim.control.rss.filter:RssFilter",
        "none": "hj_cosim.control.unfiltered:NoFilter",
    },
)

# Classes and objects that were given as such, by the reference under which a run's files name them.
_given: dict[tuple[str, str], object] = {}


def known_names(kind: PluginKind) -> Mapping[str, str]:
    """Return the references of all names, ours and those of installed packages; no package takes one of ours."""
    return {entry.name: entry.value for entry in entry_points(group=kind.group)} | dict(kind.ours)


def plugin_name(reference: str) -> str:
    """Return what a reference is called in a summary and in a folder's name: the name, or the class's."""
    return reference.rpartition(":")[2].rpartition(".")[2]


def whole_reference(kind: PluginKind, reference: str) -> str:
    """Return a reference that means the same in every folder: a file's path is made absolute.

    Raises:
        ConfigurationError: if it is no path that a file can have.
    """
    place, separator, name = reference.rpartition(":")
    if not place.endswith(".py"):
        return reference
    return f"{whole_path(place, f'{kind.setting} =')}{separator}{name}"


def given(kind: PluginKind, plugin: object) -> str:
    """Return the reference of a class, or of an object that is to be used as it is; it is known from now on.

    Args:
        kind: planner, filter or behaviour.
        plugin: a class, or an object of one.
    """
    plugin_class = class_of(plugin)
    module = sys.modules.get(plugin_class.__module__)
    file = getattr(module, "__file__", None)
    is_importable = plugin_class.__module__ != "__main__" and not isinstance(module, _FileModule)
    place = plugin_class.__module__ if is_importable or file is None else str(Path(file).resolve())
    reference = f"{place}:{plugin_class.__qualname__}"
    _given[kind.noun, reference] = plugin
    return reference


def find_plugin(kind: PluginKind, reference: str) -> object:
    """Return the class that a reference means, or the object if one was given under it.

    Raises:
        ConfigurationError: if no name, file, module or class is called so, or the class lacks the method.
        PluginError: if the file or module cannot be imported.
    """
    reference = whole_reference(kind, reference)
    asked = f"{kind.setting} = {shown(repr(reference))}"
    if (kind.noun, reference) in _given:
        return _with_method(kind, _given[kind.noun, reference], asked)
    place, separator, name = reference.rpartition(":")
    if not separator:
        # Packages are asked only for what is not ours: to find all of them takes as long as a second of a drive.
        known = kind.ours if reference in kind.ours else known_names(kind)
        if reference not in known:
            raise ConfigurationError(
                f"{asked}: no {kind.noun} is called so; choose one of {', '.join([*known, *kind.several])},"
                " or write FILE.py:Class or package.module:Class"
            )
        place, _, name = known[reference].rpartition(":")
    if place.endswith(".py"):
        module = _file_module(code_file(Path(place)), asked)
    else:
        module = _named_module(place, asked)
    found: object = module
    for part in name.split("."):
        found = getattr(found, part, None)
    if not isinstance(found, type):
        classes = [key for key, value in vars(module).items() if _is_own_class(value, module, kind.method)]
        there = f"; it has {', '.join(classes)}" if classes else ""
        raise ConfigurationError(f"{asked}: {place} has no class {name!r}{there}")
    return _with_method(kind, found, asked)


def content_of(kind: PluginKind, reference: str) -> str | None:
    """Return a hash of the file in which a plug-in's class is written; None of ours, and of one that is in no file.

    Raises:
        ConfigurationError, PluginError: if there is no such plug-in.
    """
    if reference in kind.ours or reference in kind.several:
        return None
    module = sys.modules.get(class_of(find_plugin(kind, reference)).__module__)
    file = getattr(module, "__file__", None)
    return None if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()[:12]


def _is_own_class(value: object, module: ModuleType, method: str) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__ and hasattr(value, method)


def _with_method(kind: PluginKind, plugin: object, asked: str) -> object:
    if not callable(getattr(plugin, kind.method, None)):
        plugin_class = class_of(plugin)
        raise ConfigurationError(
            f"{asked}: {place_of_class(plugin_class)}: {plugin_class.__name__} has no method {kind.method!r},"
            f" which a {kind.noun} needs"
        )
    return plugin


def _named_module(name: str, asked: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            missing = f"{asked}: there is no module {error.name!r}; is its package installed?"
            raise ConfigurationError(missing) from error
        raise _not_imported(name, asked, error) from error
    except STRANGERS_ERRORS as error:
        raise _not_imported(name, asked, error) from error


class _FileModule(ModuleType):
    """A module made of a file that nobody can import by name."""


def _file_module(path: Path, asked: str) -> ModuleType:
    """Return a file's module, the same one for as long as the file's content is the same."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{asked}: cannot read {path}: {error.strerror}") from error
    fingerprint = hashlib.sha256(os.fsencode(path) + content).hexdigest()[:16]
    name = f"hj_cosim_plugin_{path.stem}_{fingerprint}"
    if name in sys.modules:
        return sys.modules[name]
    specification = importlib.util.spec_from_file_location(name, path)
    if specification is None or specification.loader is None:
        raise ConfigurationError(f"{asked}: {path} cannot be imported as Python")
    module = _FileModule(name)
    module.__file__, module.__spec__ = str(path), specification
    sys.modules[name] = module  # dataclasses, pickle and Numba's cache look a module up by its name
    try:
        specification.loader.exec_module(module)
    except STRANGERS_ERRORS as error:
        del sys.modules[name]
        raise _not_imported(str(path), asked, error) from error
    return module


def _not_imported(place: str, asked: str, error: BaseException) -> PluginError:
    where = f"{shown_path(place)}"
    if isinstance(error, SyntaxError):
        where = f"{shown_path(error.filename or place)}:{error.lineno}"
    elif frames := [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == place]:
        where = f"{shown_path(place)}:{frames[-1].lineno}"
    return PluginError(f"{asked} cannot be imported: {where}: {named(error)}")


def options_of(kind: PluginKind, plugin: object, options: Mapping[str, Any]) -> Settings | None:
    """Return the settings that a plug-in brings, filled; None if it brings none.

    Args:
        kind: planner, filter or behaviour.
        plugin: as `find_plugin` returns it.
        options: what the kind's setting of options says.

    Raises:
        ConfigurationError: if there are options and the plug-in has none, or one is wrong, which is named.
        PluginError: if the settings' class itself cannot be used.
    """
    where = kind.options
    plugin_class = class_of(plugin)
    model = getattr(plugin_class, "Options", None)
    if model is None or not isinstance(plugin, type):
        if options:
            why = "has none" if model is None else "is an object that was made already"
            raise ConfigurationError(f"{where}: {next(iter(options))!r} is given, but {plugin_class.__name__} {why}")
        return None
    if not (isinstance(model, type) and issubclass(model, Settings)):
        raise ConfigurationError(
            f"{where}: {place_of_class(plugin_class)}: {plugin_class.__name__}.Options must be a subclass of"
            " hj_cosim.settings.Settings"
        )
    try:
        return validate(model, options, where)
    except HjCosimError:
        raise
    except STRANGERS_ERRORS as error:  # a type that is defined nowhere, a validator that fails
        raise PluginError(f"{where}: {place_of_class(model)}: {model.__qualname__}: {named(error)}") from error


def construct(kind: PluginKind, plugin: object, offered: Mapping[str, object]) -> Any:
    """Return an object of a plug-in's class, made with what its constructor asks for; an object as it is.

    Args:
        kind: planner, filter or behaviour.
        plugin: as `find_plugin` returns it.
        offered: what constructors may ask for, by the names of their parameters.

    Raises:
        PluginError: if it asks for something else, or fails.
        HjCosimError: as the constructor raises it.
    """
    if not isinstance(plugin, type):
        return plugin
    wanted = inspect.signature(plugin).parameters.values()
    handed = {parameter.name: offered[parameter.name] for parameter in wanted if parameter.name in offered}
    for parameter in wanted:
        has_to_be_given = parameter.default is parameter.empty and parameter.kind not in (
            parameter.VAR_POSITIONAL,
            parameter.VAR_KEYWORD,
        )
        if has_to_be_given and parameter.name not in handed:
            raise PluginError(
                f"{place_of_class(plugin)}: {plugin.__name__} asks for {parameter.name!r};"
                f" a {kind.noun} may ask for {', '.join(offered)}"
            )
    try:
        return plugin(**handed)
    except HjCosimError:
        raise
    except STRANGERS_ERRORS as error:
        raise failure(plugin, "__init__", error) from error
