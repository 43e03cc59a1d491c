"""Pieces of the pages: everything that comes from a run is escaped, and a page may load nothing from anywhere."""

import base64
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import tomli_w

from hj_cosim.analysis.figures.style import Drawing, save_drawing
from hj_cosim.files import temporary_folder
from hj_cosim.metrics.catalogue import FACTS, METRICS

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_LIVE = "; connect-src 'self'"


def page(title: str, parts: Iterable[str], kind: str = "", *, is_live: bool = False) -> str:
    """Return a whole HTML document that needs nothing else.

    Args:
        title: plain text, also its heading.
        parts: HTML, one below the other; empty ones are left out.
        kind: the class of its body, for the style sheet; one that is `embedded` in another has no heading.
        is_live: whether it may listen to the server that it comes from.
    """
    body = "\n".join(part for part in parts if part)
    heading = "" if kind == "embedded" else f"<h1>{escape(title)}</h1>\n"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY + _LIVE * is_live}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{resource('report.css')}</style></head>\n"
        f'<body class="{kind}">\n{heading}{body}\n</body></html>\n'
    )


def figure(drawing: Drawing, caption: str) -> str:
    """Return a picture as HTML, with its caption below it."""
    with temporary_folder() as folder:
        path = save_drawing(drawing, folder / "figure.png")[0]
        picture = base64.b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{picture}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def resource(name: str) -> str:
    """Return the text of one of the files in page/."""
    return files("hj_cosim.analysis").joinpath("page", name).read_text(encoding="utf-8")


def in_script(document: str) -> str:
    """Return JSON that cannot end the script element that it stands in."""
    return document.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def toml(config: Mapping[str, Any]) -> str:
    """Return settings as TOML."""
    return tomli_w.dumps(config)


def label(key: str) -> str:
    """Return how a key of a summary is called; its own name if it is no metric of ours."""
    return METRICS[key].label_with_unit if key in METRICS else key


def meaning(key: str) -> str:
    """Return what a key of a summary means; nothing if it is none of ours."""
    return METRICS[key].explanation if key in METRICS else next((f.explanation for f in FACTS if f.name == key), "")


def value_text(key: str, value: Any) -> str:
    """Return a value as its metric is shown; a run from elsewhere may hold anything under a metric's name."""
    if key in METRICS and isinstance(value, int | float):
        return METRICS[key].text(value)
    return shown(value)


def shown(value: Any) -> str:
    """Return any value for people; a dash where there is none."""
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else "–"
    return "–" if value is None else str(value)


def replay_parts(data: Mapping[str, Any]) -> list[str]:
    """Return the replay of a run as parts of a page.

    Args:
        data: as `replay_data.replay_data` returns it.
    """
    return [
        resource("replay.html"),
        f'<script type="application/json" id="run">{in_script(json.dumps(data, allow_nan=False))}</script>',
        f"<script>{resource('replay.js')}</script>",
    ]


def table_region(
    head: Sequence[str], rows: Iterable[Sequence[str]], name: str, keys: Sequence[str] = (), kind: str = ""
) -> str:
    """Return a table that scrolls sideways by itself, under a first column that stays, also by keyboard.

    Args:
        head: HTML of the headings.
        rows: HTML of the cells.
        name: what it is, for who cannot see it.
        keys: of the columns, for scripts.
        kind: a class for the style sheet.
    """
    marks = [f' data-key="{escape(key)}"' for key in keys] or [""] * len(head)
    header = "".join(f'<th scope="col"{mark}>{text}</th>' for text, mark in zip(head, marks, strict=True))
    lines = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="wide {kind}" role="region" tabindex="0" aria-label="{escape(name)}"><table>'
        f"<thead><tr>{header}</tr></thead><tbody>{lines}</tbody></table></div>"
    )


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], name: str) -> str:
    """Return a table of plain texts as HTML; `name` says what it is to who cannot see it."""
    return table_region([escape(text) for text in head], [[escape(cell) for cell in row] for row in rows], name)
