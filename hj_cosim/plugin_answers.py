"""What is said of a plug-in that fails or answers what cannot be: one sentence with its file and line.

Whoever calls a plug-in catches whatever it raises, and looks at what it answers. Nothing here can interrupt a method
that never comes back: what an answer took is looked at when it is there.
"""

import inspect
import sys
import time
import traceback
from collections.abc import Iterable
from dataclasses import fields
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hj_cosim.errors import HjCosimError, PluginError

# s; an answer that took longer ends the episode. What has to be compiled can be so in `prepare`, which may take longer.
SLOWEST_ANSWER = 10.0
# What a stranger's code may end with, that a sentence is made of; Ctrl-C is not among it.
STRANGERS_ERRORS = (Exception, SystemExit, GeneratorExit)
_LONGEST_QUOTE = 60  # characters


def called(plugin: object, method: str, *arguments: Any, watched: Iterable[Any] | None = None) -> Any:
    """Return what a plug-in's method returns.

    Args:
        plugin: an object.
        method: its name.
        arguments: what it is handed.
        watched: dataclasses whose arrays the method must not write to; all arguments unless given.

    Raises:
        PluginError: if the method raises anything of its own, or writes to what is watched.
        HjCosimError: as the method raises it.
    """
    handed = _arrays_handed(plugin, arguments if watched is None else watched)
    try:
        answer = getattr(plugin, method)(*arguments)
    except HjCosimError:
        raise
    except STRANGERS_ERRORS as error:
        raise failure(plugin, method, error) from error
    if inspect.iscoroutine(answer):
        answer.close()  # of an `async def`, which is refused as any other wrong answer; nobody awaits it
    _require_unchanged(plugin, method, handed)
    return answer


def answered_quickly(plugin: object, method: str, *arguments: Any) -> Any:
    """Do as `called`, where the drive waits for the answer.

    Raises:
        PluginError: also if it took longer than SLOWEST_ANSWER.
    """
    started = time.perf_counter()
    answer = called(plugin, method, *arguments)
    _require_quick(plugin, method, time.perf_counter() - started)
    return answer


def failure(plugin: object, method: str, error: BaseException) -> PluginError:
    """Return what to raise where a plug-in's method raised: one sentence with the file and line where it did.

    Whoever calls a plug-in catches whatever it raises, for a run that goes on to a sentence or, in a study, to the next
    episode; it is raised again as this, from the error itself, so that nothing is lost.
    """
    plugin_class = class_of(plugin)
    within = traceback.extract_tb(error.__traceback__)[1:]  # the first frame is the one that called the plug-in
    own = [frame for frame in within if frame.filename == _file_of(plugin_class)] or within
    # No frame at all: the call itself failed, as it takes other arguments.
    place = f"{shown_path(own[-1].filename)}:{own[-1].lineno}" if own else _place_of_method(plugin, method)
    return PluginError(f"{place}: {plugin_class.__name__}.{method} raised {named(error)}")


def wrong_answer(plugin: object, method: str, what: str) -> PluginError:
    """Return what to raise where a plug-in's method answered what cannot be: one sentence with its file and line.

    Args:
        plugin: whose method it is.
        method: its name.
        what: goes on after "returned", and says what would be right.
    """
    return PluginError(f"{_place_of_method(plugin, method)}: {type(plugin).__name__}.{method} returned {what}")


def is_number(value: object) -> bool:
    """Return whether an answer is one number, finite or not, of Python's or NumPy's, and no larger than floats go."""
    if isinstance(value, float):
        return True
    if not isinstance(value, (int, Real)):  # Real alone, an abstract class, takes ten times as long
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _require_quick(plugin: object, method: str, seconds: float) -> None:
    """Check that an answer did not take longer than SLOWEST_ANSWER.

    Raises:
        PluginError: if it did.
    """
    if seconds > SLOWEST_ANSWER:
        raise PluginError(
            f"{_place_of_method(plugin, method)}: {type(plugin).__name__}.{method} took {seconds:.1f} s;"
            f" {SLOWEST_ANSWER:g} s is the most, and what has to be compiled first can be so in a method `prepare`"
        )


class _Handed(NamedTuple):
    """An array that a plug-in is handed."""

    name: str  # for example Observation.x
    array: np.ndarray
    before: bytes  # what it held


def _arrays_handed(plugin: object, handed: Iterable[Any]) -> list[_Handed]:
    """Return the arrays of dataclasses that a plug-in is about to be handed; none if the plug-in is ours.

    Others go on with the same arrays. Such that cannot be written would have Numba compile everything once more.
    """
    if class_of(plugin).__module__.startswith("hj_cosim."):
        return []
    columns = (
        (type(each).__name__, field.name, getattr(each, field.name)) for each in handed for field in fields(each)
    )
    return [
        _Handed(f"{owner}.{name}", column, column.tobytes())
        for owner, name, column in columns
        if isinstance(column, np.ndarray)
    ]


def _require_unchanged(plugin: object, method: str, handed: Iterable[_Handed]) -> None:
    """Check that a plug-in has not written into what it was handed.

    Raises:
        PluginError: if it has.
    """
    for name, array, before in handed:
        if array.tobytes() != before:
            place = f"{_place_of_method(plugin, method)}: {class_of(plugin).__name__}.{method}"
            raise PluginError(f"{place} wrote to {name}, with which the drive goes on; let it write to a copy")


def shown_answer(answer: object) -> str:
    """Return an answer as a sentence quotes it, cut off where it is long, also one that cannot tell what it is."""
    try:
        text = repr(answer)
    except STRANGERS_ERRORS:
        return f"a {type(answer).__name__}"
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."


def class_of(plugin: object) -> type:
    """Return the class of a plug-in that is a class, or an object of one."""
    return plugin if isinstance(plugin, type) else type(plugin)


def _place_of_method(plugin: object, method: str) -> str:
    code = getattr(getattr(class_of(plugin), method, None), "__code__", None)
    return f"{shown_path(code.co_filename)}:{code.co_firstlineno}" if code else place_of_class(class_of(plugin))


def place_of_class(plugin_class: type) -> str:
    """Return the file and the line where a class begins."""
    file = _file_of(plugin_class)
    try:
        return f"{shown_path(file)}:{inspect.getsourcelines(plugin_class)[1]}"
    except (OSError, TypeError):  # its source is not there to be read
        return shown_path(file)


def _file_of(plugin_class: type) -> str:
    return str(getattr(sys.modules.get(plugin_class.__module__), "__file__", plugin_class.__module__))


def named(error: BaseException) -> str:
    """Return an error's name, and the first line of what it says if it can say anything."""
    try:
        said = str(error).splitlines()
    except STRANGERS_ERRORS:
        said = []
    return f"{type(error).__name__}: {said[0]}" if said else type(error).__name__


def shown_path(path: str) -> str:
    """Return a path as a user would write it: relative where it is below the current folder."""
    there = Path(path)
    return str(there.relative_to(Path.cwd())) if there.is_absolute() and there.is_relative_to(Path.cwd()) else path
