"""How every picture looks: colours, sizes, and how it is saved."""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from hj_cosim.errors import OutputError
from hj_cosim.files import whole_file
from hj_cosim.recording.study_files import require_not_ours

if TYPE_CHECKING:
    import pandas as pd  # imported where a DataFrame is asked for: a picture needs none

# The palette of Okabe and Ito (2008), which colour-blind readers tell apart. What meets in one picture also differs in
# lightness, or in line style and marker, for those who print in grey: tests/analysis/test_palette.py.
BLACK = "#000000"
ORANGE = "#E69F00"
SKY_BLUE = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"

ROBOT = VERMILION
CAR = "#A9C9DE"  # a pale sky blue: light where the robot is dark
CAR_EDGE = "#33566B"
ROGUE = "#8C2D6B"  # a dark purple: who means harm
SUSPECT = "#000000"  # a ring, as opaque as the filter holds it likely that who is in it means harm
RING = (1.4, 1.0)  # m, by how much it is longer and wider than the car
ASPHALT = "#F1F1EE"
LANE_LINE = "#9A9A9A"
INTERVENTION = YELLOW
GREY = "#6B6B6B"

# Unsafe values are dark and red, safe ones light and blue, so that grey still tells which is which; V = 0, where the
# hue changes, is always drawn as a line.
VALUE_COLOURS = LinearSegmentedColormap.from_list(
    "value",
    [(0.0, "#4A1500"), (0.3, "#A8430B"), (0.5, "#EE9450"), (0.5, "#A9C4E6"), (0.75, "#C9DDF2"), (1.0, "#E9F2FB")],
)

COLUMN, PAGE = 85, 178  # mm, one column of a journal, and two
WIDTHS = (COLUMN, PAGE)
SMALLEST_FONT = 7.0  # points, at the stated width
PRINT_DPI = 300
_MM_PER_INCH = 25.4
_POINTS_PER_INCH = 72.0
_TITLE_SIZE = 9.0  # points
LEGEND_SIZE = 7.5  # points
_HANDLE = 40.0  # points beside a label in a legend
_MARGIN = 4.0  # points left of a title
_MEASURED = 1.03  # what a rendering may make of a text's width

_STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,  # a speed of 23.6 m/s is to be read as one
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": LEGEND_SIZE,
    "legend.title_fontsize": LEGEND_SIZE,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "savefig.dpi": 160,
    "svg.hashsalt": "hj-cosim",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,  # whole fonts, embedded: editors can change the text, and printers need none of their own
}

# What keeps the date and the version of matplotlib out of each format, so that the same data give the same bytes.
_UNDATED: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    ".svg": {"Date": None, "Creator": None},
}


@dataclass(frozen=True)
class Drawing:
    """A picture and the table of the data in it, by its columns, which are equally long."""

    figure: Figure
    columns: Mapping[str, Iterable[Any]]

    @cached_property
    def data(self) -> "pd.DataFrame":
        """The table as a DataFrame."""
        import pandas as pd

        return pd.DataFrame(dict(self.columns))


def columns_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return rows as columns; what a row leaves out is None."""
    return {name: [row.get(name) for row in rows] for name in dict.fromkeys(name for row in rows for name in row)}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in this project's style while the block lasts."""
    with mpl.rc_context({**mpl.rcParamsDefault, **_STYLE}):
        yield


def require_width(width: int) -> None:
    """Require one of WIDTHS (mm).

    Raises:
        OutputError: if it is another.
    """
    if width not in WIDTHS:
        raise OutputError(f"a figure is {' or '.join(map(str, WIDTHS))} mm wide, one column or two; {width} is neither")


def sheet(width: int, height: float, message: str, *, to_scale: bool = False) -> Figure:
    """Return an empty figure under a title.

    Args:
        width: mm, one of WIDTHS.
        height: mm, without the title's lines.
        message: what the picture shows, as a sentence; in as many lines as it takes.
        to_scale: whether its axes have one scale in both directions.

    Raises:
        OutputError: if the width is another.
    """
    require_width(width)
    inches = width / _MM_PER_INCH
    lines = _wrapped(message, (inches * _POINTS_PER_INCH - 2.0 * _MARGIN) / _MEASURED)
    title = (1.25 * _TITLE_SIZE * len(lines) + _MARGIN) / _POINTS_PER_INCH
    # Laid out as finely as it is printed: at a screen's resolution the rounded widths of texts are a point off.
    size = (inches, height / _MM_PER_INCH + title)
    figure = Figure(size, dpi=PRINT_DPI, layout="compressed" if to_scale else "constrained")
    figure.suptitle("\n".join(lines), x=_MARGIN / (inches * _POINTS_PER_INCH), ha="left", fontsize=_TITLE_SIZE)
    return figure


