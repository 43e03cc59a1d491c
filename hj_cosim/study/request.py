"""What is asked of a study: as it is given, completed by defaults, or by the study that is gone on with."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from hj_cosim.errors import ConfigurationError
from hj_cosim.locations import whole_name
from hj_cosim.recording.study_files import (
    StudyRequest,
    read_study_file,
    require_no_contradiction,
    split_variation,
)
from hj_cosim.settings import assignment_texts, flattened, parse_assignment, shown, validate
from hj_cosim.study.stacks import PAPER_STACKS, Stack, parse_stack

Texts = str | Sequence[str]  # one or several

_DEFAULTS: Mapping[str, Any] = {
    "scenarios": ("paper",),
    "stacks": tuple(stack.text for stack in PAPER_STACKS),
    "episodes": 20,
    "seed": 0,
    "preset": "best",
    "vary": (),
    "set": (),
    "keep": "all",
    "traffic": "theirs",
}


def given_fields(**fields: Any) -> dict[str, Any]:
    """Return the fields of a StudyRequest that were given, which are those that are not None, as it has them.

    Raises:
        ConfigurationError: if texts were to be given and something else was.
    """
    texts = {"set": _settings, "vary": _variations}
    fields |= {name: convert(fields[name]) for name, convert in texts.items() if isinstance(fields.get(name), Mapping)}
    lists: dict[str, Callable[[Any], str | None]] = {
        "scenarios": _scenario,
        "stacks": _stack,
        "vary": _variation,
        "set": _assignment,
    }
    return {
        name: _each(value, name, lists[name]) if name in lists else value
        for name, value in fields.items()
        if value is not None
    }


def new_study(given: Mapping[str, Any]) -> StudyRequest:
    """Return what is asked for: the given fields of a StudyRequest, and the defaults of the others.

    Raises:
        ConfigurationError: if a value is of the wrong type or out of range.
    """
    return validate(StudyRequest, {**_DEFAULTS, **given}, "the study")


def resumed_study(folder: Path, given: Mapping[str, Any]) -> StudyRequest:
    """Return what the study in a folder was asked for, with more episodes if these are given.

    Args:
        folder: the study's.
        given: fields of a StudyRequest, to be checked against the study's.

    Raises:
        ConfigurationError: if there is no study, or something else is given than it has.
    """
    earlier = read_study_file(folder).model_dump(exclude={"program"})
    now = validate(StudyRequest, {**earlier, **given}, "the study")
    require_no_contradiction(folder, StudyRequest(**earlier), {name: getattr(now, name) for name in given})
    return now


def _each(values: Any, name: str, convert: Callable[[Any], str | None]) -> tuple[str, ...]:
    """Return one value or several as texts.

    Raises:
        ConfigurationError: if it is neither.
    """
    listed = values if isinstance(values, Iterable) and not isinstance(values, str | Mapping) else [values]
    texts = []
    for value in listed:
        text = convert(value)
        if text is None:
            raise ConfigurationError(f"{name}: {_described(value)} is no text; give one text or a list of them")
        texts.append(text)
    return tuple(texts)


# Files are named by their whole paths, so that the study can be resumed from anywhere.
def _assignment(value: Any) -> str | None:
    """Return a text KEY=VALUE; the path of a table is a whole one."""
    if not isinstance(value, str):
        return None
    given = parse_assignment(value) if "=" in value else {}
    table = given.get("table")
    return f"table={whole_name(table, 'table =')}" if isinstance(table, str) else value


def _variation(value: Any) -> str | None:
    """Return a text KEY=VALUE,VALUE; the paths of tables are whole ones."""
    if not isinstance(value, str):
        return None
    key, tables = split_variation(value)
    return f"table={','.join(whole_name(table, 'table =') for table in tables)}" if key == "table" else value


def _scenario(value: Any) -> str | None:
    """Return a scenario's name, or the path of its file."""
    if not isinstance(value, str | PathLike):
        return None
    return whole_name(str(value), "scenario")


def _settings(settings: Mapping[str, Any]) -> list[str]:
    """Return a mapping of knobs as texts KEY=VALUE."""
    return assignment_texts(settings)


def _variations(varied: Mapping[str, Any]) -> list[str]:
    """Return a mapping of knobs to the values that they take in turn as texts KEY=VALUE,VALUE.

    Raises:
        ConfigurationError: if a knob has no list of values.
    """
    texts = []
    for key, values in flattened(varied, "vary"):
        if isinstance(values, str) or not isinstance(values, Iterable):
            raise ConfigurationError(f"vary: {key} = {shown(repr(values))} is no list of values, such as [0.8, 0.9]")
        each = [
            value if isinstance(value, str) else assignment_texts({"": value}, f"vary: {key}")[0][1:]
            for value in values
        ]
        texts.append(f"{key}={','.join(each)}")
    return texts


def _stack(value: Any) -> str | None:
    if isinstance(value, Mapping):
        if not (value.keys() <= {"planner", "filter", "scheme"} and all(isinstance(v, str) for v in value.values())):
            raise ConfigurationError(f"stacks: {shown(repr(dict(value)))} has not planner, filter and scheme alone")
        named = {"planner": "hjop", "filter": "spc", **value}
        has_none = named["filter"] == "none" or (":" in named["filter"] and "scheme" not in named)
        scheme = "" if has_none else f"-{named.get('scheme', 'mi')}"
        return parse_stack(f"{named['planner']}/{named['filter']}{scheme}").text
    if isinstance(value, str):
        return parse_stack(value).text
    return value.text if isinstance(value, Stack) else None


def _described(value: Any) -> str:
    """Return a wrong value for a sentence: itself if it is a plain one, and else what it is."""
    return repr(value) if isinstance(value, int | float) else f"a {type(value).__name__}"
