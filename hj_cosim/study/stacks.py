"""Stacks: which planner drives under which safety filter in which scheme; the paper's ten, in the paper's order."""

import re
from dataclasses import dataclass
from typing import Any

from hj_cosim.errors import ConfigurationError
from hj_cosim.files import file_name
from hj_cosim.locations import whole_path
from hj_cosim.settings import shown

NO_SCHEME = "-"  # the scheme of a stack without a filter, or with one that has no schemes

_PLANNERS = ("hjop", "op", "mppi", "idle")
_FILTERS = ("spc", "rss")
_SCHEMES = ("sw", "mi")

# A class of a user's own: mine.py:KeepRight or package.module:KeepRight.
_REFERENCE = re.compile(r"(?P<place>[^:]+\.py|[^\W\d]\w*(\.[^\W\d]\w*)*):(?P<name>[^\W\d]\w*)")


@dataclass(frozen=True)
class Stack:
    """A planner, a safety filter and its scheme, as `hj-cosim run` names them.

    Planner and filter are names of ours or references to classes, `file.py:Class` or `package.module:Class`.
    """

    planner: str
    filter: str
    scheme: str = NO_SCHEME

    @property
    def text(self) -> str:
        """Return what `parse_stack` reads, such as `hjop-spc-mi` or `mine.py:KeepRight/spc-mi`."""
        if not (_is_reference(self.planner) or _is_reference(self.filter)):
            return self.name
        return "-".join([f"{self.planner}/{self.filter}", *self._schemes])

    @property
    def name(self) -> str:
        """Return a name fit for a folder, such as `hjop-spc-mi`, `op-none` or `KeepRight-spc-mi`."""
        return file_name("-".join([_short_name(self.planner), _short_name(self.filter), *self._schemes]))

    @property
    def label(self) -> str:
        """Return the paper's way of writing it, such as `HJOP + SPC + MI` or `OP + None`."""
        return " + ".join([_label(self.planner), _label(self.filter), *(scheme.upper() for scheme in self._schemes)])

    @property
    def columns(self) -> dict[str, str]:
        """Return what the tables say of it; of a user's class its name, wherever it is from."""
        return {"planner": _short_name(self.planner), "filter": _short_name(self.filter), "scheme": self.scheme}

    @property
    def flags(self) -> dict[str, Any]:
        """Return the stack as the nested configuration that `cosim.configuration.resolve_config` takes."""
        scheme = {} if self.scheme == NO_SCHEME else {"scheme": self.scheme}
        return {"planner": {"kind": self.planner}, "filter": {"kind": self.filter, **scheme}}

    @property
    def _schemes(self) -> list[str]:
        return [] if self.scheme == NO_SCHEME else [self.scheme]


def parse_stack(text: str) -> Stack:
    """Return the stack of a text: `hjop-spc-mi`, `op-none`, or `PLANNER/FILTER-SCHEME` with classes of a user's own.

    A class is `file.py:Class` or `package.module:Class`, for example `mine.py:KeepRight/spc-mi`,
    `mine.py:KeepRight/none` or `hjop/mine.py:Cautious`; a filter of one's own may do without a scheme. A file is named
    by its whole path in what is returned, so that a study can be resumed from anywhere.

    Raises:
        ConfigurationError: if it is none of these.
    """
    # A path has slashes too: the one that parts the planner from the filter leaves a planner and a filter.
    parts = [(text[:place], text[place + 1 :]) for place, letter in enumerate(text) if letter == "/"]
    if not parts and ":" not in text:
        parts = [(planner, rest) for planner, _, rest in [text.partition("-")]]
    for planner, rest in parts:
        safety_filter = _parse_filter(rest)
        if _is_planner(planner) and safety_filter is not None:
            return Stack(_anchored(planner), _anchored(safety_filter[0]), safety_filter[1])
    raise ConfigurationError(
        f"no stack is called {shown(repr(text))}; write PLANNER-FILTER-SCHEME, for example hjop-spc-mi, or"
        f" PLANNER-none: planners are {', '.join(_PLANNERS)}, filters {', '.join(_FILTERS)}, schemes"
        f" {', '.join(_SCHEMES)}; or PLANNER/FILTER-SCHEME with a class of one's own, for example"
        " mine.py:KeepRight/spc-mi"
    )


def _parse_filter(text: str) -> tuple[str, str] | None:
    """Return a filter and its scheme, or None if the text is none."""
    if text == "none" or _is_reference(text):
        return text, NO_SCHEME
    safety_filter, _, scheme = text.rpartition("-")
    return (safety_filter, scheme) if _is_filter(safety_filter) and scheme in _SCHEMES else None


# Whether a class is there and is a planner or a filter is found out by who loads it; here, only what a text can mean.
def _is_planner(text: str) -> bool:
    return text in _PLANNERS or _is_reference(text)


def _is_filter(text: str) -> bool:
    return text in _FILTERS or _is_reference(text)


def _is_reference(text: str) -> bool:
    return _REFERENCE.fullmatch(text) is not None


def _anchored(kind: str) -> str:
    """Return a planner or a filter; a file in it by its whole path."""
    reference = _REFERENCE.fullmatch(kind)
    if reference is None or not reference["place"].endswith(".py"):
        return kind
    return f"{whole_path(reference['place'], 'the file')}:{reference['name']}"


def _short_name(kind: str) -> str:
    """Return a planner's or a filter's name; of a reference the class's alone."""
    reference = _REFERENCE.fullmatch(kind)
    return kind if reference is None else reference["name"]


def _label(kind: str) -> str:
    if kind == "none":
        return "None"
    return _short_name(kind) if _is_reference(kind) else kind.upper()


PAPER_STACKS: tuple[Stack, ...] = tuple(
    stack
    for planner in ("hjop", "op")
    for stack in (
        *(Stack(planner, safety_filter, scheme) for scheme in _SCHEMES for safety_filter in _FILTERS),
        Stack(planner, "none"),
    )
)