def _wrapped(text: str, width: float) -> list[str]:
    """Return a text in lines of at most a width (points), at the title's size."""
    lines = [""]
    # A number stays with its unit, and both sides of a relation with each other.
    together = re.sub(r"(?<=\d) (?=(?:m|s|km|m/s|%)\b|%)| (?=[<>=])|(?<=[<>=]) ", "\N{NO-BREAK SPACE}", signed(text))
    for word in together.split(" "):
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _width(longer, _TITLE_SIZE) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _width(text: str, size: float) -> float:
    """Return the width of a text at a size, both in points."""
    is_formula = text.count("$") - text.count(r"\$") > 1
    return float(text_to_path.get_text_width_height_descent(text, FontProperties(size=size), ismath=is_formula)[0])


def signed(text: str) -> str:
    """Return a text in which what stands before a number as its sign is a minus sign, not a hyphen."""
    return re.sub(r"(?<![\w.)])-(?=\d)", "\N{MINUS SIGN}", text)


def legend_beside(figure: Figure, axes: Axes, width: int, title: str | None = None) -> None:
    """Put the legend of some axes where it hides nothing: beside all axes, in one column below them."""
    handles, names = axes.get_legend_handles_labels()
    if width == COLUMN:
        longest = max((_width(name, LEGEND_SIZE) for name in names), default=0.0)
        columns = 2 if longest + _HANDLE < 0.5 * width / _MM_PER_INCH * _POINTS_PER_INCH else 1
        figure.legend(handles, names, loc="outside lower left", ncols=columns, title=title, alignment="left")
    else:
        figure.legend(handles, names, loc="outside right center", title=title)


def value_norm(limit: float) -> TwoSlopeNorm:
    """Return the colour scale from −limit to limit (m) with its middle at V = 0."""
    return TwoSlopeNorm(vcenter=0.0, vmin=-limit, vmax=limit)


def places_of(path: Path) -> list[Path]:
    """Return the files that `save_drawing` writes, for whoever wants to know before there is a drawing.

    Raises:
        RunFolderError: if one of them is a run's or a study's own.
    """
    paths = [path] if path.suffix else [path.with_name(path.name + suffix) for suffix in (".png", ".pdf", ".csv")]
    for target in paths:
        require_not_ours(target)
    return paths


def save_drawing(drawing: Drawing, path: Path, dpi: int | None = None) -> list[Path]:
    """Save a picture; without a suffix in `path` as raster, vector and table (.png, .pdf, .csv).

    Args:
        drawing: what to save.
        path: a file that ends in .png, .pdf, .svg or .csv (the data), or one without suffix.
        dpi: of a raster picture; the screen's 160 unless given.

    Returns:
        The files written.

    Raises:
        HjCosimError: if a file cannot be written, its suffix is another, or it is one of a run's or a study's own.
    """
    paths = places_of(path)
    with house_style():
        # Laid out once: every rendering would move things a little further, and cost as much again. None, and not
        # "none", for which Matplotlib draws everything twice.
        drawing.figure.draw_without_rendering()
        drawing.figure.set_layout_engine(None)
    for target in paths:
        _save(drawing, target, dpi)
    return paths


def _save(drawing: Drawing, path: Path, dpi: int | None) -> None:
    if path.suffix not in (*_UNDATED, ".csv"):
        raise OutputError(f"cannot draw {path}: a picture ends in .png, .pdf or .svg, its data in .csv")
    with whole_file(path) as temporary:
        if path.suffix == ".csv":
            with temporary.open("w", encoding="utf-8", newline="") as file:
                _write_csv(file, drawing.columns)
        else:
            # In memory first: Matplotlib's PDF stumbles over itself when the disk is full.
            picture = io.BytesIO()
            with house_style():
                drawing.figure.savefig(picture, format=path.suffix[1:], dpi=dpi, metadata=_UNDATED[path.suffix])
            temporary.write_bytes(picture.getvalue())


def _write_csv(file: TextIO, columns: Mapping[str, Iterable[Any]]) -> None:
    """Write columns as CSV, numbers with all their digits; of what is not known, nothing."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(columns)
    plain = (np.asarray(column).tolist() for column in columns.values())
    known = (["" if value is None or value != value else value for value in column] for column in plain)
    writer.writerows(zip(*known, strict=True))
