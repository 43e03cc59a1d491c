"""summary.json and timing.json: one number or text a key, as strict JSON that anybody may have written."""

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from hj_cosim.errors import RunFolderError

TIMING = "timing.json"
LARGEST_SUMMARY = 1_000_000  # bytes
# What the title of a report and of a figure needs.
_SUMMARY_KEYS = {"scenario", "planner", "filter", "scheme", "seed"}


def summary_text(summary: Mapping[str, Any]) -> str:
    """Return a summary as strict JSON: what is not finite (no car was ever approached) becomes null."""
    finite = {key: None if _is_not_finite(value) else value for key, value in summary.items()}
    return json.dumps(finite, indent=2, allow_nan=False) + "\n"


def _is_not_finite(value: Any) -> bool:
    return isinstance(value, float) and not np.isfinite(value)


def read_summary(path: Path) -> dict[str, Any]:
    """Return the content of a run's summary.json.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is larger than LARGEST_SUMMARY, no JSON, or no summary.
    """
    with path.open("rb") as file:
        content = file.read(LARGEST_SUMMARY + 1)
    if len(content) > LARGEST_SUMMARY:
        raise ValueError(f"{path.name} is too large; {LARGEST_SUMMARY / 1e6:g} MB is the most")
    try:
        summary = json.loads(content)
    except RecursionError as error:
        raise ValueError(f"{path.name} is nested too deeply") from error
    if not isinstance(summary, dict) or not summary.keys() >= _SUMMARY_KEYS:
        raise ValueError(f"{path.name} is no summary: it must have {', '.join(sorted(_SUMMARY_KEYS))}")
    if any(isinstance(value, list | dict) for value in summary.values()):
        raise ValueError(f"{path.name} is no summary: it must have one number or text a key")
    return summary


def read_timing(folder: Path) -> dict[str, float]:
    """Return the content of a run's timing.json; nothing where there is none.

    Raises:
        RunFolderError: if it is broken.
    """
    path = folder / TIMING
    if not path.exists():
        return {}
    try:
        with path.open("rb") as file:
            return {name: float(value) for name, value in json.loads(file.read(LARGEST_SUMMARY)).items()}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise RunFolderError(f"{path} is no timing of a run: {error}") from error


def summary_sentence(summary: Mapping[str, Any]) -> str:
    """Return what a run was and how it went, in a line."""
    stack = summary["planner"] if summary["filter"] == "none" else f"{summary['planner']} + {summary['filter']}"
    scheme = "" if summary["filter"] == "none" else f" ({summary['scheme']})"
    parts = [f"{summary['scenario']}, seed {summary['seed']}: {stack}{scheme}"]
    for name, pattern in (("duration", "{:.4g} s"), ("mean_speed", "{:.4g} m/s"), ("collisions", "{:.0f} collisions")):
        if isinstance(summary.get(name), int | float):
            parts.append(pattern.format(summary[name]))
    return ", ".join([*parts, f"ended by {summary['ended']}"] if "ended" in summary else parts)


def summary_html(summary: Mapping[str, Any]) -> str:
    """Return a summary as an HTML table, escaped, for a notebook."""
    rows = "".join(f"<tr><td>{escape(key)}</td><td>{escape(_shown(value))}</td></tr>" for key, value in summary.items())
    caption = f"{summary_sentence(summary)}; SI units, hj-cosim metrics explains each"
    return f"<table><caption>{escape(caption)}</caption><tbody>{rows}</tbody></table>"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "–" if value is None else str(value)
