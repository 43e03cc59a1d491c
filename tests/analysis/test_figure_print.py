"""Every figure as it is printed: its width, its fonts, nothing cut off, no text on another."""

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.attack import BEHAVIOUR, ROWS, SHARE, attack
from hj_cosim.analysis.figures.catalogue import FIGURES
from hj_cosim.analysis.figures.gallery import draw_figure, function_of
from hj_cosim.analysis.figures.side_by_side import side_by_side
from hj_cosim.analysis.figures.sweep import PANELS, density_sweep, sweep
from hj_cosim.analysis.figures.target_sets import TABLE, target_sets
from hj_cosim.analysis.figures.timeline import timeline
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN, trade_off
from hj_cosim.errors import OutputError
from hj_cosim.files import temporary_folder
from hj_cosim.recording.run_folder import Run

STACKS = [("hjop", "spc", "mi"), ("op", "rss", "sw"), ("op", "none", "-")]
OF_RUNS = [name for name, kind in FIGURES.items() if kind.source == "run"]
OF_TABLES = [name for name, kind in FIGURES.items() if kind.source == "table"]
OF_STUDIES = ("trade-off", "sweep", "density-sweep", "attack", "target-sets")


def _texts(figure: Figure) -> list[Text]:
    """Return what is written in a figure; labels of ticks beyond an axis are not."""
    beyond = set()
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        room = 1e-6 * (high - low)
        drawn = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        seen = [tick for tick in drawn if low - room <= tick.get_loc() <= high + room]
        for tick in (*axis.majorTicks, *axis.minorTicks):  # an axis keeps ticks that it used before
            if tick not in seen:
                beyond |= {tick.label1, tick.label2}
    found = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    return [text for text in found if text not in beyond]


def _check_print(drawing: style.Drawing, width: int) -> None:
    """Lay a figure out as it is saved, and measure every text in it."""
    figure = drawing.figure
    with temporary_folder() as folder:
        style.save_drawing(drawing, folder / "figure.csv")
    with style.house_style():  # on which depends how many ticks there are
        texts = _texts(figure)
        boxes = {text: text.get_window_extent().padded(-0.5) for text in texts}
    assert figure.get_figwidth() * 25.4 == pytest.approx(width)
    assert len(figure.get_suptitle().split()) > 4, "a figure's title is a sentence"
    assert len(texts) > 3
    sizes = {text.get_text(): text.get_fontsize() for text in texts}
    assert min(sizes.values()) >= style.SMALLEST_FONT, sizes
    sheet = figure.bbox.padded(1.0)
    for text, box in boxes.items():
        inside = sheet.x0 <= box.x0 and box.x1 <= sheet.x1 and sheet.y0 <= box.y0 and box.y1 <= sheet.y1
        assert inside, f"{text.get_text()!r} is cut off"
    for (one, box), (other, its) in itertools.combinations(boxes.items(), 2):
        assert not box.overlaps(its), f"{one.get_text()!r} overlaps {other.get_text()!r}"


@pytest.fixture
def run(record, config, tmp_path) -> Run:
    return Run(tmp_path, config.model_dump(mode="json"), {"seed": 7}, record)


