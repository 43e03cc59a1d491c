"""The page about a study as it is seen in a real headless Chromium: wide and narrow, light and dark."""

import re

import pandas as pd
import pytest

from hj_cosim.analysis.report import write_report
from hj_cosim.metrics.catalogue import shown_in_study
from hj_cosim.recording.summary_file import read_summary

HOSTILE = "</script><img src=x onerror=document.title='broken'>"
STACKS = [
    ("hjop", "spc", "mi"),
    ("op", "rss", "sw"),
    ("op", "none", "-"),
    ("KeepRightUnlessThereIsALorry", "spc", "mi"),
]
WINDOWS = {"wide": (1400, 900), "narrow": (390, 844)}


@pytest.fixture(scope="module")
def study(tmp_path_factory, make_hostile_run):
    """Return a study's folder with large numbers, a long name, a hostile one, and the run of one crash."""
    folder = tmp_path_factory.mktemp("study") / "study"
    run = make_hostile_run(folder / "episodes" / "hjop-spc-mi" / "7", HOSTILE)
    assert read_summary(run / "summary.json")["collisions"] > 0
    rows = []
    for number, stack in enumerate(STACKS):
        row = dict(zip(("scenario", "planner", "filter", "scheme"), (HOSTILE, *stack), strict=True))
        row |= {"episodes": 1000, "missing": 0}
        row |= {"ttc_2d_p1": 1234.5, "ttc_2d_p1_lo": -1234.5, "ttc_2d_p1_hi": 98765.4}
        for metric in shown_in_study():
            row |= {metric.name: 1234.5, f"{metric.name}_lo": -1234.5, f"{metric.name}_hi": 98765.4}
        rows.append({**row, "collision_episodes": [1, 0, 999, 0][number]})
    pd.DataFrame(rows).to_csv(folder / "table.csv", index=False)
    pd.DataFrame(rows).assign(**{f"other_{name}": "op" for name in ("planner", "filter", "scheme")}).to_csv(
        folder / "differences.csv", index=False
    )
    claims = {"claim": "mean_speed of HJOP is <more>", "excess": 0.1, "excess_lo": -0.1, "excess_hi": 0.2}
    holds = [("True", "True"), ("False", "False"), ("True", "False")]
    pd.DataFrame([{**claims, "holds": one, "certain": other} for one, other in holds]).to_csv(
        folder / "claims.csv", index=False
    )
    return folder


@pytest.fixture(scope="module")
def address(study, table):
    with pytest.MonkeyPatch.context() as patch:  # a run from anywhere names a table that would have to be solved
        patch.setattr("hj_cosim.analysis.study_episodes.table_of", lambda run: table)
        return write_report(study).as_uri()


@pytest.fixture(params=[(window, scheme) for window in WINDOWS for scheme in ("light", "dark")], ids="-".join)
def page(request, browser, address):
    window, scheme = request.param
    browser.events.clear()
    browser.look(*WINDOWS[window], scheme)
    browser.open(address)
    return browser


# The places of the texts that are shown in a table: [text, left, top, right, bottom] of each line of each.
TEXTS = """(selector => [...document.querySelectorAll(selector)].flatMap(element => {
  const walk = document.createTreeWalker(element, NodeFilter.SHOW_TEXT), found = [];
  while (walk.nextNode()) {
    const range = document.createRange();
    range.selectNodeContents(walk.currentNode);
    for (const box of range.getClientRects())
      if (box.width > 0) found.push([walk.currentNode.data, box.left, box.top, box.right, box.bottom]);
  }
  return found;
}))"""


def test_crash_counts_are_on_the_first_screen_the_worst_first(page):
    texts = page.evaluate(f"{TEXTS}('.crashes')")
    assert "".join(text for text, *_ in texts).startswith("999 of 1000")
    height = page.evaluate("innerHeight")
    assert all(top >= 0 and bottom <= height for _, _, top, _, bottom in texts)


def test_no_number_is_cut_and_none_lies_on_another(page):
    width = page.evaluate("innerWidth")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    texts = page.evaluate(f"{TEXTS}('.chosen')")
    assert sum(re.search(r"\d", text) is not None for text, *_ in texts) >= 2 * 4 * len(STACKS)
    assert all(left >= 0 and right <= width for _, left, _, right, _ in texts)
    for number, (text, left, top, right, bottom) in enumerate(texts):
        for other, *box in texts[number + 1 :]:
            beside = right <= box[0] + 1 or box[2] <= left + 1 or bottom <= box[1] + 3 or box[3] <= top + 3
            assert beside, f"{text!r} and {other!r} overlap"
    assert page.evaluate("[...document.querySelectorAll('.chosen td')].every(c => c.scrollWidth <= c.clientWidth)")


def test_texts_stand_out_from_what_is_behind_them(page):
    colours = page.evaluate(
        "['.chosen b', '.interval', '.note', '.crashes a', '.verdict', '.wide td'].map(s =>"
        " [s, getComputedStyle(document.querySelector(s)).color, getComputedStyle(document.body).backgroundColor])"
    )
    for selector, *pair in colours:
        light, dark = sorted((luminance(colour) for colour in pair), reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 4.5, selector


def luminance(colour: str) -> float:
    """Return the relative luminance of `rgb(r, g, b)` (WCAG 2.2)."""
    shares = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_the_first_column_stays_where_a_wide_table_is_scrolled(page):
    lefts = page.evaluate(
        "(() => { const box = [...document.querySelectorAll('.wide')].at(-1); box.scrollLeft = 300;"
        " return [box.scrollLeft, box.getBoundingClientRect().left,"
        " box.querySelector('td').getBoundingClientRect().left, box.tabIndex]; })()"
    )
    assert lefts[0] > 0
    assert lefts[2] == pytest.approx(lefts[1], abs=1)
    assert lefts[3] == 0


def test_claims_that_do_not_hold_come_first(page):
    assert page.evaluate("[...document.querySelectorAll('.verdict')].map(v => v.textContent)") == [
        "does not hold",
        "holds, not certain",
        "holds",
    ]


@pytest.mark.parametrize("page", [("wide", "light")], indirect=True, ids=["wide"])
def test_a_number_leads_to_its_episodes_and_an_episode_to_its_replay(page):
    page.evaluate("document.querySelector('.chosen a[href=\"#row-0\"]').click()")
    page.wait_for("document.querySelector('#row-0').closest('details').open")
    box = page.evaluate(
        "(() => { const a = document.querySelector('.episodes[open] td a'); a.scrollIntoView({block: 'center'});"
        " const b = a.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    assert page.complaints() == []
    page.click(*box)
    page.wait_for("location.href.endsWith('/7/replay.html') && document.readyState === 'complete'")
    assert page.text("time") == "0.00"
    assert page.complaints() == []
    assert page.evaluate("document.title") != "broken"
