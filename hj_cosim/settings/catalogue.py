"""The list of all settings: what `--set` and `--vary` take, with units, defaults, ranges and descriptions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings.base import Settings, unit_of
from hj_cosim.settings.episode import PRESETS, EpisodeConfig
from hj_cosim.settings.layers import overlay, shown

_BOUNDS = {"ge": ">= {:g}", "gt": "> {:g}", "le": "<= {:g}", "lt": "< {:g}"}


@dataclass(frozen=True)
class SettingEntry:
    """A setting as `hj-cosim knobs` shows it."""

    key: str  # as in `--set KEY=VALUE`
    unit: str  # "1" of a number without one, "" where there is no number
    default: Any  # in the preset `best`; None where it has none
    paper: Any  # in the preset `paper`
    allowed: str  # a range, or the values to choose from; "" if anything of its type
    description: str


def list_settings(group: str | None = None) -> list[SettingEntry]:
    """Return every setting of an episode, in the order of config.toml.

    Args:
        group: a part of the keys, for example `planner` or `scenario.drivers`; all unless given.

    Raises:
        ConfigurationError: if there is no such group and no such setting.
    """
    entries = list(_entries(_Place(EpisodeConfig, {name: _resolved(name) for name in PRESETS})))
    chosen = [entry for entry in entries if group in (None, entry.key) or entry.key.startswith(f"{group}.")]
    if not chosen:
        groups = dict.fromkeys(entry.key.rpartition(".")[0] for entry in entries if "." in entry.key)
        raise ConfigurationError(f"no settings are called {shown(str(group))!r}; choose one of {', '.join(groups)}")
    return chosen


def _resolved(preset: str) -> Mapping[str, Any]:
    """Return every setting's value in a preset; the scenario has no name of its own here."""
    data = overlay({"preset": preset, "scenario": {"name": ""}}, PRESETS[preset])
    return EpisodeConfig.model_validate(data).model_dump()


@dataclass(frozen=True)
class _Place:
    """A group of settings within an episode's."""

    model: type[Settings]
    values: Mapping[str, Mapping[str, Any]]  # the group's in each preset
    above: str = ""  # its key and a dot
    field: FieldInfo | None = None  # the one that holds it


def _entries(place: _Place) -> Iterator[SettingEntry]:
    for name, field in place.model.model_fields.items():
        key, annotation = f"{place.above}{name}", field.annotation
        values = {preset: below[name] for preset, below in place.values.items()}
        if isinstance(annotation, type) and issubclass(annotation, Settings):
            yield from _entries(_Place(annotation, values, f"{key}.", field))
        else:
            yield _entry(key, field, values, place.field)


def _entry(key: str, field: FieldInfo, values: Mapping[str, Any], holder: FieldInfo | None) -> SettingEntry:
    unit, description = unit_of(field), field.description or ""
    held_unit = unit_of(holder) if holder is not None else None
    if holder is not None and held_unit is not None:  # a distribution's mean is in the unit of what is drawn
        unit = unit or held_unit
        description = f"{holder.description}: {description}"
    best, paper = (None if value == "" else value for value in (values["best"], values["paper"]))
    return SettingEntry(key, unit or "", best, paper, _allowed(field), description)


def _allowed(field: FieldInfo) -> str:
    """Return the range of a number, or the values of a choice."""
    if get_origin(field.annotation) is Literal:
        return ", ".join(map(str, get_args(field.annotation)))
    if field.examples:
        return ", ".join([*map(str, field.examples), "..."])
    if field.annotation is bool:
        return "true, false"
    bounds = [
        pattern.format(getattr(entry, bound))
        for bound, pattern in _BOUNDS.items()
        for entry in field.metadata
        if getattr(entry, bound, None) is not None
    ]
    return " and ".join(bounds)