def _study_table(**factors: list[object]) -> pd.DataFrame:
    """Return a study's table with a row for each combination of factors and each of STACKS."""
    names = {*METRICS_SHOWN, *(name for name, _ in (*PANELS, *ROWS))}
    rows = [
        dict(zip(factors, values, strict=True))
        | {"planner": planner, "filter": safety_filter, "scheme": scheme, "episodes": 3}
        | {f"{name}{end}": 20.0 + number + shift for name in names for end, shift in (("", 0), ("_lo", -1), ("_hi", 1))}
        for values in itertools.product(*factors.values())
        for number, (planner, safety_filter, scheme) in enumerate(STACKS)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize("width", style.WIDTHS)
@pytest.mark.parametrize("name", OF_TABLES)
def test_a_figure_of_a_table_can_be_printed(name, width, table):
    _check_print(draw_figure(name, table=table, width=width), width)


@pytest.mark.parametrize("width", style.WIDTHS)
@pytest.mark.parametrize("name", OF_RUNS)
def test_a_figure_of_a_run_can_be_printed(name, width, run, table):
    kind = FIGURES[name]
    _check_print(function_of(kind)(*((run, table) if kind.needs_table else (run,)), width=width), width)


@pytest.mark.parametrize("width", style.WIDTHS)
def test_figures_of_a_study_can_be_printed(width):
    _check_print(trade_off(_study_table(**{"planner.gamma_r": [0.8, 0.9]}), width), width)
    _check_print(trade_off(_study_table(scenario=["six_lanes", "dense"]), width), width)
    _check_print(sweep(_study_table(scenario=["paper", "light"], **{"planner.gamma_r": [0.8, 0.9]}), width), width)
    _check_print(density_sweep(_study_table(scenario=["paper", "light"]), {"light": 6.0, "paper": 13.0}, width), width)
    seven = ["six_lanes", "two_lanes", "lane_drop", "motorway", "ramps", "ring", "curves"]
    _check_print(density_sweep(_study_table(scenario=seven), dict.fromkeys(seven, 13.0), width), width)
    _check_print(attack(_study_table(**{BEHAVIOUR: ["cut_in", "worst"], SHARE: [0.05, 0.2]}), width), width)
    five = ["light", "paper", "dense", "rogues", "six_lanes"]
    _check_print(target_sets(_study_table(scenario=five, **{TABLE: ["highway", "highway_ttc"]}), width), width)
    assert {name for name, kind in FIGURES.items() if kind.source == "study"} == set(OF_STUDIES)


@pytest.mark.parametrize("width", style.WIDTHS)
def test_time_lines_beside_each_other_can_be_printed(width, run):
    _check_print(side_by_side({"paper-hjop-spc-mi-1000": run, "paper-op-rss-sw-1000": run}, width), width)


def test_another_width_is_refused():
    for width in (0, 84, 1000):
        with pytest.raises(OutputError, match=f"85 or 178 mm wide, one column or two; {width} is neither"):
            draw_figure("schematic", width=width)


def test_a_pdf_has_its_fonts_in_it_as_outlines_that_can_be_edited(run, tmp_path):
    (path,) = style.save_drawing(timeline(run), tmp_path / "timeline.pdf")
    content = path.read_bytes()
    assert b"/FontFile2" in content  # TrueType, embedded
    assert b"/Type3" not in content
    assert b"/Subtype /Image" not in content


def test_titles_keep_numbers_with_their_units_and_have_minus_signs():
    title = style.sheet(style.COLUMN, 40.0, "V falls " * 9 + "to -3.5 m, which is < 0, at t-1 = 4 s").get_suptitle()
    assert title.count("\n") >= 1
    words = title.replace("\n", " ").replace("\N{NO-BREAK SPACE}", "~")
    assert words.endswith("to \N{MINUS SIGN}3.5~m, which is~<~0, at t-1~=~4~s")


def test_a_sweep_has_the_varied_setting_on_its_axis_in_order_and_a_colour_for_each_value_of_another():
    table = _study_table(scenario=["paper", "light"], **{"planner.gamma_r": ["0.9", "1.0", "0.8"]})
    drawing = sweep(table)
    axes = drawing.figure.axes[-1]
    assert axes.get_xlabel() == "planner.gamma_r"
    assert drawing.data["planner.gamma_r"].drop_duplicates().tolist() == ["0.8", "0.9", "1.0"]
    lines = [bars.lines[0] for bars in axes.containers]
    assert len(lines) == 2 * len(STACKS)
    for line in lines:
        np.testing.assert_allclose(np.asarray(line.get_xdata(), float), [0.8, 0.9, 1.0], atol=0.01)
    assert len({line.get_color() for line in lines}) == 2
    with pytest.raises(OutputError, match="study that varies a setting"):
        sweep(_study_table())
