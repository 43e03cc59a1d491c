"""Reading settings: TOML within bounds, layers laid over each other, and sentences about what is wrong."""

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings.base import Settings

Model = TypeVar("Model", bound=Settings)

LARGEST_TOML = 2_000_000  # bytes; a scene of 5000 cars at given places has a fifth of it
DEEPEST_TOML = 20  # tables and arrays within each other
LONGEST_TOML_LINE = 5000  # characters; the time that tomllib takes for a key grows with the square of its parts
_LONGEST_SHOWN = 100  # characters of a wrong key or value in a message


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        ConfigurationError: if it cannot be read, is not TOML, or is larger or deeper than LARGEST_TOML, DEEPEST_TOML.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_TOML + 1)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    if len(content) > LARGEST_TOML:
        raise ConfigurationError(f"{path} is too large; {LARGEST_TOML / 1e6:g} MB of TOML is the most")
    try:
        return parse_toml(content.decode("utf-8-sig"))
    except ValueError as error:
        raise ConfigurationError(f"{path} is not TOML: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text.

    Raises:
        ValueError: if it is not TOML, deeper than DEEPEST_TOML, or a line is longer than LONGEST_TOML_LINE.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > LONGEST_TOML_LINE:
            raise ValueError(f"line {number} has {len(line)} characters; {LONGEST_TOML_LINE} is the most")
    too_deep = f"it has more than {DEEPEST_TOML} tables and arrays within each other"
    try:
        data = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError(too_deep) from error
    within: list[Any] = [data]
    for _ in range(DEEPEST_TOML):
        below = [value.values() if isinstance(value, dict) else value for value in within]
        within = [value for values in below for value in values if isinstance(value, dict | list)]
        if not within:
            return data
    raise ValueError(too_deep)


def validate(model: type[Model], data: Mapping[str, Any], source: str, table: str = "") -> Model:
    """Return `data` as `model`.

    Args:
        model: what it should be.
        data: unchecked.
        source: where it comes from, for the message.
        table: the part of the model that the source states; in the message, keys in it are called as they are there.

    Raises:
        ConfigurationError: one sentence that names the source, the key, the value and what would be right.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        within = first["loc"][:1] == (table,)
        key = shown(_key_in_toml(first["loc"][1:] if within else first["loc"]))
        if first["type"] == "extra_forbidden":
            known = ", ".join(_fields_at(model, first["loc"][:-1]))
            raise ConfigurationError(f"{source}: unknown key {key!r}; known keys are {known}") from error
        reason = first["msg"].removeprefix("Value error, ")
        given = "" if first["type"] in ("missing", "value_error") else f" = {shown(repr(first['input']))}"
        at = f"{key}{given}: " if key else ""  # what is wrong of several keys together names them itself
        raise ConfigurationError(f"{source}: {at}{reason[:1].lower()}{reason[1:]}") from error


def _key_in_toml(location: tuple[int | str, ...]) -> str:
    """Return a place within a model as one finds it in TOML: `traffic.count`, or `[[cars]] entry 1, lane`."""
    for depth, part in enumerate(location):
        if isinstance(part, int):
            array, rest = ".".join(map(str, location[:depth])), _key_in_toml(location[depth + 1 :])
            return f"[[{array}]] entry {part + 1}, {rest}" if rest else f"{array}, entry {part + 1}"
    return ".".join(map(str, location))


def shown(text: str) -> str:
    """Return a text that fits into a sentence: its beginning, where it is longer."""
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def _fields_at(model: type[Settings], location: tuple[int | str, ...]) -> Iterable[str]:
    """Return the keys of the group of settings at a place within a model; a list's groups all have the same."""
    for part in location:
        if isinstance(part, str):
            annotation = model.model_fields[part].annotation
            groups = [kind for kind in (annotation, *get_args(annotation)) if _is_group(kind)]
            model = groups[0]
    return model.model_fields


def _is_group(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Settings)


def overlay(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with the values of `top` laid over it, table by table."""
    merged = dict(base)
    for key, value in top.items():
        below = merged.get(key)
        merged[key] = overlay(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


def parse_assignment(text: str, option: str = "--set") -> dict[str, Any]:
    """Return `planner.gamma_r=0.8` as `{"planner": {"gamma_r": 0.8}}`; the value is TOML, or else a string.

    Args:
        text: KEY=VALUE.
        option: where it was given, to be named where it is wrong.

    Raises:
        ConfigurationError: if there is no `=` or no key.
    """
    key, separator, value = text.partition("=")
    parts = [part.strip() for part in key.split(".")]
    if not separator or not all(parts):
        raise ConfigurationError(f"{option} {shown(text)}: write KEY=VALUE, for example planner.gamma_r=0.8")
    if len(parts) > DEEPEST_TOML:
        raise ConfigurationError(f"{option} {shown(text)}: no key has so many parts")
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ConfigurationError(f"{option} {text!r} is not UTF-8; write it with letters that are") from error
    try:
        parsed: Any = parse_toml(f"value = {value}")["value"]
    except ValueError:
        parsed = value.strip()
    nested: dict[str, Any] = {parts[-1]: parsed}
    for part in reversed(parts[:-1]):
        nested = {part: nested}
    return nested


def assignment_texts(settings: Any, name: str = "settings") -> list[str]:
    """Return settings as texts KEY=VALUE, as `--set` takes them.

    Args:
        settings: such texts, or a mapping of keys to values; keys are nested, or in one with dots, or both.
        name: what they are called in messages.

    Raises:
        ConfigurationError: if they are neither, or a value is none that a setting can have.
    """
    if isinstance(settings, Mapping):
        return [f"{key}={toml_value(value, f'{name}: {key}')}" for key, value in flattened(settings, name)]
    if not isinstance(settings, list | tuple) or not all(isinstance(text, str) for text in settings):
        raise ConfigurationError(
            f"{name} = {shown(repr(settings))} is neither a list of texts KEY=VALUE nor a dict of keys and values"
        )
    return list(settings)


def flattened(settings: Mapping[Any, Any], name: str = "settings", above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the key, with dots, and the value of everything in a nested mapping.

    Raises:
        ConfigurationError: if a key is no text.
    """
    for key, value in settings.items():
        if not isinstance(key, str):
            raise ConfigurationError(f"{name}: the key {shown(repr(key))} is no text such as planner.gamma_r")
        if isinstance(value, Mapping):
            yield from flattened(value, name, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def toml_value(value: Any, place: str) -> str:
    """Return a value as TOML in one line; what JSON and TOML both have is written alike.

    Raises:
        ConfigurationError: if no setting can have it; `place` is where it stands, for the message.
    """
    plain = value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value  # one of NumPy's
    parts = plain if isinstance(plain, list | tuple) else [plain]
    if not all(isinstance(part, str | int | float) for part in parts):
        raise ConfigurationError(f"{place} = {shown(repr(value))} is no number, text, truth value or list of these")
    return json.dumps(plain, ensure_ascii=False)
