"""Stacks: which planner drives under which safety filter in which scheme; the paper's ten, in the paper's order."""

from dataclasses import dataclass
from typing import Any

from hj_cosim.errors import ConfigurationError

NO_SCHEME = "-"  # the scheme of a stack without a filter

_PLANNERS = ("hjop", "op", "idle")
_FILTERS = ("spc", "rss")
_SCHEMES = ("sw", "mi")


@dataclass(frozen=True)
class Stack:
    """A planner, a safety filter and its scheme, as `hj-cosim run` names them."""

    planner: str
    filter: str
    scheme: str = NO_SCHEME

    @property
    def name(self) -> str:
        """Return a name fit for a folder, such as `hjop-spc-mi` or `op-none`."""
        return "-".join([self.planner, self.filter, *([] if self.scheme == NO_SCHEME else [self.scheme])])

    @property
    def label(self) -> str:
        """Return the paper's way of writing it, such as `HJOP + SPC + MI` or `OP + None`."""
        parts = [self.planner.upper(), "None" if self.filter == "none" else self.filter.upper()]
        return " + ".join(parts if self.scheme == NO_SCHEME else [*parts, self.scheme.upper()])

    @property
    def flags(self) -> dict[str, Any]:
        """Return the stack as the nested configuration that `cosim.configuration.resolve_config` takes."""
        scheme = {} if self.scheme == NO_SCHEME else {"scheme": self.scheme}
        return {"planner": {"kind": self.planner}, "filter": {"kind": self.filter, **scheme}}


def parse_stack(name: str) -> Stack:
    """Return the stack of a name such as `hjop-spc-mi` or `op-none`.

    Raises:
        ConfigurationError: if it is no planner-filter-scheme, or planner-none.
    """
    match name.split("-"):
        case [planner, "none"] if planner in _PLANNERS:
            return Stack(planner, "none")
        case [planner, safety_filter, scheme] if (
            planner in _PLANNERS and safety_filter in _FILTERS and scheme in _SCHEMES
        ):
            return Stack(planner, safety_filter, scheme)
    raise ConfigurationError(
        f"no stack is called {name!r}; write PLANNER-FILTER-SCHEME, for example hjop-spc-mi, or PLANNER-none:"
        f" planners are {', '.join(_PLANNERS)}, filters {', '.join(_FILTERS)}, schemes {', '.join(_SCHEMES)}"
    )


PAPER_STACKS: tuple[Stack, ...] = tuple(
    stack
    for planner in ("hjop", "op")
    for stack in (
        *(Stack(planner, safety_filter, scheme) for scheme in _SCHEMES for safety_filter in _FILTERS),
        Stack(planner, "none"),
    )
)
