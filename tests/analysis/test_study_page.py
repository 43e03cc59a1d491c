"""What the page about a study says of crashes, as text."""

import re
from pathlib import Path

import pandas as pd
import pytest

from hj_cosim.analysis.report import write_report
from hj_cosim.metrics.catalogue import shown_in_study


def crashes_on_the_page(folder: Path, counts: list[int]) -> list[str]:
    folder.mkdir()
    stacks = [("hjop", "spc", "mi"), ("op", "rss", "sw"), ("op", "none", "-")]
    rows = []
    for stack, count in zip(stacks, counts, strict=False):
        row = dict(zip(("scenario", "planner", "filter", "scheme"), ("paper", *stack), strict=True))
        row |= {"episodes": 10, "missing": 0}
        row |= {"ttc_2d_p1": 1.0, "ttc_2d_p1_lo": 0.5, "ttc_2d_p1_hi": 2.0}
        for metric in shown_in_study():
            row |= {metric.name: 1.0, f"{metric.name}_lo": 0.5, f"{metric.name}_hi": 2.0}
        rows.append({**row, "collision_episodes": count})
    pd.DataFrame(rows).to_csv(folder / "table.csv", index=False)
    page = write_report(folder, replays=False).read_text(encoding="utf-8")
    listed = re.search(r'<ul class="crashes">(.*?)</ul>', page, re.S)
    assert listed is not None
    return [re.sub(r"<[^>]+>", "", line) for line in re.findall(r"<li>(.*?)</li>", listed[1], re.S)]


@pytest.mark.parametrize(
    ("counts", "lines"),
    [
        ([0, 0, 0], ["0 of 30 in all 3 rows: hjop-spc-mi; op-rss-sw; op-none"]),
        ([0, 0, 4], ["4 of 10 op-none", "0 of 20 in the other 2 rows: hjop-spc-mi; op-rss-sw"]),
        ([0], ["0 of 10 in one row: hjop-spc-mi"]),
    ],
)
def test_rows_without_a_crash_are_counted_together(tmp_path, counts, lines) -> None:
    assert crashes_on_the_page(tmp_path / "study", counts) == lines
