"""How every picture looks: colours, sizes, and how it is saved."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
from matplotlib.figure import Figure

from hj_cosim.errors import OutputError
from hj_cosim.files import whole_file

if TYPE_CHECKING:
    import pandas as pd  # imported where a DataFrame is asked for: a picture needs none

# The palette of Okabe and Ito (2008), which colour-blind readers tell apart; in grey, the ones that meet in one
# picture also differ in lightness, line style or marker.
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
ROGUE = PURPLE  # who means harm
SUSPECT = "#000000"  # a ring, as opaque as the filter holds it likely that who is in it means harm
RING = (1.4, 1.0)  # m, by how much it is longer and wider than the car
ASPHALT = "#F1F1EE"
LANE_LINE = "#9A9A9A"
INTERVENTION = YELLOW
GREY = "#6B6B6B"

# Unsafe values are dark red, safe ones dark blue, zero is white: the two ends differ in hue, and the zero level is
# always drawn as a line, because both ends are dark in grey.
VALUE_COLOURS = LinearSegmentedColormap.from_list("value", ["#7F2704", VERMILION, "#FFFFFF", SKY_BLUE, "#08306B"])

PAGE_WIDTH = 7.2  # inches, two columns of the paper
COLUMN_WIDTH = 3.5  # inches, one column

_STYLE: dict[str, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "savefig.dpi": 160,
    "svg.hashsalt": "hj-cosim",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
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


def value_norm(limit: float) -> TwoSlopeNorm:
    """Return the colour scale from −limit to limit (m) with its middle at V = 0."""
    return TwoSlopeNorm(vcenter=0.0, vmin=-limit, vmax=limit)


def save_drawing(drawing: Drawing, path: Path) -> list[Path]:
    """Save a picture; without a suffix in `path` as raster, vector and table (.png, .pdf, .csv).

    Args:
        drawing: what to save.
        path: a file that ends in .png, .pdf, .svg or .csv (the data), or one without suffix.

    Returns:
        The files written.

    Raises:
        HjCosimError: if a file cannot be written, or its suffix is another.
    """
    paths = [path] if path.suffix else [path.with_name(path.name + suffix) for suffix in (".png", ".pdf", ".csv")]
    with house_style():
        # Laid out once: every rendering would move things a little further, and cost as much again. None, and not
        # "none", for which Matplotlib draws everything twice.
        drawing.figure.draw_without_rendering()
        drawing.figure.set_layout_engine(None)
    for target in paths:
        _save(drawing, target)
    return paths


def _save(drawing: Drawing, path: Path) -> None:
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
                drawing.figure.savefig(picture, format=path.suffix[1:], metadata=_UNDATED[path.suffix])
            temporary.write_bytes(picture.getvalue())


def _write_csv(file: TextIO, columns: Mapping[str, Iterable[Any]]) -> None:
    """Write columns as CSV, numbers with all their digits; of what is not known, nothing."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(columns)
    plain = (np.asarray(column).tolist() for column in columns.values())
    known = (["" if value is None or value != value else value for value in column] for column in plain)
    writer.writerows(zip(*known, strict=True))
