"""Configurations of any content, drawn over the real schema: right and wrong types, ranges, extremes, unknown keys."""

import math
import types
from typing import Any, Literal, Union, get_args, get_origin

from hypothesis import strategies as st
from pydantic import BaseModel
from pydantic.fields import FieldInfo

EXTREMES = (0.0, -0.0, 1e-300, 1e-9, 1e-3, 0.5, 1.0, 1.5, 1e3, 1e6, 1e9, 1e18, 1e300, -1.0, -1e9)
# What TOML can say: no null.
scalars: st.SearchStrategy[Any] = st.one_of(
    st.sampled_from((*EXTREMES, float("nan"), float("inf"), float("-inf"))),
    st.integers(-(2**63), 2**63 - 1),
    st.integers(-3, 30),
    st.booleans(),
    st.text(max_size=8),
    st.sampled_from(("", "..", "../../x", "\x00", "$x", "[red]", "4", "inf", "é" * 300)),
)
anything = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner)
)


def values(annotation: Any, low: float = -math.inf, high: float = math.inf) -> st.SearchStrategy[Any]:
    """Return values of an annotation's type: ordinary ones, and extreme ones from low to high."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return tables(annotation)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (Union, types.UnionType):
        return st.one_of(*(values(kind, low, high) for kind in arguments if kind is not type(None)))
    if origin is dict:
        return st.dictionaries(st.text(max_size=5), anything, max_size=1)
    if origin is tuple:
        return st.lists(values(arguments[0]), max_size=3)
    if annotation is bool:
        return st.booleans()
    ordinary = (max(low, 0.0) if high >= 0.0 else low, min(high, 30.0))
    if annotation is int:
        return st.integers(int(ordinary[0]), min(int(ordinary[1]), 6))
    if annotation is float:
        extremes = [value for value in EXTREMES if low <= value <= high]
        return st.one_of(st.floats(*ordinary), st.floats(*ordinary), st.sampled_from(extremes))
    return st.text(max_size=8)


def bounds_of(field: FieldInfo) -> tuple[float, float]:
    """Return the least and the greatest value that a field states; where a bound is excluded, it counts, too."""
    lowest = [getattr(rule, name) for rule in field.metadata for name in ("gt", "ge") if hasattr(rule, name)]
    highest = [getattr(rule, name) for rule in field.metadata for name in ("lt", "le") if hasattr(rule, name)]
    return max(lowest, default=-math.inf), min(highest, default=math.inf)


def tables(model: type[BaseModel]) -> st.SearchStrategy[dict[str, Any]]:
    """Return TOML tables for a group of knobs: a few keys of it, seldom of a wrong type, seldom an unknown key."""
    fields = model.model_fields
    required = [name for name, field in fields.items() if field.is_required()]
    seldom = st.integers(0, 59).map(lambda number: number == 7)

    @st.composite
    def table(draw: st.DrawFn) -> dict[str, Any]:
        chosen = draw(st.lists(st.sampled_from(list(fields)), max_size=4, unique=True))
        content = {}
        for name in dict.fromkeys([*required, *chosen]):
            right = values(fields[name].annotation, *bounds_of(fields[name]))
            if fields[name].examples:
                right = st.one_of(st.sampled_from(fields[name].examples), right)
            content[name] = draw(anything if draw(seldom) else right)
        if draw(seldom):
            content[draw(st.text(min_size=1, max_size=5))] = draw(anything)
        return content

    return table()
